"""Some of the questions that a cell was asked while it was used, asked again at the end.

The check before the use takes small increments from ordinary stresses. A memory that is written
only while yielding, random numbers that are drawn only at large stress, and substeps that follow
the largest increment of a batch do not show there. They show at the increments and states of the
use itself.
"""

import copy
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from granbench.cells.check.snapshot import changed, snapshot
from granbench.cells.contract import MaterialCell
from granbench.cells.robust_runs import robust_call
from granbench.errors import ModelError

CALLS = 12
"""Calls of `step` that are kept at most, evenly spread over the use, and at least half as many
once there were so many."""

GOLDEN = 0.618034
"""Multiples of it, without their whole parts, are evenly spread, and so is every second of them:
they choose which points of a call are asked alone."""

SHARE, ROUNDINGS = 1e-3, 100.0
"""How far an answer may differ in a batch of another size: a share of the change of stress, and
roundings of the cell's floating type at the stress. Batches of other sizes are summed in another
order; where a point is then rounded differently, error control may take other substeps, whose
results differ by about its tolerance."""

FLAT = 0.1
"""Where the stress of a point hardly changes, as at failure, differences are compared with this
share of the largest change in the batch, or of the point's stress if that is less."""

MIXES_ROWS = (
    "answers a point differently alone and together with others, but each row of a batch is a "
    "point of its own; take out what mixes the rows, such as batch normalisation without running "
    "statistics, a number of substeps for the whole batch, or a mean, norm or maximum over "
    "dimension 0"
)


@dataclass(frozen=True)
class Answers:
    """Steps of some points: what was given and what came back.

    Parameters
    ----------
    dstrain, stress : (point, component)
    state, after : (point, n_state)
    scale : (point,), Pa, the change of stress that differences are compared with
    alone : (point,), whether the point is to be asked on its own too
    """

    dstrain: Tensor
    state: Tensor
    stress: Tensor
    after: Tensor
    scale: Tensor
    alone: Tensor

    def of(self, rows: Tensor) -> "Answers":
        """The answers of some rows."""
        return Answers(*(part[rows] for part in vars(self).values()))


class RecordedSteps:
    """The `step` of a cell that keeps a few of its answers.

    It takes the place of `cell.step` while the cell is used. A copy of the cell then has a
    recording of the copy's own steps.
    """

    def __init__(self, cell: MaterialCell) -> None:
        self.step = cell.step
        self.stress = cell.layout["stress"]
        self.kept: list[Answers] = []
        self.count, self.stride, self.taken = 0, 1, 0

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
            if _is_like(stress, given[0]) and _is_like(after, given[1]):
                self._keep(*given, stress.detach(), after.detach())
        return result

    def _keep(self, dstrain: Tensor, state: Tensor, stress: Tensor, after: Tensor) -> None:
        known = [part.isfinite().all(dim=1) for part in (dstrain, state, stress, after)]
        rows = torch.stack(known).all(dim=0).nonzero().flatten()
        if not len(rows):
            return
        size = stress[rows].abs().amax(dim=1).double()
        change = (stress - state[:, self.stress])[rows].abs().amax(dim=1).double()
        least = int(dstrain[rows].abs().amax(dim=1).argmin())
        even = [round(place * (len(rows) - 1) / 3) for place in range(4)]
        chosen = sorted({least, int(change.argmax()), int(size.argmax()), *even})
        of_all = FLAT * size.clamp(max=float(change.max()))
        scale = torch.maximum(change, of_all)[chosen]
        another = chosen[int(GOLDEN * self.taken % 1.0 * len(chosen))]
        self.taken += 1
        alone = [len(dstrain) > 1 and place in (least, another) for place in chosen]
        points = rows[chosen]
        self.kept.append(
            Answers(
                dstrain[points],
                state[points],
                stress[points].clone(),
                after[points].clone(),
                scale,
                torch.tensor(alone),
            )
        )
        if len(self.kept) > CALLS:
            self.kept = self.kept[::2]
            self.stride *= 2

    def answers(self) -> Answers | None:
        """All that is kept, the last first; None where the cell was not used."""
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


