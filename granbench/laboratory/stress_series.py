"""Stresses of a test with their origin, and the lateral stress that some of them imply."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granbench.laboratory.measured import Measured
from granbench.laboratory.water import Water

Floats = NDArray[np.float64]

BASES = ("radial_stress", "axial_stress", "mean_stress", "intermediate_stress")
"""Quantities that may be effective or total stresses."""


@dataclass(frozen=True)
class Series:
    """A stress and where it comes from.

    Parameters
    ----------
    name : column, setting, or the stresses it follows from, for messages
    values : (row,), Pa
    header : of the column, None if it is not one column
    """

    name: str
    values: Floats
    header: str | None = None

    @classmethod
    def of_column(cls, column: Measured) -> "Series":
        """The stress that a column gives."""
        return cls(repr(column.header), column.values, column.header)

    def minus(self, water: Water) -> "Series":
        """The effective stress that belongs to a total one."""
        assert water.absolute is not None
        return Series(f"{self.name} minus {water.name}", self.values - water.absolute)


Stresses = dict[str, Series]
"""Stresses by the name of the quantity, without `effective` or `total`."""


@dataclass(frozen=True)
class KnownStresses:
    """The effective stresses of a file.

    Parameters
    ----------
    effective : by quantity, every series that gives it
    deviatoric : axial minus lateral stress, where the file has it
    statement : how the effective stresses were obtained, for the user
    assumed : whether they are only taken as effective because the file has no pore pressure
    water : the pore pressure
    """

    effective: Mapping[str, list[Series]]
    deviatoric: Series | None
    statement: str
    assumed: bool
    water: Water


def names_of(stresses: Stresses) -> str:
    """The names of stresses as a list, for messages."""
    return ", ".join(series.name for series in stresses.values())


def implied_lateral(
    stresses: Stresses, deviatoric: Series | None
) -> tuple[Series, tuple[str, ...]] | None:
    """The lateral stress that stresses of one state imply, and the quantities it follows from.

    Parameters
    ----------
    stresses : all effective or all total
    deviatoric : axial minus lateral stress, None if it is not known

    Returns
    -------
    None if no lateral stress follows
    """
    radial, axial, mean = (
        stresses.get(name) for name in ("radial_stress", "axial_stress", "mean_stress")
    )
    if radial is not None:
        return radial, ("radial_stress",)
    if mean is not None and deviatoric is not None:
        values = mean.values - deviatoric.values / 3.0
        return Series(f"{mean.name} and {deviatoric.name}", values), ("mean_stress",)
    if axial is not None and deviatoric is not None:
        values = axial.values - deviatoric.values
        return Series(f"{axial.name} and {deviatoric.name}", values), ("axial_stress",)
    if axial is not None and mean is not None:
        values = (3.0 * mean.values - axial.values) / 2.0
        return Series(f"{axial.name} and {mean.name}", values), ("axial_stress", "mean_stress")
    return None
