"""The kind of a test, from its columns and its numbers, and what contradicts it."""

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError, Setting
from granbench.laboratory.headers import plain_header
from granbench.laboratory.laboratory_test import (
    CONSTANT_STRESS,
    HELD_LATERAL_STRESS,
    NO_STRAIN,
    apparent_kind,
)
from granbench.laboratory.measured import Measured
from granbench.laboratory.principal_strain import volume_measured
from granbench.laboratory.remedies import ignore, stresses
from granbench.laboratory.remedies import kind as kind_is
from granbench.laboratory.settings import ImportSettings
from granbench.laboratory.stress_series import KnownStresses
from granbench.tables.tables import Table

Floats = NDArray[np.float64]

NO_CHANGE = 0.01
"""Change of the pore pressure, as a share of the first mean stress, below which it was constant."""


STAGES = frozenset({"stage", "stages", "stageno", "stagenumber", "stagename", "phase"})


def kind_by_columns(
    table: Table, known: KnownStresses, measured: dict[str, Measured], settings: ImportSettings
) -> tuple[str | None, str]:
    """The kind of test that columns and pore pressure show before the strains are known, and why.

    Returns
    -------
    None and an empty text where they do not show it
    """
    if settings.kind is not None:
        return None, ""
    lateral = {"radial_stress", "mean_stress"} & set(known.effective)
    if not lateral and known.deviatoric is None and settings.lateral_stress is None:
        if "axial_stress" in known.effective and _sides_did_not_move(measured, settings):
            return "oedometer", "because the axial strain is the whole volume change"
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
        "no column gives a volume; give ",
        kind_is("triaxial-undrained"),
        " or ",
        kind_is("triaxial-drained"),
    )


def _sides_did_not_move(measured: dict[str, Measured], settings: ImportSettings) -> bool:
    """Whether axial and volumetric strain were measured and are equal."""
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


def kind_by_format(
    kind: str | None, known: KnownStresses, measured: dict[str, Measured]
) -> str | None:
    """The kind that the format gives, or None where a changing pore pressure contradicts it."""
    undrained = kind in HELD_LATERAL_STRESS and not volume_measured(measured)
    change = known.water.largest_change
    return None if undrained and change is not None and change > 0.0 else kind


def kind_by_numbers(kind: str, strain: Floats, stress: Floats) -> str:
    """The kind, corrected where the measured strains show another one."""
    if kind in HELD_LATERAL_STRESS and np.isfinite(strain).all():
        apparent = apparent_kind(strain, stress)
        if apparent in ("triaxial-undrained", "oedometer"):
            return apparent
    return kind


def check_drainage(
    table: Table,
    known: KnownStresses,
    measured: dict[str, Measured],
    settings: ImportSettings,
    kind: str,
    strain: Floats,
    stress: Floats,
) -> None:
    """Refuse stresses and volume changes that contradict the drainage of the test."""
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
                "test; add the pore pressure as a column, or give ",
                stresses("effective"),
                " with another ",
                Setting("kind"),
            )
        if not volume_measured(measured) and (several := _several_stages(table)):
            raise DatasetError(
                f"{table.source}: column {several!r} has several stages, but the volume is "
                "constant only in the undrained one; put that stage into a file of its own, or add "
                "the volumetric strain"
            )
        return
    if not volume_measured(measured):
        undrained = change is not None and change > CONSTANT_STRESS * scale
        if kind in HELD_LATERAL_STRESS and undrained:
            raise DatasetError(
                f"{table.source}: {known.water.name} changes by {change:g} Pa, so the test was not "
                "drained as ",
                kind_is(kind),
                " says; use ",
                kind_is("triaxial-undrained"),
                ", or add the volumetric strain",
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
            "with ",
            ignore(header),
            ", or give ",
            kind_is("triaxial-drained"),
        )


def _several_stages(table: Table) -> str | None:
    """Header of a column that names more than one stage, or None."""
    for column in table.columns:
        words = plain_header(column.header).rstrip("0123456789")
        if words in STAGES and len({str(cell).strip() for cell in column.cells}) > 1:
            return column.header
    return None
