"""The check of a cell before its use, and again after it.

Before the use a few points are taken along a few increments: twice, again from stored states, and
one by one. After the use the same calls are repeated, and so are some of the steps that the use
itself made, see `granbench.cells.check.repeatability`. What can be corrected safely is corrected
for as long as the cell is used: modules in training mode are put into evaluation mode, and where
gradients are missing or wrong, Newton's method takes differences. Anything else is refused, with
what to change in the model.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import torch
from torch import Tensor

from granbench.cells.check.cell_check import CellCheck
from granbench.cells.check.repeatability import RecordedSteps, fresh_copy, require_same_results
from granbench.cells.check.snapshot import evaluation_mode, snapshot
from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.user_code import user_code


def check_cell(
    cell: MaterialCell,
    start: Conditions | Tensor | None = None,
    increments: Tensor | None = None,
) -> tuple[str, ...]:
    """Make sure that a cell can be scored: its results depend on the increment and the state only.

    Parameters
    ----------
    cell : the model
    start : what is known of some points, or their states (point, n_state); by default isotropic
        stresses of 100 to 400 kPa, a void ratio and a grading index
    increments : (point, step, component), strain, compression positive; small ones by default

    Returns
    -------
    Notes on what GranBench corrects wherever it uses the cell; none for most cells

    Raises
    ------
    ModelError
        If the cell does not keep the contract of `MaterialCell`, or fails; with what to change.
    """
    with checked_cell(cell, start, increments) as check:
        return check.notes


@contextmanager
def checked_cell(
    cell: MaterialCell,
    start: Conditions | Tensor | None = None,
    increments: Tensor | None = None,
) -> Iterator[CellCheck]:
    """A cell that is checked, used in the block, and checked again at its end.

    Parameters and errors are those of `check_cell`. Within the block its modules are in evaluation
    mode, and `cheap_tangent` is false where its gradients are missing or wrong.
    """
    with evaluation_mode(cell) as kinds:
        with user_code(f"{_name(cell)} failed"):
            check = CellCheck(cell, start, increments, kinds)
        fresh, contents = fresh_copy(cell), snapshot(cell)
        recorded = RecordedSteps(cell)
        with ExitStack() as corrections:
            if check.by_differences:
                corrections.enter_context(_attribute(cell, "cheap_tangent", False))
            if not cell.reads_records:
                corrections.enter_context(_attribute(cell, "step", recorded))
            yield check
        with user_code(f"{cell.name} failed"):
            check.repeat()
            steps = recorded.all()
            if steps is not None:
                with torch.no_grad():
                    require_same_results(cell, steps, fresh, contents)


@contextmanager
def _attribute(cell: MaterialCell, name: str, value: Any) -> Iterator[None]:
    """Give a cell an attribute of its own, and take it away again."""
    own = vars(cell)
    before = {name: own[name]} if name in own else {}
    own[name] = value
    try:
        yield
    finally:
        own.pop(name, None)
        own.update(before)


def _name(cell: Any) -> str:
    """The name of what may not be a cell."""
    return str(getattr(cell, "name", type(cell).__name__))
