"""Make the record of a test from its measurements, and check the limits of the dataset.

The stress is measured as averages over chunks, and the geometry at the records, where chunks end.
Every record has a row with the geometry, the stress interpolated between two averages, and the
largest inertial number of the chunks since the last record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granbench.generators.dem.engine import SimulationFailure
from granbench.generators.dem.measurement import Contacts
from granbench.paths import LoadingProgramme

Floats = NDArray[np.float64]

LARGEST_INERTIAL_NUMBER = 2.5e-3
"""Quasi-static limit of Eq 2.6."""

LARGEST_SERVO_ERROR = 0.01
SERVO_START = 2e-3
"""Driving strain after which chunks count for the RMS of the servo error."""

LARGEST_RATIO_ERROR = 0.02
RATIO_START = 1e-2
"""Driving strain after which chunks count for the RMS of the error of b."""


@dataclass(frozen=True)
class Chunk:
    """A piece of the path, between two decisions of the servo.

    Parameters
    ----------
    start, end : driving lengths
    stress : (6,), Pa, compression positive, full order, averaged over the chunk
    inertial_number : I of Eq 2.6, from the rate and the mean stress of the chunk
    steps : time steps
    """

    start: float
    end: float
    stress: Floats
    inertial_number: float
    steps: int

    @property
    def middle(self) -> float:
        """Driving length to which the average stress belongs."""
        return 0.5 * (self.start + self.end)


@dataclass(frozen=True)
class Snapshot:
    """The geometry at a record.

    Parameters
    ----------
    strain : (3,), logarithmic, compression positive
    void_ratio : dimensionless
    contacts : between the grains
    """

    strain: Floats
    void_ratio: float
    contacts: Contacts


@dataclass(frozen=True)
class DrivenSeries:
    """The measurements during one test.

    Parameters
    ----------
    positions : (record,), driving lengths of the records, with 0 for the initial state
    snapshots : one for each record
    initial_stress : (6,), Pa, average over a chunk at rest before the path
    chunks : from the first record to the last; every record is at the end of one
    beyond : chunks after the last record, so that its stress also lies between two averages
    """

    positions: Floats
    snapshots: Sequence[Snapshot]
    initial_stress: Floats
    chunks: Sequence[Chunk]
    beyond: Sequence[Chunk]


class QualityError(SimulationFailure):
    """A test was completed, but exceeds a limit of the dataset."""


@dataclass(frozen=True)
class TestRecord:
    """The record of one test; rows are the initial state and every recorded state.

    Strain and stress are compression positive; components 11, 22, 33 for strain and the full
    order (xx, yy, zz, yz, xz, xy) for stress and fabric, with x = 11 axial. The stress is
    interpolated to the strain of the record between the averages over the chunk that ends and the
    chunk that begins there: it is smoothed over about 1e-3 of strain and does not lag. The geometry
    is that of the recorded moment.

    Parameters
    ----------
    path_position : (record,), driving length
    strain : (record, 3), logarithmic
    stress : (record, 6), Pa
    void_ratio, coordination_number : (record,)
    fabric : (record, 6), trace 1
    inertial_number : (record,), largest of the chunks since the last record
    servo_error : (record,), relative error of the controlled stress
    stress_ratio_error : (record,), error of b; NaN if b is not controlled
    servo_error_rms : over all chunks after 0.2 % of driving strain
    stress_ratio_error_rms : over all chunks after 1 %; NaN if b is not controlled
    peak_inertial_number : largest of all chunks
    steps : time steps
    """

    __test__ = False

    path_position: Floats
    strain: Floats
    stress: Floats
    void_ratio: Floats
    coordination_number: Floats
    fabric: Floats
    inertial_number: Floats
    servo_error: Floats
    stress_ratio_error: Floats
    servo_error_rms: float
    stress_ratio_error_rms: float
    peak_inertial_number: float
    steps: int


def record_of(programme: LoadingProgramme, series: DrivenSeries) -> TestRecord:
    """Return the record of a test; its quality is not checked.

    Parameters
    ----------
    programme : strains and stresses that were prescribed
    series : measurements during the test
    """
    positions, snapshots, chunks = series.positions, series.snapshots, series.chunks
    driven = [*chunks, *series.beyond]
    nodes = np.array([0.0, *(chunk.middle for chunk in driven)])
    averages = np.array([series.initial_stress, *(chunk.stress for chunk in driven)])
    stress = np.stack([np.interp(positions, nodes, c) for c in averages.T], axis=1)
    # Errors of the control are taken at the middles of chunks, to which the averages belong.
    errors = [
        (c.middle, programme.stress_error(c.stress[:3], c.middle),
         programme.stress_ratio_error(c.stress[:3]))
        for c in chunks
    ]  # fmt: skip
    at, error, ratio_error = np.array(errors).T
    numbers = np.array([c.inertial_number for c in chunks])
    ends = np.array([c.end for c in chunks])
    # A chunk belongs to the record that it leads to; it may end there up to rounding.
    owner = np.searchsorted(positions, ends - 1e-12)
    return TestRecord(
        path_position=positions,
        strain=np.array([s.strain for s in snapshots]),
        stress=stress,
        void_ratio=np.array([s.void_ratio for s in snapshots]),
        coordination_number=np.array([s.contacts.coordination_number for s in snapshots]),
        fabric=np.array([s.contacts.fabric for s in snapshots]),
        inertial_number=np.array(
            [0.0, *(numbers[owner == k].max() for k in range(1, positions.size))]
        ),
        servo_error=np.array(list(_errors(programme.stress_error, stress, positions))),
        stress_ratio_error=np.array([programme.stress_ratio_error(s[:3]) for s in stress]),
        servo_error_rms=_root_mean_square(error[at > SERVO_START]),
        stress_ratio_error_rms=_root_mean_square(ratio_error[at > RATIO_START]),
        peak_inertial_number=float(numbers.max()),
        steps=sum(chunk.steps for chunk in chunks),
    )


def require_quality(record: TestRecord) -> None:
    """Check a record against the limits of the dataset.

    Raises
    ------
    QualityError
        If a limit is exceeded; the text names it.
    """
    principal = np.linalg.eigvalsh(stress_tensor(record.stress))
    exceeded = []
    if record.servo_error_rms > LARGEST_SERVO_ERROR:
        exceeded.append(f"servo error {record.servo_error_rms:.3%} RMS > {LARGEST_SERVO_ERROR:.0%}")
    if record.stress_ratio_error_rms > LARGEST_RATIO_ERROR:
        exceeded.append(f"error of b {record.stress_ratio_error_rms:.4f} > {LARGEST_RATIO_ERROR}")
    if record.peak_inertial_number > LARGEST_INERTIAL_NUMBER:
        exceeded.append(
            f"inertial number {record.peak_inertial_number:.2e} > {LARGEST_INERTIAL_NUMBER:.1e}"
        )
    if not principal.min() > 0:
        exceeded.append(f"a principal stress of {principal.min():.3g} Pa is tensile")
    if exceeded:
        raise QualityError("the test exceeds limits of the dataset: " + "; ".join(exceeded))


def stress_tensor(components: Floats) -> Floats:
    """Return the symmetric tensors, (..., 3, 3), of components in the full order, (..., 6)."""
    return components[..., [[0, 5, 4], [5, 1, 3], [4, 3, 2]]]


def _errors(
    measure: Callable[[Floats, float], float], stress: Floats, positions: Floats
) -> Iterator[float]:
    for row, position in zip(stress, positions, strict=True):
        yield measure(row[:3], position)


def _root_mean_square(errors: Floats) -> float:
    return float(np.sqrt(np.mean(errors**2))) if errors.size else float("nan")
