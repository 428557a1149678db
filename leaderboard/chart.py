"""Figures of the board as inline SVG: nothing to load, read out by screen readers."""

import re
import zlib
from collections.abc import Mapping, Sequence

from markupsafe import Markup, escape
from matplotlib.figure import Figure

from granbench.plotting.error_curves import (
    FLOOR_LABEL,
    ErrorLine,
    error_figure,
    line_id,
    share_figure,
)
from granbench.plotting.style import figure_svg

SMALLEST = 1e-30
"""Smaller values count as zero: no rounding leaves so little."""


def horizon_chart(
    lines: Sequence[ErrorLine], title: str, floor: float | None = None
) -> Markup | None:
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
    tooltips = _tooltips(drawn)
    if floor:
        tooltips[FLOOR_LABEL] = f"{FLOOR_LABEL}: {floor:.3g}"
    return inline_svg(error_figure(drawn, floor), title, tooltips)


def share_chart(lines: Sequence[ErrorLine], title: str, across: str, up: str) -> Markup | None:
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
    return inline_svg(share_figure(drawn, across, up), title, _tooltips(drawn))


def not_zero(lines: Sequence[ErrorLine]) -> list[ErrorLine]:
    """The lines that have something to show."""
    return [line for line in lines if any(value > SMALLEST for value in line.value)]


def inline_svg(figure: Figure, title: str, tooltips: Mapping[str, str]) -> Markup:
    """A figure as an SVG element of a page; the same figure always gives the same text.

    Parameters
    ----------
    figure : whose lines have the ids `line_id(name)`
    title : read out by screen readers; different for each chart of a page
    tooltips : shown over a line, by its name
    """
    text = figure_svg(figure)
    text = text[text.index("<svg") :].strip()
    opening, content = text.split(">", 1)
    view = re.search(r'viewBox="[^"]+"', opening)
    for name, tooltip in tooltips.items():
        group = f'<g id="{escape(line_id(name))}">'
        content = content.replace(group, f'<g class="model"><title>{escape(tooltip)}</title>')
    # Several charts are in one page, where an id must be the only one of its name.
    prefix = f"chart-{zlib.crc32(title.encode()):08x}-"
    content = re.sub(r'(\bid="|url\(#|href="#)', rf"\1{prefix}", _shortened(content))
    return Markup(
        f'<svg {view[0] if view else ""} role="img" aria-label="{escape(title)}" '
        f'xmlns:xlink="http://www.w3.org/1999/xlink">{content}'
    )


def _shortened(content: str) -> str:
    """The same picture in half of the bytes: tenths of a point, no ids that nothing refers to."""
    content = re.sub(r"(\.\d)\d+", r"\1", content)
    content = re.sub(r"\s+", " ", re.sub(r">\s+<", "><", content))
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', content))
    return re.sub(r' id="([^"]+)"', lambda found: found[0] if found[1] in used else "", content)


def _tooltips(lines: Sequence[ErrorLine]) -> dict[str, str]:
    return {
        line.name: f"{line.name}: {line.value[0]:.3g} at {line.horizon[0]}, "
        f"{line.value[-1]:.3g} at {line.horizon[-1]}"
        for line in lines
    }
