"""Error against horizon as inline SVG: logarithmic error, one line a model, nothing to load."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

WIDTH, HEIGHT = 640, 380
LEFT, RIGHT, TOP, BOTTOM = 62, 132, 14, 46
LABEL_SPACING = 15.0


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
class Axes:
    """Where a horizon and an error lie on the picture: linear and logarithmic."""

    last: int
    bottom: float
    top: float

    def x(self, horizon: float) -> float:
        """Pixels from the left."""
        return LEFT + (WIDTH - LEFT - RIGHT) * (horizon - 1) / max(1, self.last - 1)

    def y(self, error: float) -> float:
        """Pixels from the top; errors off the scale lie on its edge."""
        decades = math.log10(max(error, 1e-300))
        share = (decades - self.bottom) / (self.top - self.bottom)
        return TOP + (HEIGHT - TOP - BOTTOM) * (1.0 - min(1.0, max(0.0, share)))


def horizon_chart(lines: Sequence[Line], title: str, floor: float | None = None) -> Markup | None:
    """A chart of mean squared normalised stress error against horizon.

    Parameters
    ----------
    lines : the models; one that is zero everywhere has no place on a logarithmic axis
    title : for readers who hear the page
    floor : scatter between packings made alike, a dashed line; None for no line

    Returns
    -------
    An SVG element, or None where there is nothing to draw.
    """
    drawn = [line for line in lines if any(value > 0.0 for value in line.value)]
    if not drawn:
        return None
    positive = [value for line in drawn for value in line.value if value > 0.0]
    if floor:
        positive.append(floor)
    bottom = math.floor(math.log10(min(positive)))
    top = max(bottom + 1, math.ceil(math.log10(max(positive)) - 1e-9))
    axes = Axes(max(line.horizon[-1] for line in drawn), bottom, top)
    parts = [*_grid(axes), *(_band(line, axes) for line in drawn if line.low)]
    parts += [_polyline(line, axes) for line in drawn]
    labels = [(axes.y(line.value[-1]), line.name, line.colour) for line in drawn]
    if floor:
        y = axes.y(floor)
        parts.append(
            f'<line class="floor" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}">'
            f"<title>replicate scatter: {floor:.3g}</title></line>"
        )
        labels.append((y, "replicate scatter", ""))
    parts += _labels(labels)
    return Markup(
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(title)}">'
        f"{''.join(parts)}</svg>"
    )


def _grid(axes: Axes) -> list[str]:
    right, base = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = []
    for decade in range(int(axes.bottom), int(axes.top) + 1):
        y = axes.y(10.0**decade)
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(
            f'<text class="tick" x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">10'
            f'<tspan dy="-5" font-size="9">{str(decade).replace("-", "−")}</tspan></text>'
        )
    for horizon in _ticks(axes.last):
        x = axes.x(horizon)
        parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{base}"/>')
        parts.append(
            f'<text class="tick" x="{x:.1f}" y="{base + 17}" text-anchor="middle">{horizon}</text>'
        )
    centre = (LEFT + right) / 2
    middle = (TOP + base) / 2
    parts.append(
        f'<text class="axis" x="{centre}" y="{HEIGHT - 8}" text-anchor="middle">'
        "horizon [steps since truth was given]</text>"
        f'<text class="axis" transform="translate(14 {middle}) rotate(-90)" '
        'text-anchor="middle">stress MSE [–]</text>'
    )
    return parts


def _ticks(last: int) -> list[int]:
    step = next(step for step in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000) if last / step <= 7)
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
    told = (
        f"{escape(line.name)}: {line.value[0]:.3g} at {line.horizon[0]}, "
        f"{line.value[-1]:.3g} at {line.horizon[-1]}"
    )
    dash = f' stroke-dasharray="{line.dash}"' if line.dash else ""
    return (
        f'<polyline class="model" stroke="{line.colour}"{dash} points="{points}">'
        f"<title>{told}</title></polyline>"
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
