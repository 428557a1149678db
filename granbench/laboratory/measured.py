"""Columns of a laboratory file as quantities in SI units, compression positive."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.laboratory.headers import is_bookkeeping, known_quantity, plain_header
from granbench.laboratory.quantities import QUANTITIES, WATER, listed, stress_of
from granbench.laboratory.remarks import quantity_with_remark
from granbench.laboratory.remedies import QUANTITY, ignore
from granbench.laboratory.remedies import column as column_is
from granbench.laboratory.remedies import unit as unit_is
from granbench.laboratory.settings import ImportSettings
from granbench.tables.tables import Column, Table
from granbench.units.known_units import (
    is_stress_unit,
    is_unit,
    known_units,
    split_unknown_unit,
    text_behind_unit,
    unit_factor,
)
from granbench.units.plausible import LARGEST_STRAIN, LARGEST_STRESS, VOID_RATIOS

Floats = NDArray[np.float64]

MEASURED_IN_PERCENT = ("humidity", "battery")
COUNTS = frozenset({"-", "–", "—", "−", "1", "atm"})
"""Words that are units, but also stand in headers of columns that hold counts."""


@dataclass(frozen=True)
class Measured:
    """One quantity of a file in SI units, compression positive.

    Parameters
    ----------
    header : of the column it comes from
    unit : of the file
    values : (row,)
    confirmed : whether the user gave the unit
    """

    header: str
    unit: str
    values: Floats
    confirmed: bool = False


@dataclass(frozen=True)
class Columns:
    """The columns of a file, by their use.

    Parameters
    ----------
    quantities : measured quantities by name
    bookkeeping : headers of columns without stress or strain, such as times
    ignored : headers of columns that the user left out
    notes : where the given unit differs from that of the header, one sentence each
    """

    quantities: dict[str, Measured]
    bookkeeping: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def measured_quantities(table: Table, settings: ImportSettings) -> Columns:
    """The quantity of each column of a table.

    Parameters
    ----------
    table : columns with known headers, or headers that the settings name
    settings : of the import: columns, units and sign

    Raises
    ------
    DatasetError
        Naming file, column, and row where there is one: a column is missing, given twice or
        unknown, its unit is missing, unknown or of another kind, a cell is not a number, or a value
        is so large that the unit must be wrong.
    """
    chosen = {name: _column(table, name, header) for name, header in settings.columns.items()}
    taken = {id(column) for column in chosen.values()}
    left_out = {header.strip().lower() for header in settings.ignore}
    recognised: dict[str, Column] = {}
    bookkeeping: list[str] = []
    ignored: list[str] = []
    unknown: list[str] = []
    for column in table.columns:
        if id(column) in taken or not _holds_anything(column):
            continue
        if left_out & {column.header.lower(), column.name.lower()}:
            ignored.append(column.header)
            continue
        column, found = _recognised(column)
        if found is None:
            passed_over = is_bookkeeping(column.header) and not _states_a_measure(column.header)
            (bookkeeping if passed_over else unknown).append(column.header)
        elif found in recognised:
            raise _given_twice(table, recognised[found], column, found)
        elif found not in chosen:
            recognised[found] = column
        else:
            ignored.append(column.header)
    if unknown:
        raise _unknown(table, unknown)
    columns = chosen | recognised
    quantities = {name: _in_si(table, column, name, settings) for name, column in columns.items()}
    notes = [
        f"column {column.header!r} is read in {quantities[name].unit}, as given, and not in "
        f"{column.unit}"
        for name, column in columns.items()
        if column.unit is not None
        and unit_factor(column.unit) is not None
        and unit_factor(column.unit) != unit_factor(quantities[name].unit)
    ]
    return Columns(quantities, tuple(bookkeeping), tuple(ignored), tuple(notes))


def _holds_anything(column: Column) -> bool:
    return any(cell is not None and str(cell).strip() for cell in column.cells)


def _given_twice(table: Table, one: Column, other: Column, quantity: str) -> DatasetError:
    choose = (", or choose with ", column_is(quantity))
    return DatasetError(
        f"{table.source}: columns {one.header!r} and {other.header!r} both give the "
        f"{QUANTITIES[quantity].title}; remove one, or rename it",
        *(choose if one.header != other.header else ()),
    )


def _unknown(table: Table, headers: list[str]) -> DatasetError:
    several = len(headers) > 1
    return DatasetError(
        f"{table.source}: {'columns' if several else 'column'} {listed(headers)} "
        f"{'are' if several else 'is'} not known; say what {'each' if several else 'it'} holds "
        "with ",
        column_is(QUANTITY),
        f", where QUANTITY is one of {', '.join(QUANTITIES)}, or leave "
        f"{'them' if several else 'it'} out with ",
        ignore(*headers),
    )


def _states_a_measure(header: str) -> bool:
    """Whether a header states a unit of stress or strain, unlike row numbers and times."""
    if plain_header(header).startswith(MEASURED_IN_PERCENT):
        return False
    words = re.findall(r"[^\s\[\](){},;]+", header)
    words += [word.rpartition("/")[2] for word in words if "/" in word]
    return any(unit_factor(word) is not None for word in words if word not in COUNTS)


def _is_of_another_dimension(unit: str | None, is_stress: bool) -> bool:
    """Whether a header states a known unit that a stress, or a ratio, cannot have."""
    if unit is None or not is_unit(unit):
        return False
    return unit_factor(unit) is None or is_stress_unit(unit) != is_stress


def _recognised(column: Column) -> tuple[Column, str | None]:
    """A column and the quantity that its header names, if any; its unit may be unknown.

    `Sr` is a lateral stress only where a unit of stress is stated; it mostly is the degree of
    saturation.
    """
    column, found = _named_quantity(column)
    if found is None:
        return column, None
    if plain_header(column.name) == "sr" and not (column.unit and is_stress_unit(column.unit)):
        return column, None
    return column, found


def _named_quantity(column: Column) -> tuple[Column, str | None]:
    """A column, with its unit even if that is unknown, and the quantity of its header."""
    if column.unit is not None and (behind := text_behind_unit(column.header)):
        return column, quantity_with_remark(column.name, behind, column.unit)
    if (found := known_quantity(column.name)) or column.unit is not None:
        return column, found
    name, unit = split_unknown_unit(column.header) or (column.name, None)
    if found := known_quantity(name):
        return Column(column.header, name, unit, column.cells), found
    return column, None


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
            "them with ",
            column_is(quantity),
        )
    if len(named) > 1:
        raise DatasetError(
            f"{table.source}: has {len(named)} columns {header!r}; rename one in the file, so "
            "that ",
            column_is(quantity, header),
            " means the other",
        )
    return named[0]


def _in_si(table: Table, column: Column, quantity: str, settings: ImportSettings) -> Measured:
    about = QUANTITIES[quantity]
    given = settings.unit_of(quantity)
    if not {quantity, stress_of(quantity)} & set(settings.units) and _is_of_another_dimension(
        column.unit, about.is_stress
    ):
        given = None  # a unit for all stresses, or all strains, is not meant for this column
    unitless = quantity in ("void_ratio", "stress_ratio")
    unit = given or column.unit or ("-" if unitless else None)
    what = f"{table.source}: column {column.header!r} ({about.title})"
    example = "kPa" if about.is_stress else "%"
    remedy = unit_is(stress_of(quantity), example)
    if unit is None:
        raise DatasetError(
            f"{what} has no unit; write it into the header, as in '{column.name} [{example}]', or "
            "give it with ",
            remedy,
        )
    factor = unit_factor(unit)
    if factor is None:
        raise DatasetError(
            f"{what} is in {unit!r}, which is not a known unit: use "
            f"{known_units(about.is_stress)}; convert the column, give its unit with ",
            remedy,
            ", or leave it out with ",
            ignore(column.header),
        )
    if is_stress_unit(unit) != about.is_stress:
        kind = "stress" if about.is_stress else "ratio"
        raise DatasetError(
            f"{what} is in {unit!r}, which is not a unit of a {kind}: use "
            f"{known_units(about.is_stress)}; fix the header, give its unit with ",
            remedy,
            ", or leave the column out with ",
            ignore(column.header),
        )
    values = factor * table.numbers(column)
    if settings.tension_positive and not unitless:
        values = _compression_positive(quantity, values)
    measured = Measured(column.header, unit, values, given is not None)
    _check_size(table, measured, quantity)
    return measured


def _compression_positive(quantity: str, values: Floats) -> Floats:
    """Values of a file with tension positive, converted to compression positive.

    Deviatoric invariants have no such sign, and water pressures are mostly positive in such files.
    """
    if quantity.startswith("deviatoric"):
        return values
    if quantity in WATER or quantity == "cell_pressure":
        return values if values.sum() >= 0.0 else -values
    return -values


def _likely_unit(number: float) -> str:
    """The unit in which a stress that is too large would be possible."""
    return "kPa" if 1e3 * number <= LARGEST_STRESS else "Pa"


def _check_size(table: Table, measured: Measured, quantity: str) -> None:
    """Refuse values that are only possible in another unit."""
    sizes = np.abs(measured.values)
    row, largest = int(sizes.argmax()), float(sizes.max())
    where = f"{table.source}, {table.places[row]}: column {measured.header!r}"
    shown = f"{largest / (unit_factor(measured.unit) or 1.0):g} {measured.unit}"
    name = stress_of(quantity)
    if QUANTITIES[quantity].is_stress:
        if largest > LARGEST_STRESS:
            raise DatasetError(
                f"{where} holds {shown}, which is suspicious: no laboratory reaches "
                f"{LARGEST_STRESS / 1e9:g} GPa; fix the cell, or give the unit with ",
                unit_is(name, _likely_unit(largest / (unit_factor(measured.unit) or 1.0))),
            )
    elif quantity == "void_ratio":
        low, high = VOID_RATIOS
        bad = (measured.values < low) | (measured.values > high)
        if bad.any():
            row = int(bad.argmax())
            likely = "%" if measured.values[row] > high else "-"
            raise DatasetError(
                f"{table.source}, {table.places[row]}: column {measured.header!r} gives a void "
                f"ratio of {measured.values[row]:g}, which is suspicious; fix the cell",
                *(
                    (", or give the unit with ", unit_is("void_ratio", likely))
                    if likely != measured.unit
                    else ()
                ),
            )
    elif quantity != "stress_ratio" and largest >= LARGEST_STRAIN:
        raise DatasetError(
            f"{where} holds {shown}, a strain of {100.0 * largest:g} %, which is suspicious; "
            "fix the cell or, if the column is in %, give ",
            unit_is(name, "%"),
        )
