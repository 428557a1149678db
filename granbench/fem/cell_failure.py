"""A cell that fails as a program, not as a material: it raises, or returns something else."""

from __future__ import annotations

from granbench.cells.user_code import failure_location
from granbench.errors import AnalysisError, GranbenchError


class CellFailure(AnalysisError):
    """A cell raised an error, or answered with something other than stress and state.

    Parameters
    ----------
    sentence : what happened
    step : of the analysis; 0 before anything is strained
    """

    def __init__(self, sentence: str, step: int) -> None:
        self.step = step
        super().__init__(sentence)


def raised(model: str, error: BaseException, step: int) -> CellFailure:
    """A cell raised an error: its own sentence, or the line of user code where it happened."""
    if isinstance(error, GranbenchError):
        return CellFailure(str(error), step)
    return CellFailure(
        f"{model} failed in step {step} {failure_location(error)}; fix the model", step
    )


def misanswered(model: str, found: object, step: int) -> CellFailure:
    """A cell answered with anything but tensors."""
    kinds = [type(part).__name__ for part in (found if isinstance(found, tuple) else (found,))]
    return CellFailure(
        f"{model} answers in step {step} with {', '.join(kinds)}; a step must return two tensors, "
        "of stress and of state",
        step,
    )
