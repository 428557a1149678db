"""Interpretation of a table of columns as a laboratory test."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError, Setting
from granbench.laboratory.effective import effective_stresses
from granbench.laboratory.kind_of_test import (
    check_drainage,
    kind_by_columns,
    kind_by_format,
    kind_by_numbers,
)
from granbench.laboratory.laboratory_test import (
    FEWEST_POINTS,
    LATERAL_STRAIN_GIVEN,
    Interpretation,
    LaboratoryTest,
    apparent_kind,
)
from granbench.laboratory.measured import Columns, Measured, measured_quantities
from granbench.laboratory.one_test import check_one_test
from granbench.laboratory.plausibility import check_signs, check_units
from granbench.laboratory.preamble import refuse_unanswered_lines, refuse_undrained_lines
from granbench.laboratory.principal_strain import principal_strain, volume_measured
from granbench.laboratory.principal_stress import principal_stress
from granbench.laboratory.remedies import ignore
from granbench.laboratory.settings import ImportSettings
from granbench.laboratory.stress_series import KnownStresses
from granbench.tables.tables import Table

Floats = NDArray[np.float64]


SAME_VOID_RATIO = 5e-3

DRAINAGE: Mapping[str, str] = {
    "triaxial-undrained": "undrained, the volume does not change",
    "triaxial-drained": "drained, the effective lateral stress is held",
    "constant-p": "drained, the mean stress is held",
    "uniaxial": "no lateral stress",
    "oedometer": "drained, no lateral strain",
    "isotropic": "drained, no shear",
    "strain": "as measured, strain by strain",
}


def laboratory_test_from(
    table: Table, settings: ImportSettings, name: str, kind: str | None = None
) -> LaboratoryTest:
    """The laboratory test in a table.

    Parameters
    ----------
    table : columns with known headers, or headers that the settings name
    settings : of the import; its kind takes precedence over the one given here
    name : of the test
    kind : what was controlled, according to the format of the file

    Raises
    ------
    DatasetError
        Naming file, row and column: a column is missing, unknown or has no unit, a cell is not a
        number, a stress may be total or effective, columns contradict each other, the kind of test
        or a setting, a stress or a strain is in the wrong unit or of the wrong sign, there are
        fewer than five rows, a second test begins, the test does not start under compression, or
        the axial strain of a monotonic test falls.
    """
    columns = measured_quantities(table, settings)
    measured = columns.quantities
    if len(table.places) < FEWEST_POINTS:
        raise DatasetError(
            f"{table.source}: has {len(table.places)} rows of numbers, but a test needs "
            f"{FEWEST_POINTS}; give the whole record"
        )
    refuse_unanswered_lines(table, measured, settings)
    known = effective_stresses(table, measured, settings)
    by_file, reason = kind_by_columns(table, known, measured, settings)
    # The numbers take precedence over what the format of the file says.
    chosen = settings.kind or by_file or kind_by_format(kind, known, measured)
    stress = principal_stress(table, known, settings, chosen)
    strain = principal_strain(table, measured, settings, chosen)
    found = chosen or apparent_kind(strain, stress)
    if chosen is None:
        reason = "from the strains and stresses"
    elif settings.kind is not None:
        reason = "as given"
    elif by_file is None:
        reason = "by the format of the file"
    if settings.kind is None:
        found = kind_by_numbers(found, strain, stress)
    refuse_undrained_lines(found, table, settings)
    check_drainage(table, known, measured, settings, found, strain, stress)
    _check_start(table, stress, found, settings)
    _check_monotonic(table, measured, strain[:, 0], settings.monotonic)
    check_one_test(table, strain[:, 0])
    check_units(table, measured, stress, strain, found)
    check_signs(table, measured, stress, strain)
    return LaboratoryTest(
        name,
        table.source,
        found,
        strain,
        stress,
        _void_ratio(table, measured, settings, strain),
        _interpretation(columns, known, settings, found, reason, strain, stress),
    )


def _void_ratio(
    table: Table, measured: dict[str, Measured], settings: ImportSettings, strain: Floats
) -> Floats | None:
    given = settings.initial_void_ratio
    if "void_ratio" in measured:
        column = measured["void_ratio"]
        if given is not None and abs(given - column.values[0]) > SAME_VOID_RATIO:
            raise DatasetError(
                f"{table.source}: column {column.header!r} begins with a void ratio of "
                f"{column.values[0]:g}, but ",
                Setting("initial_void_ratio"),
                f" gives {given:g}; leave out the setting, or the column with ",
                ignore(column.header),
            )
        return column.values
    if given is None:
        return None
    # The volume of the grains is constant: 1 + e decreases with the volume of the specimen.
    known = np.isfinite(strain).all()
    volume = np.exp(-strain.sum(axis=1)) if known else np.ones(len(strain))
    return (1.0 + given) * volume - 1.0


def _interpretation(
    columns: Columns,
    known: KnownStresses,
    settings: ImportSettings,
    kind: str,
    reason: str,
    strain: Floats,
    stress: Floats,
) -> Interpretation:
    notes = list(columns.notes)
    if not volume_measured(columns.quantities) and kind in LATERAL_STRAIN_GIVEN:
        notes.append(f"the lateral strain follows from the kind of test, {kind}")
    if not np.isfinite(stress).all():
        notes.append(
            f"the lateral stress was not measured: at the start it is taken as K0 = "
            f"{settings.k0:g} times the axial stress, and the axial strain is compared at the "
            "measured axial stress"
        )
    if settings.lateral_stress is not None:
        notes.append(
            f"a constant effective lateral stress of {settings.lateral_stress:g} Pa is given"
        )
    if settings.tension_positive:
        notes.append("tension is taken as positive in the file")
    return Interpretation(
        kind=reason,
        drainage=DRAINAGE[kind],
        stresses=known.statement,
        strain_measure=settings.strain_measure,
        not_used=(*columns.bookkeeping, *columns.ignored),
        notes=tuple(notes),
    )


def _check_monotonic(
    table: Table, measured: dict[str, Measured], axial: Floats, monotonic: bool
) -> None:
    if monotonic and (falls := np.diff(axial) < 0.0).any():
        row = int(falls.argmax()) + 1
        header = measured["axial_strain"].header if "axial_strain" in measured else "axial strain"
        raise DatasetError(
            f"{table.source}, {table.places[row]}: column {header!r}: the axial strain falls from "
            f"{axial[row - 1]:.6g} to {axial[row]:.6g}, but the test is monotonic; sort the rows "
            "or leave out ",
            Setting("monotonic"),
        )


def _check_start(table: Table, stress: Floats, kind: str, settings: ImportSettings) -> None:
    pressure = float(stress[0].mean())
    if pressure > 0.0 or (pressure == 0.0 and kind in ("uniaxial", "strain")):
        return
    tension_positive = Setting("tension_positive", True)
    remedy = (
        ("leave out ", tension_positive, " if compression is positive in the file")
        if settings.tension_positive
        else ("if tension is positive in the file, give ", tension_positive)
    )
    raise DatasetError(
        f"{table.source}, {table.places[0]}: the mean stress is {pressure:g} Pa, but a test "
        "starts under compression (p0 > 0); remove the rows before it or, ",
        *remedy,
    )
