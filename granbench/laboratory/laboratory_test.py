"""A test of a soil laboratory: principal strain and stress, and what was controlled."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError, Setting
from granbench.laboratory.remedies import column, kind
from granbench.records.turning_points import spread_places, spread_rows, turning_rows
from granbench.tensors import deviatoric_stress, mean_stress, volumetric_strain

FEWEST_POINTS = 5

HELD_LATERAL_STRESS = ("triaxial-drained", "constant-p", "uniaxial")
"""Kinds of test with a prescribed lateral stress, so that the lateral strain is free."""

LATERAL_STRAIN_GIVEN = ("triaxial-undrained", "oedometer", "isotropic")
"""Kinds of test that prescribe the lateral strain: by constant volume, zero lateral strain, or
equal strain in all directions. In none of them is the effective lateral stress constant."""

KINDS = (*HELD_LATERAL_STRESS, *LATERAL_STRAIN_GIVEN, "strain")
"""Kinds of test, under the names of `granbench.paths.standard_tests`; `uniaxial` is a bar
without lateral stress, `strain` any other test whose strains were all measured."""

CONSTANT_STRESS = 0.05
"""Relative change of a stress below which it counts as held: cell pressures drift by some per
cent."""

NO_STRAIN = 0.01
"""Share of the axial strain below which another strain counts as zero."""

NO_SHEAR = 0.01
"""Share of the largest mean stress below which q is noise: the friction of soils lets q reach some
tenths of p, and load cells are read to a few thousandths."""


@dataclass(frozen=True)
class Interpretation:
    """Interpretation of a file, in words for the user.

    Parameters
    ----------
    kind : where the kind of test comes from
    drainage : `drained`, `undrained` or what else is known
    stresses : how the effective stresses were obtained, and what was assumed
    strain_measure : of the file, `engineering` or `logarithmic`
    not_used : headers of columns that were not used
    notes : other assumptions, one sentence each
    """

    kind: str
    drainage: str
    stresses: str
    strain_measure: str
    not_used: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class LaboratoryTest:
    """One test; compression positive, SI units, logarithmic strain.

    Parameters
    ----------
    name : unique among the tests of a file
    source : file, and where in it
    kind : one of `KINDS`
    strain : (step, 3), principal, cumulative from the state of step 0; 11 is axial, and the
        lateral ones are NaN where they were not measured
    stress : (step, 3), principal, effective, Pa; in an oedometer test whose lateral stress was
        not measured, the lateral ones are NaN after step 0, where they are assumed
    void_ratio : (step,), or None where it is not known
    interpretation : how the file was interpreted; None where there was nothing to interpret
    """

    name: str
    source: str
    kind: str
    strain: NDArray[np.float64]
    stress: NDArray[np.float64]
    void_ratio: NDArray[np.float64] | None = None
    interpretation: Interpretation | None = None

    def __post_init__(self) -> None:
        """Raise DatasetError if strain, stress and kind do not fit each other."""
        if self.kind not in KINDS:
            raise DatasetError(
                f"{self.source}: the kind of test {self.kind!r} is unknown; give ",
                Setting("kind"),
                f" with one of {', '.join(KINDS)}",
            )
        steps = len(self.strain)
        if steps < FEWEST_POINTS:
            raise DatasetError(
                f"{self.source}: has {steps} points, but a test needs {FEWEST_POINTS}; give the "
                "whole record"
            )
        shapes = {self.strain.shape, self.stress.shape}
        if shapes != {(steps, 3)} or not (
            self.void_ratio is None or self.void_ratio.shape == (steps,)
        ):
            raise DatasetError(
                f"{self.source}: strain and stress must be (step, 3) and the void ratio (step,), "
                "with equally many steps"
            )
        if not self.lateral_strain_known and self.kind not in HELD_LATERAL_STRESS:
            raise DatasetError(
                f"{self.source}: a test of the kind {self.kind} needs the lateral or the "
                "volumetric strain; name its column with ",
                column("volumetric_strain"),
                " or, if the lateral stress was held, give ",
                kind("triaxial-drained"),
                " or, if the volume was held, ",
                kind("triaxial-undrained"),
            )
        needed = (self.strain[:, 0], self.stress[:, 0], self.stress[0])
        finite = all(np.isfinite(part).all() for part in needed)
        if not finite or not (self.lateral_stress_known or self.kind == "oedometer"):
            raise DatasetError(f"{self.source}: has stresses or strains that are NaN; fix them")

    @property
    def steps(self) -> int:
        """Number of points, the start included."""
        return len(self.strain)

    @property
    def lateral_strain_known(self) -> bool:
        """Whether the lateral strain was measured."""
        return bool(np.isfinite(self.strain).all())

    @property
    def lateral_stress_known(self) -> bool:
        """Whether the lateral stress was measured."""
        return bool(np.isfinite(self.stress).all())

    @property
    def is_complete(self) -> bool:
        """Whether all strains and stresses are known, as a record requires."""
        return self.lateral_strain_known and self.lateral_stress_known

    @property
    def axial_strain(self) -> NDArray[np.float64]:
        """Strain 11, (step,)."""
        return self.strain[:, 0]

    @property
    def volumetric_strain(self) -> NDArray[np.float64]:
        """Logarithmic volumetric strain, (step,); NaN where it is not known."""
        return volumetric_strain(self.strain)

    @property
    def mean_stress(self) -> NDArray[np.float64]:
        """p, (step,), Pa."""
        return mean_stress(self.stress)

    @property
    def deviatoric_stress(self) -> NDArray[np.float64]:
        """q, (step,), Pa."""
        return deviatoric_stress(self.stress)

    @property
    def is_sheared(self) -> bool:
        """Whether the test has a deviatoric stress; isotropic compression has none."""
        if not self.lateral_stress_known:
            return True
        return bool(self.deviatoric_stress.max() > NO_SHEAR * np.abs(self.mean_stress).max())

    @property
    def initial_mean_stress(self) -> float:
        """p0, Pa."""
        return float(self.mean_stress[0])

    @property
    def initial_void_ratio(self) -> float | None:
        """e0, or None where it is not known."""
        return None if self.void_ratio is None else float(self.void_ratio[0])

    def at(self, places: NDArray[np.float64] | NDArray[np.int64]) -> "LaboratoryTest":
        """The test at other points, interpolated in a straight line between its own.

        Parameters
        ----------
        places : (n,), rows counted from 0; the first is 0
        """
        rows = np.arange(self.steps)

        def between(series: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.interp(places, rows, series)

        return replace(
            self,
            strain=np.stack([between(column) for column in self.strain.T], axis=-1),
            stress=np.stack([between(column) for column in self.stress.T], axis=-1),
            void_ratio=None if self.void_ratio is None else between(self.void_ratio),
        )

    def thinned(self, count: int) -> "LaboratoryTest":
        """The test at about `count` of its own points, start and end among them.

        Every reversal of a strain, a stress or the void ratio is kept, even if there are more than
        `count`: see `granbench.records.turning_points`. The other points are evenly spaced along
        the curve of axial stress over axial strain, each divided by its range, so that the steep
        beginning has as many as the long end.
        """
        if count >= self.steps:
            return self
        return self.at(spread_rows(self._curve_length(), self._reversals(), count))

    def resampled(self, count: int) -> "LaboratoryTest":
        """The test at `count` points along its curve, see `thinned`; more if it reverses more."""
        return self.at(spread_places(self._curve_length(), self._reversals(), count))

    @property
    def reversals(self) -> int:
        """Number of points that thinning always keeps, including start and end."""
        return len(self._reversals())

    def _reversals(self) -> NDArray[np.int64]:
        """Rows at which a measured quantity reverses, (n,), and the first and the last row."""
        p = self.stress.mean(axis=1)
        q = self.stress[:, 0] - self.stress[:, 2]
        stresses = [*self.stress.T, p, q]
        strains = [*self.strain.T[1:], self.strain.sum(axis=1)]
        # One scale for all stresses, one for all strains: the range of a held one is only noise.
        stress = max(float(np.nanmax(part) - np.nanmin(part)) for part in stresses)
        strain = float(np.ptp(self.axial_strain)) or 1.0
        responses = [(part, stress) for part in stresses] + [(part, strain) for part in strains]
        if self.void_ratio is not None:
            responses.append((self.void_ratio, (1.0 + self.void_ratio[0]) * strain))
        # A test is driven by its axial strain or stress: small loops count there.
        return turning_rows([(self.axial_strain, strain)], responses)

    def _curve_length(self) -> NDArray[np.float64]:
        """Length of the curve up to every point over the total length, (step,), increasing."""
        axial = self.stress[:, 0]
        parts = [
            self.axial_strain,
            axial - self.stress[:, 2] if self.lateral_stress_known else axial,
        ]
        ranges = [np.ptp(part) or 1.0 for part in parts]
        steps = [np.diff(part) / size for part, size in zip(parts, ranges, strict=True)]
        # The small addition separates points that repeat the one before.
        lengths = np.hypot(*steps) + 1e-9
        return np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()


def apparent_kind(strain: NDArray[np.float64], stress: NDArray[np.float64]) -> str:
    """The kind of test that strain (step, 3) and stress (step, 3) show."""
    lateral_stress = stress[:, 1:]
    if not np.isfinite(stress).all():
        return "oedometer"
    change = np.ptp(lateral_stress, axis=0).max()
    if np.abs(stress).max() > 0.0 and not lateral_stress.any():
        return "uniaxial"
    if change <= CONSTANT_STRESS * np.abs(lateral_stress[0]).max():
        return "triaxial-drained"
    axial = np.abs(strain[:, 0]).max()
    limit = NO_STRAIN * axial
    sheared = (
        np.abs(stress[:, :1] - stress[:, 1:]).max() > NO_SHEAR * np.abs(stress.mean(axis=1)).max()
    )
    if not sheared and np.abs(strain[:, 1:] - strain[:, :1]).max() <= limit:
        return "isotropic"
    if np.abs(strain[:, 1:]).max() <= limit:
        return "oedometer"
    if np.abs(strain.sum(axis=1)).max() <= limit:
        return "triaxial-undrained"
    mean = stress.mean(axis=1)
    if np.ptp(mean) <= CONSTANT_STRESS * abs(mean[0]):
        return "constant-p"
    return "strain"
