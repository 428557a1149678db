"""Errors of several models along a run: mean squared errors, and shares of points."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, PercentFormatter

from granbench.plotting.style import ModelStyle, figure_grid, house_style

PANEL = (6.4, 3.6)
"""Inches."""

BAND_OPACITY = 0.12

FLOOR_LINE: dict[str, Any] = {"color": "0.3", "linestyle": (0, (2, 3))}
FLOOR_LABEL = "replicate scatter"


@dataclass(frozen=True)
class ErrorLine:
    """One model's error along a run.

    Parameters
    ----------
    name : of the model
    style : its colour and line style
    horizon : (n,), steps
    value : (n,), error at each
    low, high : (n,), its interval; empty where a single specimen gives none
    """

    name: str
    style: ModelStyle
    horizon: Sequence[int]
    value: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]


@house_style
def error_figure(lines: Sequence[ErrorLine], floor: float | None = None) -> Figure:
    """Mean squared normalised stress error against the steps since truth was given.

    Parameters
    ----------
    lines : one a model; the error axis is logarithmic, so that a zero has no place on it
    floor : scatter between packings made alike, a dashed line; None for no line
    """
    figure, (axis,) = figure_grid(panel=PANEL)
    handles = _draw_lines(axis, lines)
    if floor:
        handles.append(draw_floor(axis, floor))
    axis.set_yscale("log")
    axis.set(xlabel="horizon [steps since truth was given]", ylabel="stress MSE [–]")
    _explain(figure, handles)
    return figure


@house_style
def share_figure(lines: Sequence[ErrorLine], xlabel: str, ylabel: str) -> Figure:
    """Shares from 0 to 1 against the step of a run, in per cent.

    Parameters
    ----------
    lines : one a model
    xlabel, ylabel : titles of the axes
    """
    figure, (axis,) = figure_grid(panel=PANEL)
    handles = _draw_lines(axis, lines)
    axis.set(ylim=(0.0, 1.0), xlabel=xlabel, ylabel=ylabel)
    axis.yaxis.set_major_formatter(PercentFormatter(1.0))
    for handle in handles:
        handle.set_clip_on(False)  # a line along the edge is seen in its full width
    _explain(figure, handles)
    return figure


def draw_error_line(axis: Axes, line: ErrorLine) -> Line2D:
    """Draw one model's error and the band of its interval.

    Returns
    -------
    The line; in an SVG its group has the id `line_id(name)`
    """
    (handle,) = axis.plot(
        line.horizon, line.value, label=line.name, gid=line_id(line.name), **line.style.line()
    )
    if line.low:
        axis.fill_between(
            line.horizon, line.low, line.high, color=line.style.colour, alpha=BAND_OPACITY, lw=0.0
        )
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    return handle


def draw_floor(axis: Axes, floor: float) -> Line2D:
    """Draw the error that scatter between packings made alike gives, as a dashed line."""
    return axis.axhline(floor, label=FLOOR_LABEL, gid=line_id(FLOOR_LABEL), **FLOOR_LINE)


def line_id(name: str) -> str:
    """The id of a line's group in an SVG."""
    return f"line {name}"


def _draw_lines(axis: Axes, lines: Sequence[ErrorLine]) -> list[Line2D]:
    handles = [draw_error_line(axis, line) for line in lines]
    if lines:
        ends = [step for line in lines for step in (line.horizon[0], line.horizon[-1])]
        axis.set_xlim(min(ends), max(ends))
    return handles


def _explain(figure: Figure, handles: Sequence[Line2D]) -> None:
    """A legend beside the axes, in the order of the lines' ends from above."""
    ordered = sorted(handles, key=lambda handle: -float(np.asarray(handle.get_ydata())[-1]))
    figure.legend(
        handles=ordered,
        loc="outside right upper",
        labelcolor="linecolor",
        handlelength=2.6,
        labelspacing=0.4,
    )
