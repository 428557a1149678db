"""Charts of the pages: what an axis shows of its curves, as inline SVG."""

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from granbench.benchmark.presentation import Chart
from granbench.benchmark.scorecard import Curve
from granbench.leaderboard.chart import horizon_chart, not_zero, share_chart
from granbench.plotting.error_curves import ErrorLine
from granbench.plotting.style import ModelStyle, model_styles


@dataclass(frozen=True)
class DrawnChart:
    """A chart on a page.

    Parameters
    ----------
    title : above it
    svg : the picture; None where all models are zero everywhere
    zero : sentence that names such models, "" for none
    """

    title: str
    svg: Markup | None
    zero: str


def drawn_chart(chart: Chart, names: Sequence[str]) -> DrawnChart:
    """A chart of an axis with the colours of a page.

    Parameters
    ----------
    chart : made by an axis
    names : of all models of the page, which decide the colours
    """
    styles = model_styles(names)
    lines = [line_of(name, styles[name], curve) for name, curve in chart.curves.items()]
    if chart.scale == "decades":
        svg = horizon_chart(lines, chart.label, chart.reference)
    else:
        svg = share_chart(lines, chart.label, chart.across, chart.up)
    shown = {line.name for line in not_zero(lines)}
    zero = [line.name for line in lines if line.name not in shown]
    return DrawnChart(chart.title, svg, f"{chart.zero}: {', '.join(zero)}." if zero else "")


def line_of(name: str, style: ModelStyle, curve: Curve) -> ErrorLine:
    """A model's curve in its colour and line style."""
    return ErrorLine(name, style, curve.horizon, curve.value, curve.low, curve.high)
