"""A new metric is one object in one file, and one entry point."""

import json
import sys
from pathlib import Path

import pytest
from plug_in import granbench, install, refused, scores

from granbench.benchmark.registry import plugged_in_metrics
from granbench.errors import GranbenchError

METRIC = '''
"""How far off is the stress at the end of a path?"""

from granbench.benchmark.metric import MEDIAN, Metric, Statistic

LAST = Statistic("last_relative_error", lambda errors: errors.relative[..., -1])  # (seed, path)

TOY = Metric(
    name="last_error_median",
    axis="along-paths",
    title="Error at the end",
    definition="relative stress error at the last step, median path",
    statistic=LAST,
    aggregation=MEDIAN,
    style="percent",
)
'''
ENTRY_POINT = "toy = toy_metric:TOY"


def test_a_metric_of_another_package_is_scored_shown_and_validated(tmp_path: Path) -> None:
    install(tmp_path, {"toy_metric.py": METRIC}, "granbench.metrics", ENTRY_POINT)
    words = ("evaluate", "persistence", "--task", "dem-triaxial-mini", "--axis", "rollout")
    table = granbench(tmp_path, *words, "--out", "toy.json")
    # In the scorecard, with an interval,
    (found,) = scores(
        tmp_path / "toy.json", protocol="rollout", split="test", metric="last_error_median"
    )
    assert found["status"] == "scored"
    assert 0.0 < found["low"] <= found["value"] <= found["high"]
    # in the terminal,
    assert f"{100.0 * found['value']:.3g} %" in table
    # where the predictions are scored again,
    checked = json.loads(granbench(tmp_path, "submission", "validate", "toy.json", "--json"))
    assert checked["valid"] and checked["badge"] == "rescored"
    # and on the board.
    (tmp_path / "board").mkdir()
    granbench(
        tmp_path, "leaderboard", "build", "--out", "site", "--board", "board", "--with", "toy.json"
    )
    page = (tmp_path / "site" / "dem-triaxial-mini-1.0.0.html").read_text()
    assert '<option value="last_error_median">Error at the end</option>' in page
    assert "<dt>Error at the end</dt><dd>relative stress error at the last step" in page


def test_a_submission_is_valid_with_and_refused_without_the_package_of_a_metric(
    tmp_path: Path,
) -> None:
    bare, extended = tmp_path / "bare", tmp_path / "extended"
    bare.mkdir()
    install(extended, {"toy_metric.py": METRIC}, "granbench.metrics", ENTRY_POINT)
    words = ("evaluate", "persistence", "--task", "dem-triaxial-mini", "--axis", "rollout", "-q")
    granbench(bare, *words, "--out", "bare.json")
    granbench(extended, *words, "--out", "extended.json")
    # A submission that was made before the metric was installed lacks its scores;
    said = granbench(extended, "submission", "validate", bare / "bare.json", "--json")
    assert json.loads(said)["valid"]
    # one that has them cannot be checked where the metric is not installed.
    error = refused(bare, "submission", "validate", extended / "extended.json")
    assert "metric 'last_error_median'" in error and "install the package" in error


@pytest.mark.parametrize(
    ("function", "exception"),
    [("1 / 0", "ZeroDivisionError"), ("errors.relative.mean()", "IndexError")],
    ids=["raises", "wrong shape"],
)
def test_an_exception_in_a_metric_names_its_package(
    tmp_path: Path, function: str, exception: str
) -> None:
    broken = METRIC.replace("errors.relative[..., -1]", function)
    install(tmp_path, {"toy_metric.py": broken}, "granbench.metrics", ENTRY_POINT)
    words = ("evaluate", "persistence", "--task", "dem-triaxial-mini", "--axis", "rollout")
    error = " ".join(refused(tmp_path, *words, "--out", "toy.json").split())
    for named in ("metric 'last_error_median'", "my-package", exception):
        assert named in error
    assert ("toy_metric.py line 6" in error) == (exception == "ZeroDivisionError")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (('axis="along-paths"', 'axis="beyond"'), "axis is 'beyond'"),
        (('name="last_error_median"', 'name="stress_mse_mean"'), "metric 'stress_mse_mean'"),
        (("TOY = Metric", "OTHER = Metric"), "toy_metric"),
    ],
)
def test_a_metric_that_cannot_be_used_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change, named: str
) -> None:
    install(tmp_path, {"toy_metric.py": METRIC.replace(*change)}, "granbench.metrics", ENTRY_POINT)
    monkeypatch.syspath_prepend(tmp_path)
    plugged_in_metrics.cache_clear()
    with pytest.raises(GranbenchError, match=named):
        plugged_in_metrics()
    sys.modules.pop("toy_metric", None)
