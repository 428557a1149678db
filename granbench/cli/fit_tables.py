"""A fit as tables and sentences for the terminal."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from rich import box
from rich.table import Table

from granbench.files.printable import printable

if TYPE_CHECKING:
    pass


MOST_TESTS_SHOWN = 12


WIDE, VAST = 4.0, 100.0
"""Width of an interval over its value, and ratio of its ends, above which a parameter counts as
poorly determined."""


def understanding_of_tests(report: dict[str, Any]) -> Iterator[str]:
    """The interpretation of each test, for the terminal; at most `MOST_TESTS_SHOWN` tests."""
    for test in report["tests"][:MOST_TESTS_SHOWN]:
        void_ratio = test["initial_void_ratio"]
        parts = [f"{test['kind']} ({test['kind_from']})" if test["kind_from"] else test["kind"]]
        parts += [test[key] for key in ("drainage", "stresses") if test[key]]
        parts.append(f"p0 = {test['initial_mean_stress'] / 1e3:.6g} kPa")
        parts += [] if void_ratio is None else [f"e0 = {void_ratio:.4g}"]
        parts += [f"{test['strain_measure']} strain"] if test["strain_measure"] else []
        parts += test["notes"]
        if test["columns_not_used"]:
            parts.append(f"columns not used: {', '.join(test['columns_not_used'])}")
        parts.append(f"{test['points']} rows read, {test['points_used']} used")
        yield f"{test['name']}: {'; '.join(parts)}"
    if (more := len(report["tests"]) - MOST_TESTS_SHOWN) > 0:
        yield f"{more} more tests: see tests in fit.json"


def result_tables(report: dict[str, Any]) -> Iterator[Table]:
    """The parameters of a fit and the errors of its tests as tables."""
    table = _plain(f"{report['model']}: error {100.0 * report['error']:.3g} % of the range")
    for heading in ("parameter", "symbol", "value", "95 % interval", "unit", ""):
        table.add_column(heading, justify="right" if heading in ("value",) else "left")
    for row in report["parameters"]:
        interval = row["interval_95"]
        shown = (
            "–"
            if interval is None or None in interval
            else f"{interval[0]:.4g} to {interval[1]:.4g}"
        )
        known = _known(row)
        table.add_row(row["name"], row["symbol"], f"{row['value']:.6g}", shown, row["units"], known)
    yield table
    table = _plain("error of each test, % of the measured range")
    quantities = list(
        dict.fromkeys(name for row in report["errors"] for name in row["by_quantity"])
    )
    for heading in ("test", "", "error", *(name.replace("_", "\n") for name in quantities)):
        table.add_column(heading, justify="left" if heading in ("test", "") else "right")
    for row in report["errors"]:
        parts = [row["by_quantity"].get(name) for name in quantities]
        shown_parts = ["–" if part is None else f"{100.0 * part:.3g}" for part in parts]
        role = "" if row["role"] == "fitted" else row["role"]
        error = f"{100.0 * row['error']:.3g}"
        table.add_row(printable(row["test"]), role, error, *shown_parts)
    yield table


def _known(row: dict[str, Any]) -> str:
    """How well the tests determine a parameter, if its interval does not show it."""
    if not row["free"]:
        return "held"
    if row["identifiable"] is False:
        return "not identified"
    low, high = row["interval_95"]
    if low is None or high is None:
        return "hardly identified"
    wide = high - low > WIDE * abs(row["value"]) or 0.0 < VAST * low < high
    return "hardly identified" if wide else ""


def _plain(title: str) -> Table:
    return Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
