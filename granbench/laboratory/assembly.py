"""From a table of columns to a laboratory test: what is derived, assumed and checked."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.laboratory.effective import KnownStresses, effective_stresses
from granbench.laboratory.laboratory_test import (
    CONSTANT_STRESS,
    FEWEST_POINTS,
    HELD_LATERAL_STRESS,
    LATERAL_STRAIN_GIVEN,
    NO_STRAIN,
    Interpretation,
    LaboratoryTest,
    apparent_kind,
)
from granbench.laboratory.measured import Columns, Measured, measured_quantities
from granbench.laboratory.one_test import check_one_test
from granbench.laboratory.plausibility import check_signs, check_units
from granbench.laboratory.preamble import refuse_undrained_as, refuse_unsettled_lines
from granbench.laboratory.principal_strain import principal_strain, volume_measured
from granbench.laboratory.principal_stress import principal_stress
from granbench.laboratory.quantities import plain_header
from granbench.laboratory.settings import ImportSettings
from granbench.tables.tables import Table

Floats = NDArray[np.float64]

NO_CHANGE = 0.01
"""Change of the pore pressure, as a share of the first mean stress, below which it was constant."""

SAME_VOID_RATIO = 5e-3
STAGES = frozenset({"stage", "stages", "stageno", "stagenumber", "stagename", "phase"})

DRAINAGE: Mapping[str, str] = {
    "triaxial-undrained": "undrained, the volume does not change",
    "triaxial-drained": "drained, the effective lateral stress is held",
    "constant-p": "drained, the mean stress is held",
    "uniaxial": "no lateral stress",
    "oedometer": "drained, no lateral strain",
    "isotropic": "drained, no shear",
    "strain": "as measured, strain by strain",
}


def assemble(
    table: Table, settings: ImportSettings, name: str, kind: str | None = None
) -> LaboratoryTest:
    """The test that a table holds.

    Parameters
    ----------
    table : columns with known headers, or those that the settings name
    settings : what the user says; its kind goes before the one given here
    name : of the test
    kind : what the format says was controlled

    Raises
    ------
    DatasetError
        Naming file, row and column: a column is missing, unknown or has no unit, a cell is no
        number, a stress may be total or effective, columns contradict each other, the kind of test
        or an option, a stress or a strain is in the wrong unit or of the wrong sign, there are
        fewer than five rows, the rows begin again, the test does not start under compression, its
        axial strain falls though it is monotonic.
    """
    columns = measured_quantities(table, settings)
    measured = columns.quantities
    if len(table.places) < FEWEST_POINTS:
        raise DatasetError(
            f"{table.source}: has {len(table.places)} rows of numbers, but a test needs "
            f"{FEWEST_POINTS}; give the whole record"
        )
    refuse_unsettled_lines(table, measured, settings)
    known = effective_stresses(table, measured, settings)
    by_file, reason = _recognised_kind(table, known, measured, settings)
    # What the numbers themselves rule out does not stand because of a format's name.
    chosen = settings.kind or by_file or _kind_of_format(kind, known, measured)
    stress = principal_stress(table, known, settings, chosen)
    strain = principal_strain(table, measured, settings, chosen)
    found = chosen or apparent_kind(strain, stress)
    if chosen is None:
        reason = "from the strains and stresses"
    elif settings.kind is not None:
        reason = "given with --kind"
    elif by_file is None:
        reason = "by the format of the file"
    if settings.kind is None:
        found = _not_against_the_numbers(found, strain, stress)
    refuse_undrained_as(found, table, settings)
    _check_volume_and_drainage(table, known, measured, settings, found, strain, stress)
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


def _recognised_kind(
    table: Table, known: KnownStresses, measured: dict[str, Measured], settings: ImportSettings
) -> tuple[str | None, str]:
    """The kind that pore pressure or the columns tell before the strains are known, and why."""
    if settings.kind is not None:
        return None, ""
    lateral = {"radial_stress", "mean_stress"} & set(known.effective)
    if not lateral and known.deviatoric is None and settings.lateral_stress is None:
        if "axial_stress" in known.effective and _sides_did_not_move(measured, settings):
            return "oedometer", "for the axial strain is all of the volume change"
        return None, ""
    change = known.water.largest_change
    if volume_measured(measured) or change is None or not known.effective:
        return None, ""
    scale = max(float(np.abs(s.values[0])) for ways in known.effective.values() for s in ways)
    if change > CONSTANT_STRESS * scale:
        reason = f"because {known.water.name} changes and no volume was measured"
        return "triaxial-undrained", reason
    if change <= NO_CHANGE * scale:
        return None, ""
    raise DatasetError(
        f"{table.source}: was the test drained? {known.water.name} changes by {change:g} Pa, and "
        "no column gives a volume; say --kind triaxial-undrained or --kind triaxial-drained"
    )


def _sides_did_not_move(measured: dict[str, Measured], settings: ImportSettings) -> bool:
    """Whether axial strain and volume, both measured, are the same."""
    axial, volume = measured.get("axial_strain"), measured.get("volumetric_strain")
    ratio = measured.get("void_ratio")
    if axial is None or (volume is None and ratio is None):
        return False
    strain = axial.values - axial.values[0]
    if volume is not None:
        other = volume.values - volume.values[0]
    else:
        assert ratio is not None
        specific = (1.0 + ratio.values) / (1.0 + ratio.values[0])
        logarithmic = settings.strain_measure == "logarithmic"
        other = -np.log(specific) if logarithmic else 1.0 - specific
    return bool(np.abs(other - strain).max() <= 0.05 * np.abs(strain).max() + 1e-3)


def _kind_of_format(
    kind: str | None, known: KnownStresses, measured: dict[str, Measured]
) -> str | None:
    undrained = kind in HELD_LATERAL_STRESS and not volume_measured(measured)
    change = known.water.largest_change
    return None if undrained and change is not None and change > 0.0 else kind


def _not_against_the_numbers(kind: str, strain: Floats, stress: Floats) -> str:
    """The kind, or what strains that were measured say where a format's name is against them."""
    if kind in HELD_LATERAL_STRESS and np.isfinite(strain).all():
        apparent = apparent_kind(strain, stress)
        if apparent in ("triaxial-undrained", "oedometer"):
            return apparent
    return kind


