"""The pore pressure of a test, from the columns of its file and the given settings."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError, Setting
from granbench.laboratory.measured import Measured
from granbench.laboratory.remedies import ignore, pressure
from granbench.laboratory.settings import ImportSettings

Floats = NDArray[np.float64]

AGREEMENT = 0.03
"""Difference of two values of one stress, as a share of the largest, that rounding and the scatter
of transducers explain."""

READING = 1e3
"""Pa; pressures are read to about 1 kPa."""

LEAST_BACK_PRESSURE, SHARE_OF_CELL = 1e4, 0.05
"""Pa, and share of the cell pressure, below which no specimen is saturated: a column that begins
there may be the first reading of an excess over the back pressure."""


@dataclass(frozen=True)
class Water:
    """The known part of the pore pressure.

    Parameters
    ----------
    absolute : (row,), Pa, from the same zero as the total stresses; None if it is not known
    change : (row,), Pa, above its first value; None if no pore pressure was measured
    name : of the column or the setting it comes from; empty if there is none
    question : parts of an error text: what must be known before total stresses can be converted
        to effective ones; empty if nothing is missing
    """

    absolute: Floats | None = None
    change: Floats | None = None
    name: str = ""
    question: tuple[str | Setting, ...] = ()

    @property
    def largest_change(self) -> float | None:
        """Range of the measured pore pressure, Pa; None where it was not measured."""
        return None if self.change is None else float(np.ptp(self.change))


def agree(one: Floats, other: Floats) -> bool:
    """Whether two series (row,) of a stress, Pa, are the same but for scatter."""
    largest = max(float(np.abs(one).max()), float(np.abs(other).max()))
    return bool(np.abs(one - other).max() <= AGREEMENT * largest + READING)


def pore_pressure(
    source: str, measured: dict[str, Measured], settings: ImportSettings, rows: int
) -> Water:
    """The pore pressure of a test.

    Parameters
    ----------
    source : file, for error texts
    measured : columns by quantity
    settings : of the import, with a constant back pressure if one is given
    rows : number of rows of the file

    Raises
    ------
    DatasetError
        Naming both, if two columns, or a column and a setting, contradict each other.
    """
    absolute, excess = measured.get("pore_pressure"), measured.get("excess_pore_pressure")
    back, back_name = _back_pressure(source, measured, settings, rows)
    if absolute is not None and excess is not None:
        changes = (m.values - m.values[0] for m in (absolute, excess))
        if not agree(*changes):
            raise DatasetError(
                f"{source}: columns {absolute.header!r} and {excess.header!r} contradict each "
                "other: the excess is not the change of the pore pressure; leave out the wrong one "
                "with ",
                ignore(excess.header),
                " or ",
                ignore(absolute.header),
            )
    if absolute is not None:
        least = _least_clear(measured, settings)
        return _absolute(source, absolute, back, back_name, least)
    if excess is not None:
        change = excess.values - excess.values[0]
        if back is not None:
            name = f"{back_name} plus {excess.header!r}"
            return Water(back[0] + excess.values, change, name)
        question = (
            f"column {excess.header!r} is an excess over a back pressure that the file does not "
            "give; give it with ",
            pressure("back_pressure"),
            " (0 if the total stresses are counted from the back pressure)",
        )
        return Water(None, change, repr(excess.header), question)
    if back is not None:
        return Water(back, None, back_name)
    return Water()


def _back_pressure(
    source: str, measured: dict[str, Measured], settings: ImportSettings, rows: int
) -> tuple[Floats | None, str]:
    column, given = measured.get("back_pressure"), settings.back_pressure
    if column is not None:
        if given is not None and not agree(column.values, np.full(rows, given)):
            raise DatasetError(
                f"{source}: column {column.header!r} begins with {column.values[0]:g} Pa, but ",
                Setting("back_pressure"),
                f" gives {given:g} Pa; leave out the setting, or the column with ",
                ignore(column.header),
            )
        return column.values, repr(column.header)
    if given is not None:
        return np.full(rows, given), f"the given back pressure of {given:g} Pa"
    return None, ""


def _least_clear(measured: dict[str, Measured], settings: ImportSettings) -> float:
    """Pa; a pore pressure that begins below it may be the first reading of an excess."""
    names = ("cell_pressure", "total_radial_stress", "radial_stress")
    sizes = [float(np.abs(measured[name].values).max()) for name in names if name in measured]
    # At their first row they are the cell pressure, or near it.
    others = ("axial_stress", "total_axial_stress", "mean_stress", "total_mean_stress")
    sizes += [float(abs(measured[name].values[0])) for name in others if name in measured]
    return max(LEAST_BACK_PRESSURE, SHARE_OF_CELL * max([*sizes, settings.cell_pressure or 0.0]))


def _absolute(
    source: str, column: Measured, back: Floats | None, back_name: str, least: float
) -> Water:
    """A column of pore pressure, which starts at the back pressure or was set to zero there."""
    values, header = column.values, column.header
    change = values - values[0]
    is_zero = abs(values[0]) <= READING + 0.01 * np.abs(values).max()
    if not is_zero and (abs(values[0]) >= least or "total" in header.lower()):
        if back is not None and not agree(values[:1], back[:1]):
            raise _other_start(source, column, back, back_name)
        return Water(values, change, repr(header))
    if back is not None and not is_zero and back[0] <= READING:
        return Water(values, change, repr(header))
    if back is not None and not is_zero and back[0] < least:
        if agree(values[:1], back[:1]):
            return Water(values, change, repr(header))
        raise _other_start(source, column, back, back_name)
    if back is not None:
        # Zero at a back pressure above zero: the column is the excess, whatever its name.
        name = f"{back_name} plus {header!r}" if back[0] > READING else repr(header)
        return Water(back[0] + values, change, name)
    question = (
        f"column {header!r} begins with {values[0]:g} Pa, which is "
        "either a pore pressure without a back pressure "
        "or the excess over one; give the back pressure with ",
        pressure("back_pressure"),
        " (0 if there was none, or if the total stresses are counted from it)",
    )
    return Water(None, change, repr(header), question)


def _other_start(source: str, column: Measured, back: Floats, back_name: str) -> DatasetError:
    return DatasetError(
        f"{source}: column {column.header!r} begins with {column.values[0]:g} Pa, but {back_name} "
        f"begins with {back[0]:g} Pa; a test starts at its back pressure: fix one of them, or "
        "leave out ",
        Setting("back_pressure"),
    )
