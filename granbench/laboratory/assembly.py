"""From a table of columns to a laboratory test: derived quantities and their checks."""

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.laboratory.laboratory_test import FEWEST_POINTS, LaboratoryTest, apparent_kind
from granbench.laboratory.measured import Measured, measured_quantities
from granbench.laboratory.quantities import QUANTITIES, listed
from granbench.laboratory.settings import ImportSettings
from granbench.paths.tables import Table
from granbench.plausible import SMALLEST_STRESS

Floats = NDArray[np.float64]


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
        Naming file, row and column: a column is missing or has no unit, a cell is no number, a
        stress or a strain is in the wrong unit, there are fewer than five rows, the test does
        not start under compression, its axial strain falls though it is monotonic.
    """
    measured = measured_quantities(table, settings)
    if len(table.places) < FEWEST_POINTS:
        raise DatasetError(
            f"{table.source}: has {len(table.places)} rows of numbers, but a test needs "
            f"{FEWEST_POINTS}; give the whole record"
        )
    stress = _principal_stress(table, measured, settings)
    void_ratio = measured["void_ratio"].values if "void_ratio" in measured else None
    strain = _principal_strain(table, measured, settings)
    _check_monotonic(table, measured, strain[:, 0], settings.monotonic)
    if void_ratio is None and settings.initial_void_ratio is not None:
        # Grains do not change their volume: 1 + e shrinks with the specimen.
        known = np.isfinite(strain).all()
        volume = np.exp(-strain.sum(axis=1)) if known else np.ones(len(strain))
        void_ratio = (1.0 + settings.initial_void_ratio) * volume - 1.0
    kind = settings.kind or kind or apparent_kind(strain, stress)
    _check_start(table, stress, kind)
    return LaboratoryTest(name, table.source, kind, strain, stress, void_ratio)


def _missing(table: Table, what: str, remedy: str) -> DatasetError:
    headers = listed(column.header for column in table.columns)
    return DatasetError(f"{table.source}: no column gives {what} among {headers}; {remedy}")


def _principal_stress(
    table: Table, measured: dict[str, Measured], settings: ImportSettings
) -> Floats:
    """Stress (row, 3), Pa, from any two of q, p, axial and lateral stress."""
    known = {name: m.values for name, m in measured.items() if QUANTITIES[name].is_stress}
    rows = len(table.places)
    if settings.lateral_stress is not None:
        known.setdefault("radial_stress", np.full(rows, settings.lateral_stress))
    axial, lateral = known.get("axial_stress"), known.get("radial_stress")
    p, q = known.get("mean_stress"), known.get("deviatoric_stress")
    middle = known.get("intermediate_stress")
    if lateral is None and p is not None and q is not None:
        lateral = p - q / 3.0
    elif lateral is None and axial is not None and q is not None:
        lateral = axial - q
    elif lateral is None and axial is not None and p is not None:
        lateral = (3.0 * p - axial) / 2.0
    if lateral is None:
        raise _missing(
            table,
            "the lateral stress",
            "it follows from two of q, p, axial and lateral stress: name the missing column with "
            "--column mean_stress=HEADER, or give a constant lateral stress with --lateral-stress "
            "PA",
        )
    if axial is None and q is not None:
        axial = lateral + q
    elif axial is None and p is not None:
        axial = 3.0 * p - 2.0 * lateral
    if axial is None:
        raise _missing(
            table,
            "the axial stress",
            "add q, p or the axial stress, or name its column with --column "
            "deviatoric_stress=HEADER",
        )
    stress = np.stack([axial, lateral if middle is None else middle, lateral], axis=-1)
    if np.abs(stress).max() < SMALLEST_STRESS:
        header, unit = next((m.header, m.unit) for n, m in measured.items() if n in known)
        raise DatasetError(
            f"{table.source}: column {header!r} and the others give no stress above "
            f"{np.abs(stress).max():.3g} Pa, which is suspicious; give the unit with --unit "
            f"stress={'kPa' if unit.lower() == 'pa' else 'MPa'}"
        )
    return stress


def _principal_strain(
    table: Table, measured: dict[str, Measured], settings: ImportSettings
) -> Floats:
    """Logarithmic strain (row, 3), zero at the first row; lateral NaN where not measured.

    The volumetric strain goes before a lateral one: laboratories measure the volume and derive
    the lateral strain, for small strains.
    """
    known = {name: m.values - m.values[0] for name, m in measured.items() if "strain" in name}
    volume, shear = known.get("volumetric_strain"), known.get("deviatoric_strain")
    axial, lateral = known.get("axial_strain"), known.get("radial_strain")
    if axial is None and volume is not None and shear is not None:
        axial = shear + volume / 3.0
    if axial is None:
        raise _missing(
            table,
            "the axial strain",
            "name its column with --column axial_strain=HEADER, or those of volumetric_strain and "
            "deviatoric_strain",
        )
    measure = _logarithmic if settings.strain_measure == "engineering" else np.asarray
    axial = measure(axial)
    middle = known.get("intermediate_strain")
    if middle is not None and lateral is not None:
        return np.stack([axial, measure(middle), measure(lateral)], axis=-1)
    if volume is not None:
        lateral = (measure(volume) - axial) / 2.0
    elif lateral is not None:
        lateral = measure(lateral)
    elif "void_ratio" in measured:
        specific = 1.0 + measured["void_ratio"].values
        lateral = (-np.log(specific / specific[0]) - axial) / 2.0
    else:
        lateral = np.full(len(axial), np.nan)
    return np.stack([axial, lateral, lateral], axis=-1)


def _logarithmic(engineering: Floats) -> Floats:
    """-ln(1 - e) of an engineering strain, compression positive: a length goes to (1 - e) L."""
    return -np.log1p(-engineering)


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


def _check_start(table: Table, stress: Floats, kind: str) -> None:
    pressure = float(stress[0].mean())
    if pressure > 0.0 or (pressure == 0.0 and kind in ("uniaxial", "strain")):
        return
    raise DatasetError(
        f"{table.source}, {table.places[0]}: the mean stress is {pressure:g} Pa, but a test "
        "starts under compression (p0 > 0); remove the rows before it or, if the file counts "
        "tension positive, say so with --tension-positive"
    )