def _check_volume_and_drainage(
    table: Table,
    known: KnownStresses,
    measured: dict[str, Measured],
    settings: ImportSettings,
    kind: str,
    strain: Floats,
    stress: Floats,
) -> None:
    """Refuse what drainage, volume and stresses together rule out."""
    lateral = stress[:, 2]
    scale = float(np.nanmax(np.abs(stress[0])))
    held = bool(np.ptp(lateral) <= CONSTANT_STRESS * abs(lateral[0])) if scale > 0.0 else False
    change = known.water.largest_change
    q = stress[:, 0] - lateral
    sheared = bool(np.nanmax(np.abs(q - q[0])) > CONSTANT_STRESS * scale)
    names = ", ".join(series.name for ways in known.effective.values() for series in ways)
    if kind == "triaxial-undrained":
        if sheared and held and (change is None or change <= NO_CHANGE * scale):
            raise DatasetError(
                f"{table.source}: are {names or 'the stresses'} total or effective stresses? The "
                "lateral stress stays constant, which the effective one does not in an undrained "
                "test; add the pore pressure as a column, or say --stresses effective with another "
                "--kind"
            )
        if not volume_measured(measured) and (several := _several_stages(table)):
            raise DatasetError(
                f"{table.source}: column {several!r} has several stages, but only in the undrained "
                "one does the volume not change; give that stage in a file of its own, or add the "
                "volumetric strain"
            )
        return
    if not volume_measured(measured):
        undrained = change is not None and change > CONSTANT_STRESS * scale
        if kind in HELD_LATERAL_STRESS and undrained:
            raise DatasetError(
                f"{table.source}: {known.water.name} changes by {change:g} Pa, so that the test "
                f"was not drained as --kind {kind} says; use --kind triaxial-undrained, or add the "
                "volumetric strain"
            )
        return
    still = np.abs(strain.sum(axis=1)).max() <= NO_STRAIN * np.abs(strain[:, 0]).max()
    if settings.kind is None and kind == "triaxial-drained" and sheared and held and still:
        header = next(
            measured[name].header
            for name in ("volumetric_strain", "radial_strain", "void_ratio")
            if name in measured
        )
        raise DatasetError(
            f"{table.source}: column {header!r} says that the volume does not change, as in an "
            f"undrained test, but the lateral stress stays constant as a total one does; are "
            f"{names} total stresses? Add the pore pressure as a column; or leave the volume out "
            f"with --ignore {header!r}, or say --kind triaxial-drained"
        )


def _several_stages(table: Table) -> str | None:
    """Header of a column of stages that has more than one of them."""
    for column in table.columns:
        words = plain_header(column.header).rstrip("0123456789")
        if words in STAGES and len({str(cell).strip() for cell in column.cells}) > 1:
            return column.header
    return None


def _void_ratio(
    table: Table, measured: dict[str, Measured], settings: ImportSettings, strain: Floats
) -> Floats | None:
    given = settings.initial_void_ratio
    if "void_ratio" in measured:
        column = measured["void_ratio"]
        if given is not None and abs(given - column.values[0]) > SAME_VOID_RATIO:
            raise DatasetError(
                f"{table.source}: column {column.header!r} begins with a void ratio of "
                f"{column.values[0]:g}, but --e0 gives {given:g}; leave out the option, or the "
                f"column with --ignore {column.header!r}"
            )
        return column.values
    if given is None:
        return None
    # Grains do not change their volume: 1 + e shrinks with the specimen.
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
            f"the lateral stress was not measured: a start at K0 = {settings.k0:g} times the "
            "axial stress is assumed (--k0), and the axial strain is compared at the measured "
            "axial stress"
        )
    if settings.lateral_stress is not None:
        notes.append(
            f"a constant effective lateral stress of {settings.lateral_stress:g} Pa is given"
        )
    if settings.tension_positive:
        notes.append("the file is read as counting tension positive")
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
            "or leave out --monotonic"
        )


def _check_start(table: Table, stress: Floats, kind: str, settings: ImportSettings) -> None:
    pressure = float(stress[0].mean())
    if pressure > 0.0 or (pressure == 0.0 and kind in ("uniaxial", "strain")):
        return
    remedy = (
        "leave out --tension-positive if the file counts compression positive"
        if settings.tension_positive
        else "if the file counts tension positive, say so with --tension-positive"
    )
    raise DatasetError(
        f"{table.source}, {table.places[0]}: the mean stress is {pressure:g} Pa, but a test "
        f"starts under compression (p0 > 0); remove the rows before it or, {remedy}"
    )