def require_same_answers(
    cell: MaterialCell,
    asked: Answers,
    fresh: MaterialCell | None,
    before: Mapping[str, Any],
) -> None:
    """Make sure that a cell still answers as it did while it was used.

    It is asked all at once, in another order and company than then; some points are asked alone;
    and so is a copy that was never used, to which a memory of the use is unknown.

    Parameters
    ----------
    cell : the cell after its use
    asked : what it answered
    fresh : its copy from before the use
    before : its `snapshot` from before the use

    Raises
    ------
    ModelError
        If an answer differs; it names what changed in the cell.
    """
    untouched = None if fresh is None else fresh_copy(fresh)
    single = asked.of(asked.alone)
    now = _ask(cell, asked)
    same = _agree(now, asked) and _agree(_ask_each(cell, single), single)
    if same and (fresh is None or _agree(_ask(fresh, asked), asked)):
        return
    by_use = changed_by_use(before, cell)
    earlier = snapshot(cell)
    again = _ask(cell, asked)
    by_call = changed(earlier, snapshot(cell))
    if any(map(_drawn, by_call)) or not _agree(again, now):
        raise different_answers(cell, by_call or by_use)
    if untouched is None:
        mixes = not by_use
    else:
        mixes = not _agree(_ask_copies(untouched, single), _ask(untouched, asked).of(asked.alone))
    if mixes:
        raise ModelError(f"{cell.name} {MIXES_ROWS}")
    raise different_answers(cell, by_use)


def different_answers(cell: MaterialCell, names: list[str]) -> ModelError:
    """The error for a cell whose answers to one question differ.

    Parameters
    ----------
    cell : the cell
    names : what changed in it, see `granbench.cells.check.snapshot.changed`
    """
    told = f"{cell.name} gives different answers to the same strain increment from the same state"
    drawn = [name for name in names if _drawn(name)]
    if drawn:
        return ModelError(
            f"{told}, because it draws {drawn[0]}; take dropout, noise and `rand` out of what is "
            "scored"
        )
    in_state = (
        "keep that in the state instead, as a slice of its StateLayout that every step returns"
    )
    if names:
        where = ", ".join(f"`{name}`" for name in names[:3])
        return ModelError(f"{told}: it remembers earlier calls in {where}; {in_state}")
    return ModelError(
        f"{told}, although nothing that it holds has changed: either it remembers earlier calls "
        f"outside of itself, as in a file or another program; {in_state}. Or it depends on chance "
        "or time, as with `os.urandom` or a clock; take that out of what is scored"
    )


def changed_by_use(before: Mapping[str, Any], cell: MaterialCell) -> list[str]:
    """Names of what a cell holds that differs from an earlier snapshot; no random numbers."""
    return [name for name in changed(before, snapshot(cell)) if not _drawn(name)]


def _drawn(name: str) -> bool:
    return name.startswith("random numbers")


def _is_like(answer: Any, given: Tensor) -> bool:
    """Whether an answer has the form that it must have; others are refused where they are used."""
    return (
        isinstance(answer, Tensor)
        and answer.shape == given.shape
        and answer.is_floating_point()
        and answer.device == given.device
        and answer.layout == given.layout
    )


def _is_transformed(tensor: Tensor) -> bool:
    """Whether a tensor stands for others within `torch.func`, and has no values of its own."""
    return bool(torch._C._functorch.is_functorch_wrapped_tensor(tensor))


def _ask(cell: MaterialCell, asked: Answers) -> Answers:
    """The same questions, with the answers of now."""
    if not len(asked.dstrain):
        return asked
    stress, after = robust_call(cell.step, asked.dstrain.clone(), asked.state.clone())[:2]
    return Answers(
        asked.dstrain,
        asked.state,
        stress.detach().clone(),
        after.detach().clone(),
        asked.scale,
        asked.alone,
    )


def _ask_each(cell: MaterialCell, asked: Answers) -> Answers:
    """`_ask`, one point at a time."""
    each = [_ask(cell, asked.of(torch.tensor([row]))) for row in range(len(asked.dstrain))]
    return _joined(each) if each else asked


def _ask_copies(cell: MaterialCell, asked: Answers) -> Answers:
    """`_ask_each`, every point of a copy of its own, so that none can remember another."""
    points = [asked.of(torch.tensor([row])) for row in range(len(asked.dstrain))]
    each = [_ask(fresh_copy(cell) or cell, point) for point in points]
    return _joined(each) if each else asked


def _joined(each: Iterable[Answers]) -> Answers:
    parts = zip(*(vars(one).values() for one in each), strict=True)
    return Answers(*(torch.cat(part) for part in parts))


def _agree(one: Answers, other: Answers) -> bool:
    """Whether answers differ by no more than `SHARE` and `ROUNDINGS` allow."""
    if not len(other.stress):
        return True
    rounding = ROUNDINGS * torch.finfo(other.stress.dtype).eps
    size = other.stress.abs().amax(dim=1).double()
    allowed = SHARE * other.scale + rounding * torch.maximum(size, size.median())
    stress = (one.stress.double() - other.stress.double()).abs() <= allowed[:, None]
    after = other.after.double().abs()
    columns = SHARE * after.amax(dim=0) + rounding * after.amax(dim=1, keepdim=True)
    state = (one.after.double() - other.after.double()).abs() <= columns
    return bool(stress.all() and state.all())
