"""A test of a soil laboratory: principal strain and stress, and what was controlled."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.records.turning_points import spread_places, spread_rows, turning_rows
from granbench.tensors import deviatoric_stress, mean_stress, volumetric_strain

FEWEST_POINTS = 5

HELD_LATERAL_STRESS = ("triaxial-drained", "constant-p", "uniaxial")
"""Kinds of test in which the lateral strain answers to a lateral stress."""

LATERAL_STRAIN_GIVEN = ("triaxial-undrained", "oedometer", "isotropic")
"""Kinds of test that say what the lateral strain is: no change of volume, none to the sides, or as
much as the axial one. In none of them is the effective lateral stress constant."""

KINDS = (*HELD_LATERAL_STRESS, *LATERAL_STRAIN_GIVEN, "strain")
"""What may have been controlled: the names of `granbench.paths.standard_tests` where they have
one; `uniaxial` is a bar without lateral stress, `strain` is whatever else was measured whole."""

CONSTANT_STRESS = 0.05
"""Relative change of a stress below which it was held: cell pressures wander by some percent."""

NO_STRAIN = 0.01
"""Share of the axial strain below which another strain was prevented."""


NO_SHEAR = 0.01
"""Share of the largest mean stress below which q is noise: the friction of soils lets q reach some
tenths of p, and load cells are read to a few thousandths."""


@dataclass(frozen=True)
class Interpretation:
    """How a file was understood, in words for the user.

    Parameters
    ----------
    kind : where the kind of test comes from
    drainage : `drained`, `undrained` or what else is known
    stresses : how the stresses came to be effective, and what was assumed
    strain_measure : of the file, `engineering` or `logarithmic`
    not_used : headers of columns from which nothing was taken
    notes : what else was assumed, one sentence each
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
    interpretation : how the file was understood; None where nothing was left open
    """

    name: str
    source: str
    kind: str
    strain: NDArray[np.float64]
    stress: NDArray[np.float64]
    void_ratio: NDArray[np.float64] | None = None
    interpretation: Interpretation | None = None

    def __post_init__(self) -> None:
        """Raise DatasetError where the parts do not fit each other."""
        if self.kind not in KINDS:
            raise DatasetError(
                f"{self.source}: the kind of test {self.kind!r} is unknown; use --kind with one of "
                f"{', '.join(KINDS)}"
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
                f"{self.source}: strain, stress and void ratio have different lengths; correct the "
                "program that makes the test"
            )
        if not self.lateral_strain_known and self.kind not in HELD_LATERAL_STRESS:
            raise DatasetError(
                f"{self.source}: a test of the kind {self.kind} needs the lateral or the "
                "volumetric strain; name its column with --column volumetric_strain=HEADER or, if "
                "the lateral stress was held, say so with --kind triaxial-drained or, if the "
                "volume was held, with --kind triaxial-undrained"
            )
        needed = (self.strain[:, 0], self.stress[:, 0], self.stress[0])
        finite = all(np.isfinite(part).all() for part in needed)
        if not finite or not (self.lateral_stress_known or self.kind == "oedometer"):
            raise DatasetError(f"{self.source}: has stresses or strains that are NaN; correct them")

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
        """Whether all strains and stresses are known, as a record needs them."""
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
        """Whether the test bears a deviatoric stress; isotropic compression does not."""
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

        Every reversal of a strain, a stress or the void ratio is kept, be they more than `count`:
        see `granbench.records.turning_points`. The other points lie evenly along the curve of axial
        stress over axial strain, each divided by its range, so that the steep beginning keeps as
        many as the long end.
        """
        if count >= self.steps:
            return self
        return self.at(spread_rows(self._curve_length(), self._reversals(), count))

    def resampled(self, count: int) -> "LaboratoryTest":
        """The test at `count` points along its curve, see `thinned`; more if it reverses more."""
        return self.at(spread_places(self._curve_length(), self._reversals(), count))

    @property
    def reversals(self) -> int:
        """Number of points that every thinning keeps, start and end among them."""
        return len(self._reversals())

    def _reversals(self) -> NDArray[np.int64]:
        """Rows at which a measured quantity turns round, (n,), and the first and the last row."""
        p = self.stress.mean(axis=1)
        q = self.stress[:, 0] - self.stress[:, 2]
        stresses = [*self.stress.T, p, q]
        strains = [*self.strain.T[1:], self.strain.sum(axis=1)]
        # One scale for all stresses, and one for all strains: what is held constant only has noise.
        stress = max(float(np.nanmax(part) - np.nanmin(part)) for part in stresses)
        strain = float(np.ptp(self.axial_strain)) or 1.0
        answers = [(part, stress) for part in stresses] + [(part, strain) for part in strains]
        if self.void_ratio is not None:
            answers.append((self.void_ratio, (1.0 + self.void_ratio[0]) * strain))
        # A test is driven by its axial strain, or its axial stress: small loops count there.
        return turning_rows([(self.axial_strain, strain)], answers)

    def _curve_length(self) -> NDArray[np.float64]:
        """Length of the curve up to every point over the whole, (step,), growing throughout."""
        axial = self.stress[:, 0]
        parts = [
            self.axial_strain,
            axial - self.stress[:, 2] if self.lateral_stress_known else axial,
        ]
        ranges = [np.ptp(part) or 1.0 for part in parts]
        steps = [np.diff(part) / size for part, size in zip(parts, ranges, strict=True)]
        # The small addition keeps points apart that repeat the one before.
        lengths = np.hypot(*steps) + 1e-9
        return np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()


def apparent_kind(strain: NDArray[np.float64], stress: NDArray[np.float64]) -> str:
    """What was controlled, as far as strain (step, 3) and stress (step, 3) tell."""
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
