"""Axial and lateral strain from the measured strains of a file, or from the kind of test."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError, Setting
from granbench.laboratory.measured import Measured
from granbench.laboratory.principal_stress import missing
from granbench.laboratory.remedies import column, ignore
from granbench.laboratory.remedies import kind as kind_is
from granbench.laboratory.settings import ImportSettings
from granbench.tables.tables import Table

Floats = NDArray[np.float64]

STRAIN_AGREEMENT = 0.05
"""Difference of two values of one strain, as a share of the largest, that scatter explains."""

STRAIN_READING = 1e-3
"""Strain by which they may always differ: void ratios are given to three digits."""

PREVENTED = 0.02
"""Share of the axial strain below which another strain counts as zero."""


def principal_strain(
    table: Table, measured: dict[str, Measured], settings: ImportSettings, kind: str | None
) -> Floats:
    """Logarithmic strain (row, 3), zero at the first row; lateral NaN where it is not known.

    The volumetric strain takes precedence over a lateral one: laboratories measure the volume and
    derive the lateral strain for small strains. If neither was measured, the kind of test gives
    the lateral strain: no volume change in an undrained test, no lateral strain in an oedometer.

    Parameters
    ----------
    table : for error texts
    measured : columns by quantity
    settings : with the strain measure of the file
    kind : of the test, where it is known

    Raises
    ------
    DatasetError
        Naming the columns, if the axial strain is missing, or strains contradict each other or the
        kind of test.
    """
    known = {name: m.values - m.values[0] for name, m in measured.items() if "strain" in name}
    convert = _logarithmic if settings.strain_measure == "engineering" else _unchanged
    _check_redundant(table, measured, known, convert)
    by_void_ratio = _volume_by_void_ratio(measured)
    volume = known.get("volumetric_strain")
    volume = by_void_ratio if volume is None else convert(volume)
    axial = _axial(table, known, convert, volume, kind)
    lateral, middle = known.get("radial_strain"), known.get("intermediate_strain")
    if middle is not None and lateral is not None:
        return np.stack([axial, convert(middle), convert(lateral)], axis=-1)
    if "volumetric_strain" not in known and lateral is not None:
        lateral = convert(lateral)
    elif volume is not None:
        lateral = (volume - axial) / 2.0
    _check_kind(table, measured, axial, lateral, kind)
    if lateral is None:
        of_kind = {"triaxial-undrained": -axial / 2.0, "oedometer": 0.0 * axial, "isotropic": axial}
        lateral = of_kind.get(kind or "", np.full(len(axial), np.nan))
    return np.stack([axial, lateral, lateral], axis=-1)


def volume_measured(measured: dict[str, Measured]) -> bool:
    """Whether a file says how the volume changed."""
    return bool({"volumetric_strain", "radial_strain", "void_ratio"} & set(measured))


def _logarithmic(engineering: Floats) -> Floats:
    """-ln(1 - e) of an engineering strain, compression positive: a length goes to (1 - e) L."""
    return -np.log1p(-engineering)


def _unchanged(logarithmic: Floats) -> Floats:
    return logarithmic


def _volume_by_void_ratio(measured: dict[str, Measured]) -> Floats | None:
    if "void_ratio" not in measured:
        return None
    specific = 1.0 + measured["void_ratio"].values
    return -np.log(specific / specific[0])


def _axial(
    table: Table,
    known: dict[str, Floats],
    convert: Callable[[Floats], Floats],
    volume: Floats | None,
    kind: str | None,
) -> Floats:
    if (axial := known.get("axial_strain")) is not None:
        return convert(axial)
    shear = known.get("deviatoric_strain")
    if shear is not None and "volumetric_strain" in known:
        return convert(shear + known["volumetric_strain"] / 3.0)
    if shear is not None and kind == "triaxial-undrained":
        return convert(shear)
    if volume is not None and kind == "oedometer":
        return volume
    if volume is not None and kind == "isotropic":
        return volume / 3.0
    raise missing(
        table,
        "the axial strain",
        "name its column with ",
        column("axial_strain"),
        ", or those of volumetric_strain and deviatoric_strain; from the volume alone it follows "
        "with ",
        kind_is("oedometer"),
        " or ",
        kind_is("isotropic"),
    )


def _check_redundant(
    table: Table,
    measured: dict[str, Measured],
    known: dict[str, Floats],
    convert: Callable[[Floats], Floats],
) -> None:
    """Refuse strains that contradict each other, as they do if one has the other sign."""
    axial, volume = known.get("axial_strain"), known.get("volumetric_strain")
    lateral, shear = known.get("radial_strain"), known.get("deviatoric_strain")
    by_void_ratio = _volume_by_void_ratio(measured)
    if (
        by_void_ratio is not None
        and volume is not None
        and not _same(convert(volume), by_void_ratio, volume)
    ):
        raise _contradiction(table, measured, ("volumetric_strain", "void_ratio"))
    if axial is not None and lateral is not None and "intermediate_strain" not in known:
        small = axial + 2.0 * lateral
        finite = convert(axial) + 2.0 * convert(lateral)
        if volume is not None:
            if not (_same(volume, small, axial) or _same(convert(volume), finite, axial)):
                raise _contradiction(table, measured, ("volumetric_strain", "radial_strain"))
        elif by_void_ratio is not None and not _same(finite, by_void_ratio, axial):
            raise _contradiction(table, measured, ("radial_strain", "void_ratio"))
    if axial is not None and volume is not None and shear is not None:
        expected = axial - volume / 3.0
        # Some define the deviatoric strain as e1 - e3, others as two thirds of it.
        if not (_same(shear, expected, axial) or _same(shear, 1.5 * expected, axial)):
            raise _contradiction(table, measured, ("deviatoric_strain", "volumetric_strain"))


def _same(one: Floats, other: Floats, reference: Floats) -> bool:
    largest = max(float(np.abs(part).max()) for part in (one, other, reference))
    return bool(np.abs(one - other).max() <= STRAIN_AGREEMENT * largest + STRAIN_READING)


def _contradiction(
    table: Table, measured: dict[str, Measured], names: tuple[str, str]
) -> DatasetError:
    one, other = (measured[name].header for name in names)
    return DatasetError(
        f"{table.source}: columns {one!r} and {other!r} contradict each other; check their signs "
        "(compression positive) and units, or leave out the wrong one with ",
        ignore(one),
        " or ",
        ignore(other),
    )


def _check_kind(
    table: Table,
    measured: dict[str, Measured],
    axial: Floats,
    lateral: Floats | None,
    kind: str | None,
) -> None:
    """Refuse a measured volume or lateral strain that the kind of test excludes."""
    if lateral is None or kind not in ("triaxial-undrained", "oedometer"):
        return
    prevented, what = {
        "triaxial-undrained": (axial + 2.0 * lateral, "the volume does not change"),
        "oedometer": (lateral, "there is no lateral strain"),
    }[kind]
    limit = PREVENTED * float(np.abs(axial).max()) + STRAIN_READING
    if np.abs(prevented).max() > limit:
        header = next(
            measured[name].header
            for name in ("volumetric_strain", "radial_strain", "void_ratio")
            if name in measured
        )
        raise DatasetError(
            f"{table.source}: column {header!r} gives a strain of up to "
            f"{100.0 * np.abs(prevented).max():.3g} % where in a test of the kind {kind} {what}; "
            "give another ",
            Setting("kind"),
            ", or leave the column out with ",
            ignore(header),
        )
