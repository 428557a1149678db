"""Results of a fit as files: a report as JSON, and curves as CSV."""

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from granbench import __version__
from granbench.errors import ConfigurationError
from granbench.files.whole_file import whole_file
from granbench.fitting.fitting import Fit
from granbench.fitting.settings import FitSettings
from granbench.laboratory import LaboratoryTest
from granbench.laboratory.laboratory_test import NO_SHEAR
from granbench.models import ClassicalCell

REPORT, CURVES, PICTURE = "fit.json", "curves.csv", "fit.png"


def report_of(
    fit: Fit,
    settings: FitSettings,
    tests: Sequence[LaboratoryTest],
    left_out: Sequence[LaboratoryTest],
) -> dict[str, Any]:
    """The fit as data for JSON: SI units, errors as shares of the range of a quantity.

    An unknown number, such as the correlation of parameters without influence, is None.

    Parameters
    ----------
    fit : what was found
    settings : how
    tests, left_out : what was fitted and what was only predicted
    """
    return _without_nan(_report(fit, settings, tests, left_out))


def _without_nan(part: Any) -> Any:
    """A part of a report in which numbers that are not finite are None: JSON has no NaN."""
    if isinstance(part, dict):
        return {key: _without_nan(value) for key, value in part.items()}
    if isinstance(part, list | tuple):
        return [_without_nan(value) for value in part]
    return None if isinstance(part, float) and not np.isfinite(part) else part


def _report(
    fit: Fit,
    settings: FitSettings,
    tests: Sequence[LaboratoryTest],
    left_out: Sequence[LaboratoryTest],
) -> dict[str, Any]:
    intervals, values = fit.interval(), fit.cell.values()
    known, spread = fit.identifiability, fit.uncertainty
    cost = fit.minimum.cost
    return {
        "model": fit.cell.name,
        "granbench_version": __version__,
        "error": fit.error,
        "errors": [
            {
                "test": error.name,
                "role": error.role,
                "control": error.control,
                "points": error.points,
                "error": error.total,
                "by_quantity": dict(error.by_quantity),
                "points_not_reached": error.lost,
            }
            for error in fit.errors
        ],
        "parameters": [
            {
                "name": parameter.name,
                "symbol": parameter.symbol,
                "units": parameter.units,
                "meaning": parameter.meaning,
                "value": values[parameter.name],
                "first_value": fit.start[parameter.name],
                "free": parameter.name in fit.space.names,
                "interval_95": list(intervals[parameter.name])
                if parameter.name in intervals
                else None,
                "identifiable": known.identifiable.get(parameter.name),
            }
            for parameter in fit.cell.parameter_table
        ],
        "uncertainty": {
            "method": spread.method,
            "names": list(fit.space.names),
            "correlation": np.round(spread.correlation, 6).tolist(),  # null where not known
        },
        "identifiability": {
            "names": list(known.names),
            "effects": known.effects.tolist(),
            "directions": known.directions.tolist(),
            "threshold": known.threshold,
        },
        "starts": {
            "count": len(cost),
            "errors": ((cost / max(1, _fitted(fit))) ** 0.5).tolist(),
            "converged": fit.minimum.converged.tolist(),
            "iterations": fit.minimum.iterations.tolist(),
        },
        "settings": {
            "free": list(fit.space.names),
            "control": settings.control,
            "points": settings.points,
            "weights": dict(settings.weights),
            "starts": settings.starts,
            "spread": settings.spread,
            "seed": settings.seed,
            "bootstrap": settings.bootstrap,
            "effort": vars(settings.effort),
        },
        "tests": [_of_test(test, settings.points) for test in (*tests, *left_out)],
        "warnings": [*_gaps(fit.cell, tests), *_thinned(tests, settings.points), *fit.warnings],
    }


def _of_test(test: LaboratoryTest, points: int) -> dict[str, Any]:
    """The interpretation of a test."""
    understood = test.interpretation
    return {
        "name": test.name,
        "source": test.source,
        "kind": test.kind,
        "initial_mean_stress": test.initial_mean_stress,
        "initial_void_ratio": test.initial_void_ratio,
        "kind_from": "" if understood is None else understood.kind,
        "drainage": "" if understood is None else understood.drainage,
        "stresses": "" if understood is None else understood.stresses,
        "strain_measure": "" if understood is None else understood.strain_measure,
        "columns_not_used": [] if understood is None else list(understood.not_used),
        "notes": [] if understood is None else list(understood.notes),
        "points": test.steps,
        "points_used": test.thinned(points).steps,
    }


def _thinned(tests: Sequence[LaboratoryTest], points: int) -> list[str]:
    """A warning for every test with more reversals than points."""
    return [
        f"test {test.name} has so many reversals that {used} of its {test.steps} rows were used "
        f"instead of {points}: every reversal is kept"
        for test in tests
        if (used := test.thinned(points).steps) > points
    ]


def _gaps(cell: ClassicalCell, tests: Sequence[LaboratoryTest]) -> list[str]:
    """What the fitted tests do not determine, one sentence each."""
    found = []
    if unsheared := [test.name for test in tests if not test.is_sheared]:
        found.append(
            f"no shear in {', '.join(unsheared)}: q stays below {100.0 * NO_SHEAR:g} % of p, so "
            "they do not determine strength and shear stiffness"
        )
    without = [test.name for test in tests if test.void_ratio is None]
    if "void_ratio" in cell.internal_variables and 0 < len(without) < len(tests):
        found.append(
            f"no void ratio in {', '.join(without)}: tests that run together start without any "
            "if one lacks it; add the column, or give the initial void ratio"
        )
    return found


def _fitted(fit: Fit) -> int:
    return sum(error.role == "fitted" for error in fit.errors)


def write_report(report: dict[str, Any], path: Path) -> Path:
    """Write a report as JSON.

    Raises
    ------
    ConfigurationError
        If the folder cannot be written.
    """
    with whole_file(path, ConfigurationError) as partial:
        partial.write_text(json.dumps(report, indent=2, ensure_ascii=False, allow_nan=False) + "\n")
    return path


def write_curves(fit: Fit, path: Path) -> Path:
    """Write measured and predicted curves as CSV, one row a point; strain as ratio, stress in Pa.

    Raises
    ------
    ConfigurationError
        If the folder cannot be written.
    """
    names = [str(name) for name in fit.curves.data_vars]
    units = [fit.curves[name].attrs["units"].replace("1", "-") for name in names]
    header = ["test", "role", *(f"{n} [{u}]" for n, u in zip(names, units, strict=True))]
    with (
        whole_file(path, ConfigurationError) as partial,
        partial.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        for test in range(fit.curves.sizes["test"]):
            member = fit.curves.isel(test=test)
            label = [str(member["test"].values), str(member["role"].values)]
            columns = [member[name].values for name in names]
            for row in zip(*columns, strict=True):
                if np.isfinite(row[names.index("axial_strain")]):
                    writer.writerow([*label, *(f"{value:.9g}" for value in row)])
    return path
