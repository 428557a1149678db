"""Runs that keep what came before a breakdown.

A cell may return NaN or raise a floating failure for some points at some step. Neither may take
the other points down, and neither is excused: what the point predicted before it stays, what
comes after is NaN.
"""

from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from granbench.cells.contract import FLOATING_FAILURES, Conditions, History, MaterialCell

Series = dict[str, Tensor]
"""`stress` (path, step, component) and internals (path, step) under their names."""


def conditions_at(conditions: Conditions, points: slice) -> Conditions:
    """The conditions of some points only."""
    past = conditions.accumulated_strain
    return Conditions(
        conditions.stress[points],
        {name: values[points] for name, values in conditions.scalars.items()},
        None if past is None else past[points],
    )


def surviving_rollout(cell: MaterialCell, strain: Tensor, conditions: Conditions) -> Series:
    """`MaterialCell.rollout`, NaN from the step at which a path breaks down.

    Parameters
    ----------
    strain : (path, step, component), cumulative, step 0 is the reference
    conditions : what is known at step 0

    Returns
    -------
    stress and the cell's internals, float64
    """

    def run(points: slice, steps: int) -> Series:
        result = cell.rollout(strain[points, :steps], conditions_at(conditions, points))
        return {"stress": result.stress, **result.internals}

    paths, steps, components = strain.shape
    widths = {"stress": (components,), **{name: () for name in cell.internals}}
    series = surviving(run, slice(0, paths), steps, widths)
    alive = torch.cumprod(_finite(series).to(torch.int64), dim=1).to(torch.bool)
    return _masked(series, alive)


def surviving_states(cell: MaterialCell, history: History) -> Tensor:
    """`MaterialCell.condition_each`, NaN from the step at which a path breaks down.

    Returns
    -------
    (path, step, n_state)
    """

    def run(points: slice, steps: int) -> Series:
        record = History(
            history.strain[points],
            history.stress[points],
            {name: values[points] for name, values in history.internals.items()},
            conditions_at(history.conditions, points),
        )
        return {"state": cell.condition_each(record.until(steps - 1))}

    paths, steps = history.strain.shape[:2]
    return surviving(run, slice(0, paths), steps, {"state": (cell.layout.size,)})["state"]


def surviving_step(cell: MaterialCell, dstrain: Tensor, state: Tensor) -> Series:
    """`MaterialCell.step` of independent points; a point that breaks down is NaN.

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
    series = surviving(run, slice(0, points), None, widths)
    return _masked(series, _finite(series))


def surviving_course(cell: MaterialCell, strain: Tensor, conditions: Conditions) -> Series:
    """Stress and state along whole paths, NaN from the step at which a path breaks down.

    Parameters
    ----------
    strain, conditions : as in `surviving_rollout`

    Returns
    -------
    `stress` (path, step, component) and `state` (path, step, n_state), float64
    """

    def run(points: slice, steps: int) -> Series:
        given = conditions_at(conditions, points)
        states = [cell.initial_state(given)]
        stresses = [given.stress.to(cell.dtype)]
        for dstrain in strain[points, :steps].diff(dim=1).to(cell.dtype).unbind(dim=1):
            stress, state = cell.step(dstrain, states[-1])
            stresses.append(stress)
            states.append(state)
        return {"stress": torch.stack(stresses, dim=1), "state": torch.stack(states, dim=1)}

    paths, steps, components = strain.shape
    widths = {"stress": (components,), "state": (cell.layout.size,)}
    return surviving(run, slice(0, paths), steps, widths)


def surviving(
    run: Callable[[slice, int], Series],
    points: slice,
    steps: int | None,
    widths: Mapping[str, tuple[int, ...]],
) -> Series:
    """`run` over points and steps; what raises a floating failure is isolated and NaN.

    Points are halved until the failing one is alone, its longest run that does not raise is
    found by bisection.

    Parameters
    ----------
    run : (points, number of steps) -> series, each (point, step, ...)
    points : all of them
    steps : how many there are; None where the result has no step dimension
    widths : of each series, what follows the point and step dimensions

    Returns
    -------
    The series, float64
    """
    try:
        return {name: values.double() for name, values in run(points, steps or 1).items()}
    except FLOATING_FAILURES:
        count = points.stop - points.start
    if count > 1:
        middle = points.start + count // 2
        halves = [
            surviving(run, half, steps, widths)
            for half in (slice(points.start, middle), slice(middle, points.stop))
        ]
        return {name: torch.cat([half[name] for half in halves]) for name in widths}
    shape = (1,) if steps is None else (1, steps)
    series = {
        name: torch.full((*shape, *width), torch.nan, dtype=torch.float64)
        for name, width in widths.items()
    }
    survives, fails = 0, steps or 0
    while fails - survives > 1:
        middle = (survives + fails) // 2
        try:
            prefix = run(points, middle)
        except FLOATING_FAILURES:
            fails = middle
            continue
        survives = middle
        for name, values in prefix.items():
            series[name][:, :middle] = values
    return series


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
