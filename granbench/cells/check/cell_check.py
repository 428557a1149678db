"""The check of a cell before it is believed: to the same question it gives the same answer.

A few points are taken over a few increments, again, from stored states, and one by one. After the
use they are asked again, and so are some of the questions of the use itself, see
`granbench.cells.check.repeatability`. What is
safe is put right for as long as the cell is used: modules in training mode are put into evaluation
mode, and where gradients are missing or wrong, Newton's method takes differences. The rest is
refused with what to change.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from granbench.cells.check.attributes import kind, require_attributes, require_tensor
from granbench.cells.check.probe import default_start, probe_increments
from granbench.cells.check.repeatability import (
    MIXES_ROWS,
    ROUNDINGS,
    SHARE,
    RecordedSteps,
    changed_by_use,
    different_answers,
    fresh_copy,
    require_same_answers,
)
from granbench.cells.check.snapshot import changed, evaluation_mode, snapshot
from granbench.cells.check.tangent import tangent_mismatch
from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.finite_differences import step_and_tangent
from granbench.cells.robust_runs import finite_points, robust_call
from granbench.cells.user_code import user_code
from granbench.errors import GranbenchError, ModelError
from granbench.tensors import COMPONENT_ORDERS

REPEATED = (1e-6, 16.0)
TOGETHER = (SHARE, ROUNDINGS)
"""How far answers may differ: a share of the largest change of stress, and roundings of the cell's
floating type at the largest stress. Those to the same call differ by nothing but the order of
threads: `REPEATED` finds memories and random numbers. Those to batches of other sizes are rounded
differently, upon which error control may take other substeps: `TOGETHER` finds points that depend
on each other by more than that."""


def check_cell(
    cell: MaterialCell,
    start: Conditions | Tensor | None = None,
    increments: Tensor | None = None,
) -> tuple[str, ...]:
    """Make sure that a cell can be scored: that its answers follow from increment and state alone.

    Parameters
    ----------
    cell : the model
    start : what is known of some points, or their states (point, n_state); by default isotropic
        stresses of 100 to 400 kPa, a void ratio and a grading index
    increments : (point, step, component), strain, compression positive; small ones by default

    Returns
    -------
    Remarks on what is put right wherever GranBench uses the cell

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
) -> Iterator["CellCheck"]:
    """A cell that is checked, used in the block, and asked the same again at its end.

    Parameters and errors are those of `check_cell`. Within the block its modules are in evaluation
    mode, and `cheap_tangent` is false where its gradients are missing or wrong.
    """
    with evaluation_mode(cell) as kinds:
        with user_code(f"{_name(cell)} failed"):
            check = CellCheck(cell, start, increments, kinds)
        before = vars(cell).get("cheap_tangent")
        if check.by_differences:
            cell.cheap_tangent = False
        fresh, contents = fresh_copy(cell), snapshot(cell)
        try:
            with _recorded(cell) as recorded:
                yield check
        finally:
            if check.by_differences:
                del cell.cheap_tangent
                if before is not None:
                    cell.cheap_tangent = before
        with user_code(f"{cell.name} failed"):
            check.confirm()
            asked = recorded.answers()
            if asked is not None:
                with torch.no_grad():
                    require_same_answers(cell, asked, fresh, contents)


@contextmanager
def _recorded(cell: MaterialCell) -> Iterator[RecordedSteps]:
    """Keep some of the steps that a cell takes; none of a cell that reads records."""
    recorded = RecordedSteps(cell)
    own = vars(cell)
    before = own.get("step")
    if not cell.reads_records:
        own["step"] = recorded
    try:
        yield recorded
    finally:
        own.pop("step", None)
        if before is not None:
            own["step"] = before


@dataclass(frozen=True)
class _Course:
    """Answers along increments; step 0 of the states is the start."""

    stress: Tensor
    states: tuple[Tensor, ...]


