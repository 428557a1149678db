"""Errors along a run as inline SVG, one line a model, nothing to load."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

WIDTH, HEIGHT = 640, 380
LEFT, RIGHT, TOP, BOTTOM = 62, 132, 14, 46
LABEL_SPACING = 15.0
SMALLEST = 1e-30
"""What is smaller counts as zero: no rounding leaves so little."""


@dataclass(frozen=True)
class Line:
    """One model's errors.

    Parameters
    ----------
    name : of the model
    colour : hexadecimal
    dash : SVG dash array, "" for a solid line
    horizon : steps since truth was given
    value, low, high : error and its interval at each; no interval of one specimen alone
    """

    name: str
    colour: str
    dash: str
    horizon: Sequence[int]
    value: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]


@dataclass(frozen=True)
class Axes(ABC):
    """Where a step and a value lie on the picture; the step's axis is linear.

    Parameters
    ----------
    last : step at the right edge
    across, up : titles of the axes
    """

    last: int
    across: str
    up: str

    def x(self, step: float) -> float:
        """Pixels from the left."""
        return LEFT + (WIDTH - LEFT - RIGHT) * (step - 1) / max(1, self.last - 1)

    def y(self, value: float) -> float:
        """Pixels from the top; values off the scale lie on its edge."""
        return TOP + (HEIGHT - TOP - BOTTOM) * (1.0 - min(1.0, max(0.0, self.height(value))))

    @abstractmethod
    def height(self, value: float) -> float:
        """Share of the picture's height."""

    @abstractmethod
    def ticks(self) -> list[tuple[float, str]]:
        """Values with a grid line, and what stands at them."""


@dataclass(frozen=True)
class DecadeAxes(Axes):
    """Logarithmic from 10^bottom to 10^top."""

    bottom: int
    top: int

    def height(self, value: float) -> float:
        """See `Axes.height`."""
        return (math.log10(max(value, 1e-300)) - self.bottom) / (self.top - self.bottom)

    def ticks(self) -> list[tuple[float, str]]:
        """See `Axes.ticks`."""
        return [
            (
                10.0**decade,
                f'10<tspan dy="-5" font-size="9">{str(decade).replace("-", "−")}</tspan>',
            )
            for decade in range(self.bottom, self.top + 1)
        ]


@dataclass(frozen=True)
class ShareAxes(Axes):
    """From nothing to all, in per cent."""

    def height(self, value: float) -> float:
        """See `Axes.height`."""
        return value

    def ticks(self) -> list[tuple[float, str]]:
        """See `Axes.ticks`."""
        return [(percent / 100.0, f"{percent} %") for percent in range(0, 101, 20)]


def horizon_chart(lines: Sequence[Line], title: str, floor: float | None = None) -> Markup | None:
    """A chart of mean squared normalised stress error against horizon.

    Parameters
    ----------
    lines : the models; one that is zero everywhere has no place on a logarithmic axis
    title : read out by screen readers
    floor : scatter between packings made alike, a dashed line; None for no line

    Returns
    -------
    An SVG element, or None where there is nothing to draw.
    """
    drawn = not_zero(lines)
    if not drawn:
        return None
    positive = [value for line in drawn for value in line.value if value > SMALLEST]
    if floor:
        positive.append(floor)
    bottom = math.floor(math.log10(min(positive)))
    top = max(bottom + 1, math.ceil(math.log10(max(positive)) - 1e-9))
    last = max(line.horizon[-1] for line in drawn)
    axes = DecadeAxes(last, "horizon [steps since truth was given]", "stress MSE [–]", bottom, top)
    parts, labels = _drawn(axes, drawn)
    if floor:
        y = axes.y(floor)
        parts.append(
            f'<line class="floor" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}">'
            f"<title>replicate scatter: {floor:.3g}</title></line>"
        )
        labels.append((y, "replicate scatter", ""))
    return _svg(title, parts, labels)


def share_chart(lines: Sequence[Line], title: str, across: str, up: str) -> Markup | None:
    """A chart of shares, from 0 to 1, against the step of a run.

    Parameters
    ----------
    lines : the models; those that are zero everywhere are left out, see `not_zero`
    title : read out by screen readers
    across, up : titles of the axes

    Returns
    -------
    An SVG element, or None where there is nothing to draw.
    """
    drawn = not_zero(lines)
    if not drawn:
        return None
    parts, labels = _drawn(ShareAxes(max(line.horizon[-1] for line in drawn), across, up), drawn)
    return _svg(title, parts, labels)


