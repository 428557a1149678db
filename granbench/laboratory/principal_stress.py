"""Axial and lateral effective stress from the stresses of a file, which must agree."""

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError, Setting
from granbench.laboratory.laboratory_test import CONSTANT_STRESS, LATERAL_STRAIN_GIVEN
from granbench.laboratory.quantities import QUANTITIES, listed
from granbench.laboratory.remedies import HEADER, QUANTITY, column, ignore, pressure, stresses
from granbench.laboratory.remedies import kind as kind_is
from granbench.laboratory.settings import ImportSettings
from granbench.laboratory.stress_series import KnownStresses, Series
from granbench.laboratory.water import READING, agree
from granbench.tables.tables import Table

Floats = NDArray[np.float64]


def principal_stress(
    table: Table, known: KnownStresses, settings: ImportSettings, kind: str | None
) -> Floats:
    """Effective stress (row, 3), Pa: axial, intermediate and lateral.

    Parameters
    ----------
    table : for error texts
    known : effective stresses of the file
    settings : with a constant lateral stress, where the file has none
    kind : of the test, where it is known; in an `oedometer` test whose lateral stress was not
        measured it is NaN, except in the first row, which has K0 times the axial stress

    Raises
    ------
    DatasetError
        Naming the columns, if the stresses do not follow from them, they contradict each other or
        a setting, or the pore pressure is above the total stress.
    """
    axial, lateral, q = (
        _first(known, "axial_stress"),
        _first(known, "radial_stress"),
        known.deviatoric,
    )
    mean, middle = _first(known, "mean_stress"), _first(known, "intermediate_stress")
    if lateral is None:
        lateral = _derived_lateral(axial, mean, q)
    lateral = _with_given_stress(table, lateral, known, settings, kind)
    if lateral is None and kind == "isotropic" and (either := mean or axial) is not None:
        lateral = either
    if lateral is None and kind == "oedometer" and axial is not None:
        return _without_lateral_stress(axial.values, settings.k0)
    if lateral is None:
        raise _no_lateral_stress(table, axial, mean)
    if axial is None and q is not None:
        axial = Series(f"{lateral.name} and {q.name}", lateral.values + q.values)
    elif axial is None and mean is not None:
        values = 3.0 * mean.values - 2.0 * lateral.values
        axial = Series(f"{mean.name} and {lateral.name}", values)
    if axial is None:
        raise missing(
            table,
            "the axial stress",
            "add q, p or the axial stress, or name its column with ",
            column("deviatoric_stress"),
        )
    stress = np.stack(
        [axial.values, (middle or lateral).values, lateral.values], axis=-1, dtype=float
    )
    _check_redundant(table, known, stress, axial, lateral)
    _check_compression(table, lateral)
    return stress


def missing(table: Table, what: str, *remedy: str | Setting) -> DatasetError:
    """The error that no column of a table gives a required quantity."""
    headers = listed(column.header for column in table.columns)
    return DatasetError(f"{table.source}: no column gives {what} among {headers}; ", *remedy)


def _first(known: KnownStresses, name: str) -> Series | None:
    return next(iter(known.effective.get(name, [])), None)


def _derived_lateral(axial: Series | None, mean: Series | None, q: Series | None) -> Series | None:
    if mean is not None and q is not None:
        return Series(f"{mean.name} and {q.name}", mean.values - q.values / 3.0)
    if axial is not None and q is not None:
        return Series(f"{axial.name} and {q.name}", axial.values - q.values)
    if axial is not None and mean is not None:
        return Series(f"{axial.name} and {mean.name}", (3.0 * mean.values - axial.values) / 2.0)
    return None


