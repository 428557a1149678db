"""The page on scoring names every axis, metric and check that there is."""

import re

import pytest
import scoring_page
from lawless_cells import Elastic, Relaxing, cell
from plane_records import plane_records
from small_submissions import submitted

from granbench.benchmark.metric import METRIC_VERSION
from granbench.benchmark.registry import axes, find_axis
from granbench.leaderboard.submission import read_submission
from granbench.records import open_records, write_records

TEXT = scoring_page.PAGE.read_text(encoding="utf-8")


def test_the_generated_part_is_what_the_code_makes() -> None:
    """`make docs` writes it."""
    assert scoring_page.page() == TEXT


@pytest.mark.parametrize("axis", axes(), ids=lambda axis: axis.name)
def test_every_axis_and_protocol_is_defined(axis) -> None:
    assert f"## {axis.title}" in TEXT
    if len(axis.parts) > 1:
        for name in {*axis.names, *(part.name for part in axis.parts)} - {axis.name}:
            assert f"`{name}`" in TEXT, name


@pytest.mark.parametrize("axis", axes(), ids=lambda axis: axis.name)
def test_every_metric_is_defined(axis) -> None:
    named = set()
    for row in re.findall(r"^\| (`.*?) \|", axis.section(), flags=re.MULTILINE):
        base, *endings = re.findall(r"`([\w-]+)`", row)
        stem = base.rpartition("_")[0]
        named |= {base, *(f"{stem}{end}" if end.startswith("_") else end for end in endings)}
    assert axis.section() in TEXT
    for metric in axis.metrics(["XX"]):
        assert metric.name in named, metric.name


def test_the_page_is_about_this_version_of_the_metrics() -> None:
    assert f"now **{METRIC_VERSION}**" in TEXT


@pytest.mark.parametrize("part", ["physics", "cost"])
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
    tables = {name: find_axis(name).measured_tables(given)[name] for name in ("physics", "cost")}
    rows = tables["physics"].splitlines()
    zero = next(row for row in rows if "zero-increment" in row).split("|")
    assert zero[2].strip() == "0" and zero[3].strip().startswith("**")  # bold: beyond the tolerance
    assert next(row for row in rows if "compression" in row).count("n/a") == 2
    cost = tables["cost"]
    assert "`elastic` on `gp-j2`" in cost and "µs" in cost
