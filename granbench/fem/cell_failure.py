"""Errors of a cell's code: it raises, or does not return stress and state."""

from __future__ import annotations

from granbench.cells.user_code import failure_location
from granbench.errors import AnalysisError, GranbenchError


class CellFailure(AnalysisError):
    """A cell raised an error, or did not return stress and state.

    Parameters
    ----------
    sentence : what happened
    step : of the analysis; 0 at the start
    """

    def __init__(self, sentence: str, step: int) -> None:
        self.step = step
        super().__init__(sentence)


def raised(model: str, error: BaseException, step: int) -> CellFailure:
    """The error that a cell raised, with the line of user code that raised it."""
    if isinstance(error, GranbenchError):
        return CellFailure(str(error), step)
    return CellFailure(
        f"{model} failed in step {step} {failure_location(error)}; fix the model", step
    )


def misanswered(model: str, found: object, step: int) -> CellFailure:
    """The error of a cell that did not return tensors."""
    kinds = [type(part).__name__ for part in (found if isinstance(found, tuple) else (found,))]
    return CellFailure(
        f"{model} returned {', '.join(kinds)} in step {step}; step must return two tensors, "
        "stress and state",
        step,
    )
