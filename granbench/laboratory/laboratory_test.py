"""A test of a soil laboratory: principal strain and stress, and what was controlled."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.tensors import deviatoric_stress, mean_stress, volumetric_strain

FEWEST_POINTS = 5

HELD_LATERAL_STRESS = ("triaxial-drained", "constant-p", "uniaxial")
"""Kinds of test in which the lateral strain answers to a lateral stress."""

KINDS = (*HELD_LATERAL_STRESS, "triaxial-undrained", "oedometer", "strain")
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
class LaboratoryTest:
    """One test; compression positive, SI units, logarithmic strain.

    Parameters
    ----------
    name : unique among the tests of a file
    source : file, and where in it
    kind : one of `KINDS`
    strain : (step, 3), principal, cumulative from the state of step 0; 11 is axial, and the
        lateral ones are NaN where they were not measured
    stress : (step, 3), principal, Pa
    void_ratio : (step,), or None where it is not known
    """

    name: str
    source: str
    kind: str
    strain: NDArray[np.float64]
    stress: NDArray[np.float64]
    void_ratio: NDArray[np.float64] | None = None

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
                f"{self.source}: strain, stress and void ratio have different lengths; mend the "
                "program that makes the test"
            )
        if not self.lateral_strain_known and self.kind not in HELD_LATERAL_STRESS:
            raise DatasetError(
                f"{self.source}: a test of the kind {self.kind} needs the lateral or the "
                "volumetric strain; name its column with --column volumetric_strain=HEADER or, if "
                "the lateral stress was held, say so with --kind triaxial-drained"
            )
        if not (np.isfinite(self.strain[:, 0]).all() and np.isfinite(self.stress).all()):
            raise DatasetError(f"{self.source}: has stresses or strains that are NaN; mend them")

    @property
    def steps(self) -> int:
        """Number of points, the start included."""
        return len(self.strain)

    @property
    def lateral_strain_known(self) -> bool:
        """Whether the lateral strain was measured."""
        return bool(np.isfinite(self.strain).all())

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
        return bool(self.deviatoric_stress.max() > NO_SHEAR * np.abs(self.mean_stress).max())

    @property
    def initial_mean_stress(self) -> float:
        """p0, Pa."""
        return float(self.mean_stress[0])

    @property
    def initial_void_ratio(self) -> float | None:
        """e0, or None where it is not known."""
        return None if self.void_ratio is None else float(self.void_ratio[0])

    def at(self, places: NDArray[np.float64]) -> "LaboratoryTest":
        """The test at other points, interpolated in a straight line between its own.

        Parameters
        ----------
        places : (n,), rows counted from 0; the first is 0
        """
        rows = np.arange(self.steps)

        def between(series: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.interp(places, rows, series)

        return LaboratoryTest(
            self.name,
            self.source,
            self.kind,
            np.stack([between(column) for column in self.strain.T], axis=-1),
            np.stack([between(column) for column in self.stress.T], axis=-1),
            None if self.void_ratio is None else between(self.void_ratio),
        )

    def thinned(self, count: int) -> "LaboratoryTest":
        """The test at no more than `count` of its own points, start and end among them.

        The points lie evenly along the curve of q over axial strain, each divided by its range,
        so that the steep beginning keeps as many as the long end.
        """
        if count >= self.steps:
            return self
        wanted = np.linspace(0.0, 1.0, max(count, FEWEST_POINTS))
        rows = np.unique(np.rint(np.interp(wanted, self._curve_length(), np.arange(self.steps))))
        return self.at(rows)

    def resampled(self, count: int) -> "LaboratoryTest":
        """The test at `count` points that lie evenly along its curve, see `thinned`."""
        wanted = np.linspace(0.0, 1.0, count)
        return self.at(np.interp(wanted, self._curve_length(), np.arange(self.steps)))

    def _curve_length(self) -> NDArray[np.float64]:
        """Length of the curve up to every point over the whole, (step,), growing throughout."""
        parts = [self.axial_strain, self.stress[:, 0] - self.stress[:, 2]]
        ranges = [np.ptp(part) or 1.0 for part in parts]
        steps = [np.diff(part) / size for part, size in zip(parts, ranges, strict=True)]
        # The small addition keeps points apart that repeat the one before.
        lengths = np.hypot(*steps) + 1e-9
        return np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()


def apparent_kind(strain: NDArray[np.float64], stress: NDArray[np.float64]) -> str:
    """What was controlled, as far as strain (step, 3) and stress (step, 3) tell."""
    lateral_stress = stress[:, 1:]
    change = np.ptp(lateral_stress, axis=0).max()
    if np.abs(stress).max() > 0.0 and not lateral_stress.any():
        return "uniaxial"
    if change <= CONSTANT_STRESS * np.abs(lateral_stress[0]).max():
        return "triaxial-drained"
    limit = NO_STRAIN * np.abs(strain[:, 0]).max()
    if np.abs(strain[:, 1:]).max() <= limit:
        return "oedometer"
    if np.abs(strain.sum(axis=1)).max() <= limit:
        return "triaxial-undrained"
    mean = stress.mean(axis=1)
    if np.ptp(mean) <= CONSTANT_STRESS * abs(mean[0]):
        return "constant-p"
    return "strain"
