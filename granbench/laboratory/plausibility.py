"""Questions about stresses and strains that are only plausible in another unit or sign."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError, Setting
from granbench.laboratory.laboratory_test import LATERAL_STRAIN_GIVEN
from granbench.laboratory.measured import Measured
from granbench.laboratory.quantities import QUANTITIES
from granbench.laboratory.remedies import unit
from granbench.tables.tables import Table
from granbench.units.known_units import unit_factor

Floats = NDArray[np.float64]

LEAST_LARGEST_STRESS = 1e4
"""Pa; tests in which no stress reaches 10 kPa are rarer than stresses in another unit."""

GREATEST_FIRST_STRESS = 5e7
"""Pa; tests rarely start above 50 MPa."""

LEAST_LARGEST_STRAIN = 4e-3
"""A strain in % that stays below 0.4 % may be a ratio; tests to failure go to some per cent."""

GREATEST_RATIO = 0.5
"""A strain that is given as a ratio and passes 0.5 may be in %."""

ISOTROPIC_START = 0.1
"""Share of its largest value below which q is zero at the start."""


def check_units(
    table: Table, measured: Mapping[str, Measured], stress: Floats, strain: Floats, kind: str
) -> None:
    """Ask about implausible units, unless the settings give them.

    Raises
    ------
    DatasetError
        Naming the column, its unit, and the unit that would be usual.
    """
    stresses = {name: m for name, m in measured.items() if QUANTITIES[name].is_stress}
    open_stresses = [m for m in stresses.values() if not m.confirmed]
    if open_stresses:
        column = open_stresses[0]
        largest, first = float(np.nanmax(np.abs(stress))), float(np.abs(stress[0]).max())
        if largest < LEAST_LARGEST_STRESS:
            raise _unit_question(
                table, column, f"no stress above {largest:.3g} Pa", "stress", larger=True
            )
        if first > GREATEST_FIRST_STRESS:
            what = f"a first stress of {first / 1e6:.6g} MPa"
            raise _unit_question(table, column, what, "stress", larger=False)
    axial = measured.get("axial_strain")
    if axial is None or axial.confirmed:
        return
    largest = float(np.abs(strain[:, 0]).max())
    percent = unit_factor(axial.unit) == 0.01
    if percent and largest < LEAST_LARGEST_STRAIN and kind not in LATERAL_STRAIN_GIVEN[1:]:
        raise DatasetError(
            f"{table.source}: column {axial.header!r} stays below {100.0 * largest:.3g} %, which "
            "is suspicious; give the unit with ",
            unit("strain", "-"),
            " if these are ratios, or ",
            unit("strain", "%"),
            " if they are per cent",
        )
    largest = float(np.ptp(axial.values))
    if not percent and largest > GREATEST_RATIO:
        raise DatasetError(
            f"{table.source}: column {axial.header!r} reaches {largest:.3g}, a strain of "
            f"{100.0 * largest:.3g} %, which is suspicious; give the unit with ",
            unit("strain", "%"),
            " if these are per cent, or ",
            unit("strain", "-"),
            " if they are ratios",
        )


def _unit_question(
    table: Table, column: Measured, what: str, group: str, *, larger: bool
) -> DatasetError:
    factor = unit_factor(column.unit) or 1.0
    too_small, too_large = ("kPa" if factor < 1e3 else "MPa"), ("kPa" if factor > 1e3 else "Pa")
    likely = too_small if larger else too_large
    return DatasetError(
        f"{table.source}: column {column.header!r} and the others give {what}, which is "
        "suspicious; give the unit with ",
        unit(group, likely),
        ", or confirm it with ",
        unit(group, column.unit),
    )


def check_signs(
    table: Table, measured: Mapping[str, Measured], stress: Floats, strain: Floats
) -> None:
    """Ask if the specimen seems to lengthen under increasing axial stress.

    A test that starts isotropic does positive work: q and the axial strain have the same sign.

    Raises
    ------
    DatasetError
        Naming the column of the axial strain.
    """
    q = stress[:, 0] - stress[:, 2]
    largest = float(np.abs(q).max())
    if not largest > 0.0 or abs(q[0]) > ISOTROPIC_START * largest:
        return
    # The first stretch, up to half of the largest q, is loading in any test.
    begin = int(np.argmax(np.abs(q) >= 0.5 * largest)) + 1
    work = float(np.trapezoid(q[:begin], strain[:begin, 0]))
    size = float(np.abs(np.diff(strain[:begin, 0])).sum()) * largest
    if work < -0.05 * size and "axial_strain" in measured:
        header = measured["axial_strain"].header
        raise DatasetError(
            f"{table.source}: column {header!r} and the deviatoric stress have opposite signs, so "
            "the specimen would lengthen under compression; make compression positive in both: "
            "change the sign of the column in which it is negative, or give ",
            Setting("tension_positive", True),
            " if tension is positive in all strains and stresses",
        )
