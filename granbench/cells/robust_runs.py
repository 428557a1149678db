"""Calls and runs of a cell in which a point that fails does not stop the others.

A cell may return NaN, or raise one of `FLOATING_FAILURES`, for some points at some step. The other
points are computed as if the failed one were not there. What a failed point predicted before the
failure is kept; from the failure on it is NaN.
"""

from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from granbench.cells.contract import FLOATING_FAILURES, Conditions, History, MaterialCell

CellMethod = Callable[[Tensor, Tensor], tuple[Tensor, ...]]
"""`step` or `tangent` of a cell: (dstrain, state) -> (stress, state) or with the tangent too."""

Series = dict[str, Tensor]
"""`stress` (path, step, component) and internals (path, step) under their names."""


def robust_call(method: CellMethod, dstrain: Tensor, state: Tensor) -> tuple[Tensor, ...]:
    """The result of a cell's `step` or `tangent`, NaN at a point for which it raises.

    Parameters
    ----------
    method : `step` or `tangent` of a cell
    dstrain, state : (point, ...), as the method takes them

    Returns
    -------
    What the method returns, in its own floating type
    """
    components = dstrain.shape[1]
    everything = slice(0, len(dstrain))

    def run(points: slice) -> tuple[Tensor, ...]:
        # The tensors themselves, not slices: `DifferenceTangent` recognises its last state.
        if points == everything:
            return method(dstrain, state)
        return method(dstrain[points], state[points])

    def failed(points: slice) -> tuple[Tensor, ...]:
        count = points.stop - points.start
        shapes = ((count, components), (count, *state.shape[1:]), (count, components, components))
        return tuple(dstrain.new_full(shape, torch.nan) for shape in shapes)

    return _by_halves(run, everything, failed)


def robust_step(cell: MaterialCell, dstrain: Tensor, state: Tensor) -> Series:
    """`MaterialCell.step` of independent points; a point that fails is NaN.

    Parameters
    ----------
    dstrain : (point, component)
    state : (point, n_state)

    Returns
    -------
    stress (point, component) and internals (point,), float64
    """

    def run(points: slice, _: int) -> Series:
        stress, after = cell.step(dstrain[points], state[points])
        parts = {name: after[:, cell.layout[name]].squeeze(-1) for name in cell.internals}
        return {"stress": stress, **parts}

    points, components = dstrain.shape
    widths = {"stress": (components,), **{name: () for name in cell.internals}}
    series = robust_series(run, points, None, widths)
    return _masked(series, _finite(series))


def robust_rollout(cell: MaterialCell, strain: Tensor, conditions: Conditions) -> Series:
    """`MaterialCell.rollout`, NaN from the step at which a path fails.

    Parameters
    ----------
    strain : (path, step, component), cumulative, step 0 is the reference
    conditions : what is known at step 0

    Returns
    -------
    stress and the cell's internals, float64
    """

    def run(points: slice, steps: int) -> Series:
        result = cell.rollout(strain[points, :steps], _conditions_of(conditions, points))
        return {"stress": result.stress, **result.internals}

    paths, steps, components = strain.shape
    widths = {"stress": (components,), **{name: () for name in cell.internals}}
    series = robust_series(run, paths, steps, widths)
    alive = torch.cumprod(_finite(series).to(torch.int64), dim=1).to(torch.bool)
    return _masked(series, alive)


def robust_states(cell: MaterialCell, strain: Tensor, conditions: Conditions) -> Series:
    """Stress and state along whole paths, NaN from the step at which a path fails.

    Parameters
    ----------
    strain, conditions : as in `robust_rollout`

    Returns
    -------
    `stress` (path, step, component) and `state` (path, step, n_state), float64
    """

    def run(points: slice, steps: int) -> Series:
        start = _conditions_of(conditions, points)
        states = [cell.initial_state(start)]
        stresses = [start.stress.to(cell.dtype)]
        for dstrain in strain[points, :steps].diff(dim=1).to(cell.dtype).unbind(dim=1):
            stress, state = cell.step(dstrain, states[-1])
            stresses.append(stress)
            states.append(state)
        return {"stress": torch.stack(stresses, dim=1), "state": torch.stack(states, dim=1)}

    paths, steps, components = strain.shape
    widths = {"stress": (components,), "state": (cell.layout.size,)}
    return robust_series(run, paths, steps, widths)