def _with_given_stress(
    table: Table,
    lateral: Series | None,
    known: KnownStresses,
    settings: ImportSettings,
    kind: str | None,
) -> Series | None:
    """The lateral stress, or the given constant one where the file has none."""
    given = settings.lateral_stress
    if given is None:
        return lateral
    if kind in LATERAL_STRAIN_GIVEN:
        raise DatasetError(
            f"{table.source}: ",
            Setting("lateral_stress"),
            f" gives a constant lateral stress, but in a test of the kind {kind} it is not "
            "constant; leave it out",
            ", and add the pore pressure" if kind == "triaxial-undrained" else "",
        )
    series = Series(f"the given lateral stress of {given:g} Pa", np.full(len(table.places), given))
    if lateral is not None and not agree(lateral.values, series.values):
        raise DatasetError(
            f"{table.source}: {series.name} contradicts {lateral.name}, by which the effective "
            f"lateral stress goes from {lateral.values.min():g} to {lateral.values.max():g} Pa; "
            "leave out ",
            Setting("lateral_stress"),
            ", or the columns with ",
            ignore(HEADER),
        )
    change = known.water.largest_change
    if lateral is None and change is not None and change > CONSTANT_STRESS * given:
        raise DatasetError(
            f"{table.source}: ",
            Setting("lateral_stress"),
            f" gives a constant effective lateral stress, but {known.water.name} changes by "
            f"{change:g} Pa; give the total one with ",
            pressure("cell_pressure"),
            " instead",
        )
    return series if lateral is None else lateral


def _no_lateral_stress(table: Table, axial: Series | None, mean: Series | None) -> DatasetError:
    remedy: list[str | Setting] = [
        f"{'otherwise ' if axial is not None else ''}it follows from two of q, p, axial "
        "and lateral stress: name the missing column with ",
        column("mean_stress"),
        ", or give a constant effective lateral stress with ",
        pressure("lateral_stress"),
        ", or a constant total one with ",
        pressure("cell_pressure"),
    ]
    if axial is not None:
        remedy[:0] = ["if this is an oedometer test, give ", kind_is("oedometer"), "; "]
    elif mean is not None:
        remedy += ["; if this is isotropic compression, give ", kind_is("isotropic")]
    return missing(table, "the lateral stress", *remedy)


def _without_lateral_stress(axial: Floats, k0: float) -> Floats:
    stress = np.full((len(axial), 3), np.nan)
    stress[:, 0] = axial
    stress[0, 1:] = k0 * axial[0]
    return stress


def _check_redundant(
    table: Table, known: KnownStresses, stress: Floats, axial: Series, lateral: Series
) -> None:
    """Refuse columns that contradict the derived stresses."""
    expected = {
        "axial_stress": stress[:, 0],
        "radial_stress": stress[:, 2],
        "intermediate_stress": stress[:, 1],
        "mean_stress": stress.mean(axis=1),
    }
    ways = [(name, series) for name, all_ in known.effective.items() for series in all_]
    for name, series in ways:
        _require(table, series, expected[name], QUANTITIES[name].title, axial, lateral)
    if known.deviatoric is not None:
        title = "deviatoric stress"
        _require(table, known.deviatoric, stress[:, 0] - stress[:, 2], title, axial, lateral)


def _require(
    table: Table, series: Series, expected: Floats, title: str, axial: Series, lateral: Series
) -> None:
    if agree(series.values, expected):
        return
    row = int(np.abs(series.values - expected).argmax())
    names = " and ".join(dict.fromkeys((axial.name, lateral.name)))
    raise DatasetError(
        f"{table.source}, {table.places[row]}: {series.name} gives "
        f"{_kilopascals(series.values[row])} kPa for the effective {title}, but {names} "
        f"give {_kilopascals(expected[row])}; say what each column is with ",
        column(QUANTITY),
        " or ",
        Setting("stresses"),
        ", or leave out the wrong one with ",
        ignore(HEADER),
    )


def _kilopascals(value: float) -> str:
    return f"{value / 1e3:.6g}"


def _check_compression(table: Table, lateral: Series) -> None:
    least, largest = float(lateral.values.min()), float(np.abs(lateral.values).max())
    if " minus " in lateral.name and least < -max(READING, 0.01 * largest):
        row = int(lateral.values.argmin())
        raise DatasetError(
            f"{table.source}, {table.places[row]}: the effective lateral stress ({lateral.name}) "
            f"is {_kilopascals(least)} kPa, below zero; check the pore pressure, or give ",
            stresses("effective"),
            " if the stresses are effective already",
        )