def not_zero(lines: Sequence[Line]) -> list[Line]:
    """The lines that have something to show."""
    return [line for line in lines if any(value > SMALLEST for value in line.value)]


def _drawn(axes: Axes, lines: Sequence[Line]) -> tuple[list[str], list[tuple[float, str, str]]]:
    """Grid, bands and lines, and the labels at the lines' ends: height, name and colour."""
    parts = [*_grid(axes), *(_band(line, axes) for line in lines if line.low)]
    parts += [_polyline(line, axes) for line in lines]
    return parts, [(axes.y(line.value[-1]), line.name, line.colour) for line in lines]


def _svg(title: str, parts: list[str], labels: list[tuple[float, str, str]]) -> Markup:
    return Markup(
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(title)}">'
        f"{''.join(parts + _labels(labels))}</svg>"
    )


def _grid(axes: Axes) -> list[str]:
    right, base = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = []
    for value, text in axes.ticks():
        y = axes.y(value)
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(
            f'<text class="tick" x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{text}</text>'
        )
    for step in _steps_marked(axes.last):
        x = axes.x(step)
        parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{base}"/>')
        parts.append(
            f'<text class="tick" x="{x:.1f}" y="{base + 17}" text-anchor="middle">{step}</text>'
        )
    centre = (LEFT + right) / 2
    middle = (TOP + base) / 2
    parts.append(
        f'<text class="axis" x="{centre}" y="{HEIGHT - 8}" text-anchor="middle">'
        f"{escape(axes.across)}</text>"
        f'<text class="axis" transform="translate(14 {middle}) rotate(-90)" '
        f'text-anchor="middle">{escape(axes.up)}</text>'
    )
    return parts


def _steps_marked(last: int) -> list[int]:
    """1, and the multiples of 1, 2 or 5 times a power of ten that give at most seven marks."""
    step = next(
        mantissa * 10**power
        for power in range(len(str(last)) + 1)
        for mantissa in (1, 2, 5)
        if last <= 7 * mantissa * 10**power
    )
    return [1, *range(max(step, 2), last + 1, step)]


def _points(horizon: Sequence[int], errors: Sequence[float], axes: Axes) -> list[str]:
    return [
        f"{axes.x(step):.1f},{axes.y(error):.1f}"
        for step, error in zip(horizon, errors, strict=True)
    ]


def _band(line: Line, axes: Axes) -> str:
    outline = _points(line.horizon, line.high, axes)
    outline += reversed(_points(line.horizon, line.low, axes))
    return f'<polygon fill="{line.colour}" opacity="0.12" points="{" ".join(outline)}"/>'


def _polyline(line: Line, axes: Axes) -> str:
    points = " ".join(_points(line.horizon, line.value, axes))
    hover = (
        f"{escape(line.name)}: {line.value[0]:.3g} at {line.horizon[0]}, "
        f"{line.value[-1]:.3g} at {line.horizon[-1]}"
    )
    dash = f' stroke-dasharray="{line.dash}"' if line.dash else ""
    return (
        f'<polyline class="model" stroke="{line.colour}"{dash} points="{points}">'
        f"<title>{hover}</title></polyline>"
    )


def _labels(labels: list[tuple[float, str, str]]) -> list[str]:
    """Names at the lines' ends, moved apart where they would overlap."""
    ordered = sorted(labels)
    places: list[float] = []
    for y, _, _ in ordered:
        places.append(max(y, places[-1] + LABEL_SPACING) if places else y)
    lowest = float(HEIGHT - BOTTOM)
    for index in range(len(places) - 1, -1, -1):
        places[index] = min(places[index], lowest)
        lowest = places[index] - LABEL_SPACING
    return [
        f'<text class="label" x="{WIDTH - RIGHT + 6}" y="{place + 4:.1f}"'
        + (f' fill="{colour}"' if colour else "")
        + f">{escape(name)}</text>"
        for place, (_, name, colour) in zip(places, ordered, strict=True)
    ]
