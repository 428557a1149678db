"""A cell that fails as a program, not as a material: it raises, or answers with no stress."""

from __future__ import annotations

from granbench.errors import AnalysisError, GranbenchError, where_it_fell


class CellFailure(AnalysisError):
    """A cell raised an error, or answered with what is no stress and state.

    Parameters
    ----------
    sentence : what happened
    step : of the analysis; 0 before anything is strained
    """

    def __init__(self, sentence: str, step: int) -> None:
        self.step = step
        super().__init__(sentence)


def raised(model: str, error: Exception, step: int) -> CellFailure:
    """Of a cell that raised: what it says of itself, or for a stranger's code, where it fell."""
    if isinstance(error, GranbenchError):
        return CellFailure(str(error), step)
    return CellFailure(
        f"{model} failed in step {step} {where_it_fell(error)}; mend the model", step
    )


def misanswered(model: str, found: object, step: int) -> CellFailure:
    """Of a cell that answered with anything but tensors."""
    kinds = [type(part).__name__ for part in (found if isinstance(found, tuple) else (found,))]
    return CellFailure(
        f"{model} answers in step {step} with {', '.join(kinds)}; a step must return two tensors, "
        "of stress and of state",
        step,
    )