class CellCheck:
    """A cell that has passed, and what is known of it.

    Parameters
    ----------
    cell, start, increments : see `check_cell`
    training : kinds of its modules that were in training mode

    Attributes
    ----------
    notes : what was put right, in sentences
    by_differences : whether its tangent is to be taken from differences of its stresses
    answers : (point, step, component), its stresses, Pa

    Raises
    ------
    ModelError
        See `check_cell`.
    """

    def __init__(
        self,
        cell: MaterialCell,
        start: Conditions | Tensor | None = None,
        increments: Tensor | None = None,
        training: list[str] | None = None,
    ) -> None:
        require_attributes(cell)
        self.cell = cell
        self.start = default_start(cell) if start is None else start
        given = probe_increments(cell.order, self._points()) if increments is None else increments
        self.increments = [part.to(cell.dtype) for part in given.unbind(dim=1)]
        self.by_differences = False
        notes = []
        if training:
            notes.append(
                f"{cell.name} was in training mode ({', '.join(training)}) and is used in "
                "evaluation mode; call `.eval()` on its module"
            )
        self._contents = snapshot(cell)
        with torch.no_grad():
            self._first = self._course(slice(None))
            self._require_same_again()
            self._require_independent_points()
            if not finite_points(self._first.stress.flatten(1)).all():
                notes.append(f"{cell.name} gives no finite stress in some of its first increments")
        notes += self._looked_at_tangent()
        self.answers = self._first.stress
        self.notes = tuple(notes)

    def confirm(self) -> None:
        """Ask the same once more.

        Raises
        ------
        ModelError
            If the cell answers otherwise after it was used.
        """
        with torch.no_grad():
            self._require_same_again()

    def _points(self) -> int:
        return len(self.start if isinstance(self.start, Tensor) else self.start.stress)

    def _start(self, points: slice) -> Tensor:
        """States (point, n_state) at the start."""
        if isinstance(self.start, Tensor):
            return self.start[points].clone()
        past = self.start.accumulated_strain
        state = self.cell.initial_state(
            Conditions(
                self.start.stress[points].clone(),
                {name: values[points].clone() for name, values in self.start.scalars.items()},
                None if past is None else past[points].clone(),
            )
        )
        count = len(self.start.stress[points])
        require_tensor(self.cell, "initial_state", "a state", state, (count, self.cell.layout.size))
        return state

    def _course(self, points: slice) -> _Course:
        """The cell along the increments of some points; what it is given must stay as it is."""
        states = [self._start(points)]
        kept = [states[0].clone()]
        stresses, kept_stresses = [], []
        for increment in self.increments:
            stress, after = self._asked(increment[points], states[-1])
            stresses.append(stress)
            states.append(after)
            kept_stresses.append(stress.clone())
            kept.append(after.clone())
        pairs = zip([*states, *stresses], [*kept, *kept_stresses], strict=True)
        if not all(_same(one, other) for one, other in pairs):
            raise ModelError(
                f"{self.cell.name} changes a stress or state that it returned before: it writes "
                "into the same tensor at every step; return a new one, as `stress.clone()`"
            )
        return _Course(torch.stack(kept_stresses, dim=1), tuple(kept))

    def _asked(self, increment: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """One step, whose form is checked."""
        dstrain, before = increment.clone(), state.clone()
        result = robust_call(self.cell.step, dstrain, state)
        if not isinstance(result, tuple) or len(result) < 2:
            raise ModelError(
                f"`step` of {self.cell.name} returns {kind(result)}; it must return two tensors, "
                "of stress and of state"
            )
        stress, after = result[:2]
        count, components = increment.shape
        require_tensor(self.cell, "step", "a stress", stress, (count, components))
        require_tensor(self.cell, "step", "a state", after, (count, self.cell.layout.size))
        for what, one, other in (("dstrain", increment, dstrain), ("state", before, state)):
            if not _same(one, other):
                raise ModelError(
                    f"`step` of {self.cell.name} changes `{what}`, which it is given, in place; "
                    f"begin it with `{what} = {what}.clone()`"
                )
        return stress, after

    def _require_same_again(self) -> None:
        """Whole courses again, and single steps from stored states, in another order."""
        again = self._course(slice(None))
        self._require_close(again.stress, self._first.stress)
        for at in reversed(range(len(self.increments))):
            stress, after = self._asked(self.increments[at], self._first.states[at].clone())
            self._require_close(stress, self._first.stress[:, at])
            self._require_close(after, self._first.states[at + 1], state=True)
        self._require_close(self._start(slice(None)), self._first.states[0], state=True)

    def _require_close(self, found: Tensor, before: Tensor, state: bool = False) -> None:
        difference = self._difference(found, before, *REPEATED, state=state)
        if difference <= 1.0:
            return
        earlier = snapshot(self.cell)
        self._asked(self.increments[0], self._first.states[0].clone())
        by_call = changed(earlier, snapshot(self.cell))
        raise different_answers(self.cell, by_call or changed_by_use(self._contents, self.cell))

    def _require_independent_points(self) -> None:
        """Every point on its own must be what it is in company."""
        for point in range(self._points()):
            alone = self._course(slice(point, point + 1)).stress
            together = self._first.stress[point : point + 1]
            if self._difference(alone, together, *TOGETHER) > 1.0:
                raise ModelError(f"{self.cell.name} {MIXES_ROWS}")

    def _difference(
        self, found: Tensor, before: Tensor, share: float, roundings: float, state: bool = False
    ) -> float:
        """Largest difference of stresses (or states, by column) over what is allowed."""
        one, other = found.double(), before.double()
        if not torch.equal(torch.isnan(one), torch.isnan(other)):
            return float("inf")
        eps = torch.finfo(self.cell.dtype).eps
        if state:
            allowed = (share + roundings * eps) * other.nan_to_num().abs().amax(dim=0)
        else:
            reference = self._first.stress.double().nan_to_num()
            change = reference.diff(dim=1).abs().max()
            allowed = share * change + roundings * eps * reference.abs().max()
        difference = torch.where(one == other, 0.0, (one - other).abs()).nan_to_num(posinf=1e300)
        return float((difference / allowed.clamp(min=1e-300)).max())

    def _looked_at_tangent(self) -> list[str]:
        """Whether Newton's method may rely on the gradients; a note where it may not."""
        if not self.cell.cheap_tangent or self.cell.reads_records:
            return []
        name = self.cell.name
        dstrain, state = self.increments[0], self._first.states[0]
        try:
            _, _, tangent = robust_call(self.cell.tangent, dstrain, state)
            own = type(self.cell).tangent is not MaterialCell.tangent
            missing = not own and self.cell.differentiated(dstrain, state) is None
        except GranbenchError:
            raise
        except Exception as error:
            self.by_differences = True
            return [
                f"the tangent of {name} fails ({type(error).__name__}); Newton's method takes "
                "differences of its stresses in its place"
            ]
        if missing:
            *_, differences = robust_call(
                lambda *given: step_and_tangent(self.cell.step, *given), dstrain, state
            )
            if not differences.nan_to_num().any():
                return []  # nothing depends on the strain
            self.by_differences = True
            return [
                f"{name} gives torch no gradients (`no_grad`, `detach` or NumPy in its step); "
                "Newton's method takes differences of its stresses in their place"
            ]
        mismatch = tangent_mismatch(self.cell, dstrain, state, tangent)
        if mismatch is None:
            return []
        self.by_differences = True
        component, share = mismatch
        label = COMPONENT_ORDERS[self.cell.order][component]
        return [
            f"the tangent of {name} differs from the change of its stress {label} by "
            f"{100.0 * share:.3g} %, as after a `detach`; Newton's method takes differences of its "
            "stresses in its place"
        ]


def _name(cell: Any) -> str:
    return str(getattr(cell, "name", type(cell).__name__))


def _same(one: Tensor, other: Tensor) -> bool:
    return bool(((one == other) | (one.isnan() & other.isnan())).all())