def robust_condition_each(cell: MaterialCell, history: History) -> Tensor:
    """`MaterialCell.condition_each`, NaN from the step at which a path fails.

    Returns
    -------
    (path, step, n_state), float64
    """

    def run(points: slice, steps: int) -> Series:
        record = History(
            history.strain[points],
            history.stress[points],
            {name: values[points] for name, values in history.internals.items()},
            _conditions_of(history.conditions, points),
        )
        return {"state": cell.condition_each(record.until(steps - 1))}

    paths, steps = history.strain.shape[:2]
    return robust_series(run, paths, steps, {"state": (cell.layout.size,)})["state"]


def robust_series(
    run: Callable[[slice, int], Series],
    points: int,
    steps: int | None,
    widths: Mapping[str, tuple[int, ...]],
) -> Series:
    """The series of a run over points and steps, NaN where it raises a floating failure.

    The batch is halved until the failing point is alone; the longest run of that point which does
    not raise is then found by bisection.

    Parameters
    ----------
    run : (points, number of steps) -> series, each (point, step, ...)
    points : how many there are
    steps : how many there are; None where the result has no step dimension
    widths : of each series, what follows the point and step dimensions

    Returns
    -------
    The series, float64
    """

    def whole(part: slice) -> tuple[Tensor, ...]:
        series = run(part, steps or 1)
        return tuple(series[name].double() for name in widths)

    def failed(part: slice) -> tuple[Tensor, ...]:
        series = _until_failure(run, part, steps, widths)
        return tuple(series[name] for name in widths)

    return dict(zip(widths, _by_halves(whole, slice(0, points), failed), strict=True))


def finite_points(values: Tensor) -> Tensor:
    """Whether all entries of a point are finite, (point,), of values (point, entry)."""
    return torch.isfinite(values).all(dim=1)


def _by_halves(
    run: Callable[[slice], tuple[Tensor, ...]],
    points: slice,
    failed: Callable[[slice], tuple[Tensor, ...]],
) -> tuple[Tensor, ...]:
    """`run` of all points; where it raises, of each half, and `failed` of a single point."""
    try:
        return run(points)
    except FLOATING_FAILURES:
        count = points.stop - points.start
    if count <= 1:
        return failed(points)
    middle = points.start + count // 2
    halves = [
        _by_halves(run, half, failed)
        for half in (slice(points.start, middle), slice(middle, points.stop))
    ]
    return tuple(torch.cat(parts) for parts in zip(*halves, strict=False))


def _until_failure(
    run: Callable[[slice, int], Series],
    points: slice,
    steps: int | None,
    widths: Mapping[str, tuple[int, ...]],
) -> Series:
    """The series of one point for as many steps as it can be run; NaN after them."""
    shape = (1,) if steps is None else (1, steps)
    series = {
        name: torch.full((*shape, *width), torch.nan, dtype=torch.float64)
        for name, width in widths.items()
    }
    possible, impossible = 0, steps or 0
    while impossible - possible > 1:
        middle = (possible + impossible) // 2
        try:
            first_steps = run(points, middle)
        except FLOATING_FAILURES:
            impossible = middle
            continue
        possible = middle
        for name, values in first_steps.items():
            series[name][:, :middle] = values
    return series


def _conditions_of(conditions: Conditions, points: slice) -> Conditions:
    """The conditions of some points only."""
    past = conditions.accumulated_strain
    return Conditions(
        conditions.stress[points],
        {name: values[points] for name, values in conditions.scalars.items()},
        None if past is None else past[points],
    )


def _finite(series: Series) -> Tensor:
    finite = torch.isfinite(series["stress"]).all(dim=-1)
    for name, values in series.items():
        if name != "stress":
            finite = finite & torch.isfinite(values)
    return finite


def _masked(series: Series, alive: Tensor) -> Series:
    return {
        name: values.masked_fill(~(alive.unsqueeze(-1) if name == "stress" else alive), torch.nan)
        for name, values in series.items()
    }
