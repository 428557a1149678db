"""Error curves: what is drawn is what was given, and models keep their style."""

import pytest

from granbench.plotting.error_curves import ErrorLine, error_figure, share_figure
from granbench.plotting.style import figure_svg, model_styles

STYLES = model_styles(("good", "bad"))
GOOD = ErrorLine("good", STYLES["good"], (1, 2, 5), (0.01, 0.02, 0.03), (), ())
BAD = ErrorLine("bad", STYLES["bad"], (1, 2, 5), (0.1, 1.0, 0.7), (0.05, 0.5, 0.6), (0.2, 2, 1.0))


def test_errors_are_drawn_on_a_logarithmic_axis_with_the_floor() -> None:
    figure = error_figure([GOOD, BAD], floor=0.05)
    (axis,) = figure.axes
    assert axis.get_yscale() == "log" and axis.get_xlim() == (1.0, 5.0)
    for line, drawn in zip((GOOD, BAD), axis.lines, strict=False):
        assert tuple(drawn.get_xdata()) == line.horizon
        assert tuple(drawn.get_ydata()) == line.value
        assert drawn.get_color() == line.style.colour
    assert len(axis.collections) == 1  # a single specimen gives no band
    (legend,) = figure.legends
    # From above, as the lines end.
    assert [text.get_text() for text in legend.get_texts()] == ["bad", "replicate scatter", "good"]


def test_shares_reach_from_nothing_to_all() -> None:
    (axis,) = share_figure([BAD], "output step", "error points").axes
    assert axis.get_ylim() == (0.0, 1.0)
    assert axis.get_xlabel() == "output step" and axis.get_ylabel() == "error points"


@pytest.mark.parametrize("draw", [error_figure, lambda lines: share_figure(lines, "x", "y")])
def test_the_same_figure_gives_the_same_svg(draw) -> None:
    assert figure_svg(draw([GOOD, BAD])) == figure_svg(draw([GOOD, BAD]))
