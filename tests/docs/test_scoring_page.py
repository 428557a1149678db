"""The page on scoring names every axis, metric and check that there is."""

import re

import pytest
import scoring_page
from lawless_cells import Elastic, Relaxing, cell
from plane_records import plane_records
from small_submissions import submitted

from granbench.benchmark.axes.along_paths.protocols import PROTOCOLS
from granbench.benchmark.axes.cost.scores import COST_METRICS
from granbench.benchmark.axes.embedded.metrics import EMBEDDED_METRICS
from granbench.benchmark.axes.physics.checks import CHECKS
from granbench.benchmark.metrics import METRIC_VERSION, PHYSICS_METRICS, TANGENT_METRICS, metrics
from granbench.benchmark.registry import axis_names
from granbench.leaderboard.submission import read_submission
from granbench.records import open_records, write_records

TEXT = scoring_page.PAGE.read_text(encoding="utf-8")


def test_the_generated_part_is_what_the_code_makes() -> None:
    """`make docs` writes it."""
    assert scoring_page.page() == TEXT


def test_every_axis_and_protocol_is_defined() -> None:
    for name in {*axis_names(), *PROTOCOLS, *CHECKS} - {"physics", "cost"}:
        assert f"`{name}`" in TEXT, name
    assert "## Physics" in TEXT and "## Cost" in TEXT


def test_every_metric_is_defined() -> None:
    named = set()
    for row in re.findall(r"^\| (`.*?) \|", TEXT, flags=re.MULTILINE):
        base, *endings = re.findall(r"`([\w-]+)`", row)
        stem = base.rpartition("_")[0]
        named |= {base, *(f"{stem}{end}" if end.startswith("_") else end for end in endings)}
    for axis in ("rollout", "noise"):
        for metric in metrics(["XX"], axis):
            assert metric.name in named, metric.name
    for metric in COST_METRICS:
        assert metric.name in named, metric.name
    for metric in (*PHYSICS_METRICS, *TANGENT_METRICS, *EMBEDDED_METRICS.values()):
        assert f"`{metric.name}`" in TEXT, metric.name


def test_the_page_is_about_this_version_of_the_metrics() -> None:
    assert f"now **{METRIC_VERSION}**" in TEXT


@pytest.mark.parametrize("part", ["checks", "physics", "cost"])
def test_the_measured_parts_are_filled(part: str) -> None:
    _, _, after = TEXT.partition(f"<!-- {part}:begin -->")
    assert after.partition(f"<!-- {part}:end -->")[0].count("\n| ") >= 5


def test_measured_tables_are_made_from_submissions(tmp_path) -> None:
    sealed = open_records(write_records(plane_records(), tmp_path / "gp.nc")).load()
    given = [
        read_submission(
            submitted(
                cell(module),
                sealed,
                tmp_path / f"{name}.json",
                seeds=(0,),
                axes=["physics", "cost"],
                name=name,
            )
        )
        for name, module in (("elastic", Elastic()), ("relaxing", Relaxing()))
    ]
    rows = scoring_page.physics_table(given).splitlines()
    zero = next(row for row in rows if "zero-increment" in row).split("|")
    assert zero[2].strip() == "0" and zero[3].strip().startswith("**")  # bold: beyond the tolerance
    assert next(row for row in rows if "compression" in row).count("n/a") == 2
    cost = scoring_page.cost_table(given)
    assert "`elastic` on `gp-j2`" in cost and "µs" in cost
