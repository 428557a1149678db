"""The check of a cell by a few points and increments."""

from dataclasses import dataclass

import torch
from torch import Tensor

from granbench.cells.check.attributes import kind, require_attributes, require_tensor
from granbench.cells.check.probe import default_start, probe_increments
from granbench.cells.check.repeatability import (
    BATCH_ROUNDINGS,
    BATCH_SHARE,
    DifferentResultsError,
    MixedRowsError,
    changed_by_use,
)
from granbench.cells.check.snapshot import changed, snapshot
from granbench.cells.check.tangent import tangent_mismatch
from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.finite_differences import step_and_tangent
from granbench.cells.robust_runs import finite_points, robust_call
from granbench.errors import GranbenchError, ModelError
from granbench.tensors import COMPONENT_ORDERS

SAME_CALL = (1e-6, 16.0)
OTHER_BATCH = (BATCH_SHARE, BATCH_ROUNDINGS)
"""How far results may differ: a share of the largest change of stress, and roundings of the cell's
floating type at the largest stress. Results of the same call differ by nothing but the order of
threads: `SAME_CALL` finds memories and random numbers. Those of batches of other sizes are rounded
differently, upon which error control may take other substeps: `OTHER_BATCH` finds points that
depend on each other by more than that."""


@dataclass(frozen=True)
class _Run:
    """Stresses (point, step, component) along the increments, and states from the start on."""

    stress: Tensor
    states: tuple[Tensor, ...]


class CellCheck:
    """A cell that has passed the check, and what is known of it.

    Parameters
    ----------
    cell, start, increments : see `check_cell`
    training : kinds of its modules that were in training mode

    Attributes
    ----------
    notes : what is corrected, in sentences
    by_differences : whether its tangent is to be taken from differences of its stresses
    stress : (point, step, component), its stresses along the increments, Pa

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
            self._first = self._run(slice(None))
            self._require_same_again()
            self._require_independent_points()
            if not finite_points(self._first.stress.flatten(1)).all():
                notes.append(f"{cell.name} gives no finite stress in some of its first increments")
        notes += self._tangent_notes()
        self.stress = self._first.stress
        self.notes = tuple(notes)

    def repeat(self) -> None:
        """Make the same calls once more.

        Raises
        ------
        ModelError
            If the cell returns anything else after it was used.
        """
        with torch.no_grad():
            self._require_same_again()

    def _points(self) -> int:
        return len(self.start if isinstance(self.start, Tensor) else self.start.stress)

    def _start_states(self, points: slice) -> Tensor:
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

    def _run(self, points: slice) -> _Run:
        """The cell along the increments of some points; its earlier results must not change."""
        states = [self._start_states(points)]
        kept = [states[0].clone()]
        stresses, kept_stresses = [], []
        for increment in self.increments:
            stress, after = self._step(increment[points], states[-1])
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
        return _Run(torch.stack(kept_stresses, dim=1), tuple(kept))

    def _step(self, increment: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """One step whose result has the right form, and whose arguments are left unchanged."""
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
        for name, one, other in (("dstrain", increment, dstrain), ("state", before, state)):
            if not _same(one, other):
                raise ModelError(
                    f"`step` of {self.cell.name} changes its argument `{name}` in place; begin it "
                    f"with `{name} = {name}.clone()`"
                )
        return stress, after

    def _require_same_again(self) -> None:
        """Repeat the whole run, and single steps from stored states in another order."""
        again = self._run(slice(None))
        self._require_close(again.stress, self._first.stress)
        for at in reversed(range(len(self.increments))):
            stress, after = self._step(self.increments[at], self._first.states[at].clone())
            self._require_close(stress, self._first.stress[:, at])
            self._require_close(after, self._first.states[at + 1], state=True)
        self._require_close(self._start_states(slice(None)), self._first.states[0], state=True)

    def _require_close(self, found: Tensor, before: Tensor, state: bool = False) -> None:
        difference = self._difference(found, before, *SAME_CALL, state=state)
        if difference <= 1.0:
            return
        earlier = snapshot(self.cell)
        self._step(self.increments[0], self._first.states[0].clone())
        by_call = changed(earlier, snapshot(self.cell))
        names = by_call or changed_by_use(self._contents, self.cell)
        raise DifferentResultsError(self.cell, names)

    def _require_independent_points(self) -> None:
        """Every point on its own must have the stresses that it has among the others."""
        for point in range(self._points()):
            alone = self._run(slice(point, point + 1)).stress
            together = self._first.stress[point : point + 1]
            if self._difference(alone, together, *OTHER_BATCH) > 1.0:
                raise MixedRowsError(self.cell.name)

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

    def _tangent_notes(self) -> list[str]:
        """A note where Newton's method cannot use the gradients, which sets `by_differences`."""
        if not self.cell.cheap_tangent or self.cell.reads_records:
            return []
        name = self.cell.name
        dstrain, state = self.increments[0], self._first.states[0]
        try:
            _, _, tangent = robust_call(self.cell.tangent, dstrain, state)
            by_torch = not self.cell.has_own_tangent
            missing = by_torch and self.cell.differentiated(dstrain, state) is None
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


def _same(one: Tensor, other: Tensor) -> bool:
    return bool(((one == other) | (one.isnan() & other.isnan())).all())
