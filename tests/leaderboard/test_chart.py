"""Charts of the board: inline SVG that a page can hold many of."""

import re
from xml.etree import ElementTree

import pytest

from granbench.leaderboard.chart import horizon_chart, share_chart
from granbench.plotting.error_curves import ErrorLine
from granbench.plotting.style import model_styles

NAMES = ("gru", "a <b> & $c", "zero")


def lines(names: tuple[str, ...] = NAMES) -> list[ErrorLine]:
    styles = model_styles(names)
    return [
        ErrorLine(name, styles[name], range(1, 4), value, value, value)
        for name, value in zip(names, ((0.1, 0.2, 0.4), (0.2, 0.2, 0.2), (0.0,) * 3), strict=True)
    ]


def test_a_chart_is_one_accessible_element_with_a_tooltip_for_every_line() -> None:
    svg = str(horizon_chart(lines(), "Whole paths <test>", floor=0.15))
    root = ElementTree.fromstring(svg)
    assert root.get("role") == "img" and root.get("aria-label") == "Whole paths <test>"
    titles = [title.text for title in root.iter() if title.tag.endswith("title")]
    assert [title.split(":")[0] for title in titles if title] == [
        "gru", "a <b> & $c", "replicate scatter",
    ]  # fmt: skip
    words = " ".join(root.itertext())
    assert "replicate scatter" in words and "zero" not in words


def test_the_same_chart_is_the_same_text_and_two_charts_share_no_id() -> None:
    one, again, other = (
        str(share_chart(lines(), title, "step", "share")) for title in ("one", "one", "other")
    )
    assert one == again
    ids, others = (set(re.findall(r'\bid="([^"]+)"', svg)) for svg in (one, other))
    assert ids and not ids & others
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', one))
    assert used <= ids


@pytest.mark.parametrize("given", [[], [lines()[-1]]])
def test_nothing_is_drawn_of_models_without_an_error(given: list[ErrorLine]) -> None:
    assert horizon_chart(given, "title") is None
    assert share_chart(given, "title", "step", "share") is None
