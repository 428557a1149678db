"""Columns of a laboratory file as quantities in SI units, compression positive."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.laboratory.quantities import QUANTITIES, known_quantity, listed
from granbench.laboratory.settings import ImportSettings
from granbench.paths.tables import Column, Table
from granbench.plausible import LARGEST_STRAIN, LARGEST_STRESS, VOID_RATIOS
from granbench.units import (
    is_stress_unit,
    known_units,
    split_strange_unit,
    unit_factor,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Measured:
    """One quantity of a file in SI units, compression positive.

    Parameters
    ----------
    header : of the column it comes from
    unit : that it was given in
    values : (row,)
    """

    header: str
    unit: str
    values: Floats


def measured_quantities(table: Table, settings: ImportSettings) -> dict[str, Measured]:
    """The columns that hold a quantity, by its name.

    Parameters
    ----------
    table : columns with known headers, or those that the settings name
    settings : what the user says of columns, units and sign

    Raises
    ------
    DatasetError
        Naming file, column, and row where there is one: a column is missing or given twice, its
        unit is missing, unknown or of another kind, a cell is no number, or a value is as large
        as only a wrong unit makes it.
    """
    chosen = {name: _column(table, name, header) for name, header in settings.columns.items()}
    taken = {id(column) for column in chosen.values()}
    told: dict[str, Column] = {}
    for column in table.columns:
        column, found = _recognised(column)
        if found is None or found in chosen or id(column) in taken:
            continue
        if found in told:
            raise DatasetError(
                f"{table.source}: columns {told[found].header!r} and {column.header!r} both give "
                f"the {QUANTITIES[found].title}; remove one, or rename it"
                + (
                    f", or choose with --column {found}=HEADER"
                    if told[found].header != column.header
                    else ""
                )
            )
        told[found] = column
    return {name: _in_si(table, column, name, settings) for name, column in (chosen | told).items()}


def _recognised(column: Column) -> tuple[Column, str | None]:
    """A column and the quantity that its header names, if any; its unit may be a strange one."""
    if (found := known_quantity(column.name)) or column.unit is not None:
        return column, found
    name, unit = split_strange_unit(column.header) or (column.name, None)
    if found := known_quantity(name):
        return Column(column.header, name, unit, column.cells), found
    return column, None


def _bare(header: str) -> str:
    """A header in lower case without the brackets at its end."""
    name, _ = split_strange_unit(header) or (header, "")
    return name.lower()


def _column(table: Table, quantity: str, header: str) -> Column:
    """The column that the user names for a quantity."""
    wanted = header.strip().lower()
    named = [
        column for column in table.columns if wanted in (column.header.lower(), column.name.lower())
    ]
    listing = listed(column.header for column in table.columns)
    if not named:
        raise DatasetError(
            f"{table.source}: has no column {header!r}; its columns are {listing}: name one of "
            f"them with --column {quantity}=HEADER"
        )
    if len(named) > 1:
        raise DatasetError(
            f"{table.source}: has {len(named)} columns {header!r}; rename one in the file, so that "
            f"--column {quantity}={header} means the other"
        )
    return named[0]


def _in_si(table: Table, column: Column, quantity: str, settings: ImportSettings) -> Measured:
    about = QUANTITIES[quantity]
    unit = settings.unit_of(quantity) or column.unit or ("-" if quantity == "void_ratio" else None)
    what = f"{table.source}: column {column.header!r} ({about.title})"
    example = "kPa" if about.is_stress else "%"
    option = f"--unit {quantity}={example}"
    if unit is None:
        raise DatasetError(
            f"{what} has no unit; write it into the header, as in '{column.name} [{example}]', or "
            f"give it with {option}"
        )
    factor = unit_factor(unit)
    if factor is None:
        raise DatasetError(
            f"{what} is in {unit!r}, which is no unit that is known: use "
            f"{known_units(about.is_stress)}; convert the column, or say what it is in with "
            f"{option}"
        )
    if is_stress_unit(unit) != about.is_stress:
        kind = "stress" if about.is_stress else "ratio"
        raise DatasetError(
            f"{what} is in {unit!r}, which is no unit of a {kind}: use "
            f"{known_units(about.is_stress)}; mend the header, or say what it is in with {option}"
        )
    values = factor * table.numbers(column)
    if settings.tension_positive and quantity != "void_ratio":
        values = values if quantity.startswith("deviatoric") else -values
    measured = Measured(column.header, unit, values)
    _check_size(table, measured, quantity)
    return measured


def _likely_unit(number: float) -> str:
    """The unit in which a stress that is too large would be possible."""
    return "kPa" if 1e3 * number <= LARGEST_STRESS else "Pa"


def _check_size(table: Table, measured: Measured, quantity: str) -> None:
    """Refuse what only a wrong unit explains."""
    sizes = np.abs(measured.values)
    row, largest = int(sizes.argmax()), float(sizes.max())
    where = f"{table.source}, {table.places[row]}: column {measured.header!r}"
    shown = f"{largest / (unit_factor(measured.unit) or 1.0):g} {measured.unit}"
    if QUANTITIES[quantity].is_stress:
        if largest > LARGEST_STRESS:
            raise DatasetError(
                f"{where} holds {shown}, which is suspicious: no laboratory reaches "
                f"{LARGEST_STRESS / 1e9:g} GPa; mend the cell, or give the unit with --unit "
                f"{quantity}={_likely_unit(largest / (unit_factor(measured.unit) or 1.0))}"
            )
    elif quantity == "void_ratio":
        low, high = VOID_RATIOS
        bad = (measured.values < low) | (measured.values > high)
        if bad.any():
            row = int(bad.argmax())
            likely = "%" if measured.values[row] > high else "-"
            raise DatasetError(
                f"{table.source}, {table.places[row]}: column {measured.header!r} gives a void "
                f"ratio of {measured.values[row]:g}, which is suspicious; mend the cell"
                + (
                    f", or give the unit with --unit void_ratio={likely}"
                    if likely != measured.unit
                    else ""
                )
            )
    elif largest >= LARGEST_STRAIN:
        raise DatasetError(
            f"{where} holds {shown}, a strain of {100.0 * largest:g} %, which is suspicious; mend "
            f"the cell or, if the column is in %, say so with --unit {quantity}=%"
        )
