"""Some of the steps that a cell took while it was used, repeated at the end.

The check before the use takes small increments from ordinary stresses. It cannot find a memory
that is written only while yielding, random numbers that are drawn only at large stress, or
substeps that follow the largest increment of a batch. The increments and states of the use itself
can.
"""

import copy
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from granbench.cells.check.snapshot import changed, snapshot
from granbench.cells.contract import MaterialCell
from granbench.cells.robust_runs import robust_call
from granbench.errors import ModelError

MOST_CALLS = 12
"""Calls of `step` that are kept at most, evenly spread over the use, and at least half as many
once there were so many."""

GOLDEN_RATIO = 0.618034
"""Multiples of it, without their whole parts, are evenly spread, and so is every second of them:
they choose which points of a call are repeated alone."""

BATCH_SHARE, BATCH_ROUNDINGS = 1e-3, 100.0
"""How far a result may differ in a batch of another size: a share of the change of stress, and
roundings of the cell's floating type at the stress. Batches of other sizes are summed in another
order; where a point is then rounded differently, error control may take other substeps, whose
results differ by about its tolerance."""

FLAT = 0.1
"""Where the stress of a point hardly changes, as at failure, differences are compared with this
share of the largest change in the batch, or of the point's stress if that is less."""


class MixedRowsError(ModelError):
    """The stress of a point depends on the other points of its batch."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"{name} gives a point another stress alone than together with others, but each row of "
            "a batch is a point of its own; remove what mixes the rows, such as batch "
            "normalisation without running statistics, a number of substeps for the whole batch, "
            "or a mean, norm or maximum over dimension 0"
        )


class DifferentResultsError(ModelError):
    """A cell gives different results for the same strain increment and state.

    Parameters
    ----------
    cell : the cell
    names : what changed in it, see `granbench.cells.check.snapshot.changed`

    Attributes
    ----------
    remembers : the names that are not random numbers
    draws : the names that are, of which at least one causes the difference
    """

    def __init__(self, cell: MaterialCell, names: list[str]) -> None:
        self.draws = [name for name in names if _is_random(name)]
        self.remembers = [name for name in names if not _is_random(name)]
        lead = f"{cell.name} gives different results for the same strain increment and state"
        in_state = (
            "keep that in the state instead, as a slice of its StateLayout that every step returns"
        )
        if self.draws:
            reason = (
                f", because it draws {self.draws[0]}; remove dropout, noise and `rand` from what "
                "is scored"
            )
        elif names:
            where = ", ".join(f"`{name}`" for name in names[:3])
            reason = f": it remembers earlier calls in {where}; {in_state}"
        else:
            reason = (
                ", although nothing that it holds has changed: either it remembers earlier calls "
                f"outside of itself, as in a file or another program; {in_state}. Or it depends on "
                "chance or time, as with `os.urandom` or a clock; remove that from what is scored"
            )
        super().__init__(f"{lead}{reason}")


@dataclass(frozen=True)
class Steps:
    """Steps of some points: the arguments of the cell and its results.

    Parameters
    ----------
    dstrain, stress : (point, component)
    state, after : (point, n_state)
    scale : (point,), Pa, the change of stress that differences are compared with
    alone : (point,), whether the step of the point is repeated on its own too
    """

    dstrain: Tensor
    state: Tensor
    stress: Tensor
    after: Tensor
    scale: Tensor
    alone: Tensor

    def of(self, rows: Tensor) -> "Steps":
        """The steps of some points."""
        return Steps(*(part[rows] for part in vars(self).values()))


class RecordedSteps:
    """The `step` of a cell, which keeps a few of its arguments and results.

    It takes the place of `cell.step` while the cell is used. A copy of the cell then has a
    recording of the copy's own steps.
    """

    def __init__(self, cell: MaterialCell) -> None:
        self.step = cell.step
        self.stress = cell.layout["stress"]
        self.kept: list[Steps] = []
        self.count, self.stride, self.kept_in_all = 0, 1, 0

    def __call__(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        left_out = self.count % self.stride != 0
        self.count += 1
        if left_out or _is_transformed(dstrain) or _is_transformed(state):
            return self.step(dstrain, state)
        given = dstrain.detach().clone(), state.detach().clone()
        result = self.step(dstrain, state)
        if isinstance(result, tuple) and len(result) > 1:
            stress, after = result[:2]
            if _has_form_of(stress, given[0]) and _has_form_of(after, given[1]):
                self._keep(*given, stress.detach(), after.detach())
        return result

    def _keep(self, dstrain: Tensor, state: Tensor, stress: Tensor, after: Tensor) -> None:
        finite = [part.isfinite().all(dim=1) for part in (dstrain, state, stress, after)]
        rows = torch.stack(finite).all(dim=0).nonzero().flatten()
        if not len(rows):
            return
        size = stress[rows].abs().amax(dim=1).double()
        change = (stress - state[:, self.stress])[rows].abs().amax(dim=1).double()
        smallest = int(dstrain[rows].abs().amax(dim=1).argmin())
        even = [round(place * (len(rows) - 1) / 3) for place in range(4)]
        chosen = sorted({smallest, int(change.argmax()), int(size.argmax()), *even})
        of_all = FLAT * size.clamp(max=float(change.max()))
        scale = torch.maximum(change, of_all)[chosen]
        another = chosen[int(GOLDEN_RATIO * self.kept_in_all % 1.0 * len(chosen))]
        self.kept_in_all += 1
        alone = [len(dstrain) > 1 and place in (smallest, another) for place in chosen]
        points = rows[chosen]
        self.kept.append(
            Steps(
                dstrain[points],
                state[points],
                stress[points].clone(),
                after[points].clone(),
                scale,
                torch.tensor(alone),
            )
        )
        if len(self.kept) > MOST_CALLS:
            self.kept = self.kept[::2]
            self.stride *= 2

    def all(self) -> Steps | None:
        """Every step that is kept, the last first; None where the cell was not used."""
        if not self.kept:
            return None
        together = _joined(self.kept)
        return together.of(torch.arange(len(together.dstrain)).flip(0))


def fresh_copy(cell: MaterialCell) -> MaterialCell | None:
    """A copy that shares nothing with the cell, or None where it cannot be copied."""
    try:
        return copy.deepcopy(cell)
    except Exception:  # such as an open file or a handle of another program
        return None


def require_same_results(
    cell: MaterialCell,
    steps: Steps,
    fresh: MaterialCell | None,
    before: Mapping[str, Any],
) -> None:
    """Make sure that a cell still returns what it returned while it was used.

    All steps are repeated in one batch, in another order than then; some points are repeated
    alone; and all are repeated with a copy that was never used and so remembers nothing of it.

    Parameters
    ----------
    cell : the cell after its use
    steps : what it was given and returned
    fresh : its copy from before the use
    before : its `snapshot` from before the use

    Raises
    ------
    DifferentResultsError
        If a result differs; it names what changed in the cell.
    MixedRowsError
        If a result differs only because the points of the batch are others.
    """
    untouched = None if fresh is None else fresh_copy(fresh)
    single = steps.of(steps.alone)
    now = _repeated(cell, steps)
    same = _agree(now, steps) and _agree(_repeated_one_by_one(cell, single), single)
    if same and (fresh is None or _agree(_repeated(fresh, steps), steps)):
        return
    by_use = changed_by_use(before, cell)
    earlier = snapshot(cell)
    again = _repeated(cell, steps)
    by_call = changed(earlier, snapshot(cell))
    if any(map(_is_random, by_call)) or not _agree(again, now):
        raise DifferentResultsError(cell, by_call or by_use)
    if untouched is None:
        mixes = not by_use
    else:
        alone, together = _repeated_by_copies(untouched, single), _repeated(untouched, steps)
        mixes = not _agree(alone, together.of(steps.alone))
    if mixes:
        raise MixedRowsError(cell.name)
    raise DifferentResultsError(cell, by_use)


def changed_by_use(before: Mapping[str, Any], cell: MaterialCell) -> list[str]:
    """Names of what a cell holds that differs from an earlier snapshot; no random numbers."""
    return [name for name in changed(before, snapshot(cell)) if not _is_random(name)]


def _is_random(name: str) -> bool:
    return name.startswith("random numbers")


def _has_form_of(result: Any, argument: Tensor) -> bool:
    """Whether a result has the form that it must have; others are refused where they are used."""
    return (
        isinstance(result, Tensor)
        and result.shape == argument.shape
        and result.is_floating_point()
        and result.device == argument.device
        and result.layout == argument.layout
    )


def _is_transformed(tensor: Tensor) -> bool:
    """Whether a tensor stands for others within `torch.func`, and has no values of its own."""
    return bool(torch._C._functorch.is_functorch_wrapped_tensor(tensor))


def _repeated(cell: MaterialCell, steps: Steps) -> Steps:
    """The same increments from the same states, with the results that they have now."""
    if not len(steps.dstrain):
        return steps
    stress, after = robust_call(cell.step, steps.dstrain.clone(), steps.state.clone())[:2]
    results = {"stress": stress.detach().clone(), "after": after.detach().clone()}
    return replace(steps, **results)


def _repeated_one_by_one(cell: MaterialCell, steps: Steps) -> Steps:
    """`_repeated`, one point at a time."""
    each = [_repeated(cell, point) for point in _points_of(steps)]
    return _joined(each) if each else steps


def _repeated_by_copies(cell: MaterialCell, steps: Steps) -> Steps:
    """`_repeated`, each point with a copy of its own, so that none can remember another."""
    each = [_repeated(fresh_copy(cell) or cell, point) for point in _points_of(steps)]
    return _joined(each) if each else steps


def _points_of(steps: Steps) -> list[Steps]:
    return [steps.of(torch.tensor([row])) for row in range(len(steps.dstrain))]


def _joined(each: Iterable[Steps]) -> Steps:
    parts = zip(*(vars(one).values() for one in each), strict=True)
    return Steps(*(torch.cat(part) for part in parts))


def _agree(one: Steps, other: Steps) -> bool:
    """Whether results differ by no more than `BATCH_SHARE` and `BATCH_ROUNDINGS` allow."""
    if not len(other.stress):
        return True
    rounding = BATCH_ROUNDINGS * torch.finfo(other.stress.dtype).eps
    size = other.stress.abs().amax(dim=1).double()
    allowed = BATCH_SHARE * other.scale + rounding * torch.maximum(size, size.median())
    stress = (one.stress.double() - other.stress.double()).abs() <= allowed[:, None]
    after = other.after.double().abs()
    columns = BATCH_SHARE * after.amax(dim=0) + rounding * after.amax(dim=1, keepdim=True)
    state = (one.after.double() - other.after.double()).abs() <= columns
    return bool(stress.all() and state.all())
