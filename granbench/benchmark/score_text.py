"""How a score is written: in the terminal, and on the board."""

from markupsafe import Markup, escape

from granbench.benchmark.metric import Metric, Style
from granbench.benchmark.presentation import Cell
from granbench.benchmark.scorecard import Score

LEFT_OUT = "the axis was left out of the evaluation"


def written(score: Score | None, style: Style = "number") -> str:
    """A score for the terminal, in three significant digits."""
    if score is None:
        return "–"
    if score.value is None:
        return "n/a"
    value = score.value
    if style == "percent":
        percent = 100.0 * value
        return f"{percent:.0f} %" if percent >= 100.0 else f"{percent:.3g} %"
    if style == "count":
        return f"{value:,.0f}"
    if style == "time":
        if value < 1e-3:
            return f"{1e6 * value:.3g} µs"
        return f"{value:,.0f} s" if value >= 100.0 else f"{value:.3g} s"
    return f"{value:.3g}"


def written_interval(score: Score | None) -> str:
    """The interval of a score for the terminal."""
    if score is None or score.low is None or score.high is None:
        return "–"
    return f"{score.low:.2g}–{score.high:.2g}"


def number(value: float) -> Markup:
    """Three significant digits for the board; small and large ones as a power of ten."""
    if value == 0.0:
        return Markup("0")
    if 1e-2 <= abs(value) < 1e4:
        digits = f"{value:.3g}"
        return Markup(escape(f"{value:.0f}" if "e" in digits else digits))
    mantissa, exponent = f"{value:.2e}".split("e")
    power = str(int(exponent)).replace("-", "−")
    return Markup(f"{mantissa}·10<sup>{power}</sup>")


def share(value: float) -> Markup:
    """A share in per cent, for the board."""
    percent = 100.0 * value
    digits = f"{percent:.0f}" if percent >= 100.0 else f"{percent:.3g}"
    return Markup(escape("0 %" if percent == 0.0 else f"{digits} %"))


def rendered(value: float, style: Style) -> Markup:
    """A value for the board, as its metric is written."""
    if style == "percent":
        return share(value)
    if style == "count":
        return Markup(f"{value:,.0f}")
    if style == "time":
        return Markup(f"{1e6 * value:.3g} µs") if value < 1e-3 else number(value) + Markup(" s")
    return number(value) + (Markup(" ×") if style == "speed-up" else "")


def of_seeds(score: Score) -> str:
    """The values of the seeds, or that they agree."""
    if len(score.by_seed) > 1 and len(set(score.by_seed)) == 1:
        return "the same for every seed"
    return f"{len(score.by_seed)} seeds: {', '.join(f'{value:.3g}' for value in score.by_seed)}"


def cell(score: Score | None, metric: Metric | None) -> Cell:
    """A score on the board: its value, or why there is none; of an axis that may be left out."""
    if score is None:
        return Cell(Markup("not run"), note=LEFT_OUT)
    if score.value is None:
        return Cell(Markup("n/a"), note=score.reason or "")
    style = metric.style if metric else "number"
    return Cell(rendered(score.value, style), score.value, note=of_seeds(score))
