"""From the series that a driver leaves to the record of a test, held to the dataset's limits.

A driver knows stress as averages over chunks, and geometry at the records, where chunks end. Here
every record gets its row: the geometry as it is, the stress between two averages, the inertial
number of the chunks since the record before. Nothing here touches the engine.
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
"""Quasi-static bound of Eq 2.6."""

LARGEST_SERVO_ERROR = 0.01
SERVO_START = 2e-3
"""Driving strain after which the RMS of the servo error counts."""

LARGEST_RATIO_ERROR = 0.02
RATIO_START = 1e-2
"""Driving strain after which the RMS of the error of b counts."""


@dataclass(frozen=True)
class Chunk:
    """A driven piece of the path.

    Parameters
    ----------
    start, end : driving lengths
    stress : (6,), Pa, compression positive, full order, averaged over the chunk
    inertial_number : I of Eq 2.6 with the chunk's rate and mean stress
    steps : time steps
    """

    start: float
    end: float
    stress: Floats
    inertial_number: float
    steps: int

    @property
    def middle(self) -> float:
        """Driving length that the average stress stands for."""
        return 0.5 * (self.start + self.end)


@dataclass(frozen=True)
class Snapshot:
    """The geometry at a record: logarithmic strain (3,), void ratio, contacts."""

    strain: Floats
    void_ratio: float
    contacts: Contacts


@dataclass(frozen=True)
class DrivenSeries:
    """What a driver leaves of one test.

    Parameters
    ----------
    positions : (record,), driving lengths of the records, the initial state's 0 included
    snapshots : one a record
    initial_stress : (6,), Pa, average over a chunk at rest before the path
    chunks : from the first record to the last; every record is the end of one
    beyond : chunks after the last record, so that its stress too lies between two averages
    """

    positions: Floats
    snapshots: Sequence[Snapshot]
    initial_stress: Floats
    chunks: Sequence[Chunk]
    beyond: Sequence[Chunk]


class QualityError(SimulationFailure):
    """A simulation ran, but what it gave does not meet the limits of the dataset."""


@dataclass(frozen=True)
class TestRecord:
    """What one test gave; rows are the initial state and every record.

    Strain and stress are compression positive; components 11, 22, 33 for strain and the full
    order (xx, yy, zz, yz, xz, xy) for stress and fabric, with x = 11 axial. The stress is
    interpolated to the record's strain between the averages over the chunk that ends and the chunk
    that begins there, so it is smoothed over about 1e-3 of strain and does not lag. The geometric
    figures are those at the record.

    Parameters
    ----------
    path_position : (record,), driving length
    strain : (record, 3), logarithmic
    stress : (record, 6), Pa
    void_ratio, coordination_number : (record,)
    fabric : (record, 6), trace 1
    inertial_number : (record,), largest of the chunks since the record before
    servo_error : (record,), relative error of the held stress
    stress_ratio_error : (record,), error of b; NaN where none is held
    servo_error_rms : over all chunks after 0.2 % of driving strain
    stress_ratio_error_rms : over all chunks after 1 %; NaN where no b is held
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


def assemble(programme: LoadingProgramme, series: DrivenSeries) -> TestRecord:
    """Return the record of a driven programme, whatever its quality.

    Parameters
    ----------
    programme : what was prescribed
    series : what the driver left
    """
    positions, snapshots, chunks = series.positions, series.snapshots, series.chunks
    driven = [*chunks, *series.beyond]
    nodes = np.array([0.0, *(chunk.middle for chunk in driven)])
    averages = np.array([series.initial_stress, *(chunk.stress for chunk in driven)])
    stress = np.stack([np.interp(positions, nodes, c) for c in averages.T], axis=1)
    # How well the path was held is judged where averages stand for something: at the middles.
    held = [
        (c.middle, programme.stress_error(c.stress[:3], c.middle),
         programme.stress_ratio_error(c.stress[:3]))
        for c in chunks
    ]  # fmt: skip
    at, error, ratio_error = np.array(held).T
    numbers = np.array([c.inertial_number for c in chunks])
    ends = np.array([c.end for c in chunks])
    # A chunk belongs to the record that it leads to; one that ends there does so but for rounding.
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
    """Raise QualityError if a record breaks a limit of the dataset."""
    principal = np.linalg.eigvalsh(stress_tensor(record.stress))
    broken = []
    if record.servo_error_rms > LARGEST_SERVO_ERROR:
        broken.append(f"servo error {record.servo_error_rms:.3%} RMS > {LARGEST_SERVO_ERROR:.0%}")
    if record.stress_ratio_error_rms > LARGEST_RATIO_ERROR:
        broken.append(f"error of b {record.stress_ratio_error_rms:.4f} > {LARGEST_RATIO_ERROR}")
    if record.peak_inertial_number > LARGEST_INERTIAL_NUMBER:
        broken.append(
            f"inertial number {record.peak_inertial_number:.2e} > {LARGEST_INERTIAL_NUMBER:.1e}"
        )
    if not principal.min() > 0:
        broken.append(f"a principal stress of {principal.min():.3g} Pa is tensile")
    if broken:
        raise QualityError("the test misses the dataset's limits: " + "; ".join(broken))


def stress_tensor(components: Floats) -> Floats:
    """Return the symmetric tensors (..., 3, 3) of components (..., 6) in the full order."""
    return components[..., [[0, 5, 4], [5, 1, 3], [4, 3, 2]]]


def _errors(
    measure: Callable[[Floats, float], float], stress: Floats, positions: Floats
) -> Iterator[float]:
    for row, position in zip(stress, positions, strict=True):
        yield measure(row[:3], position)


def _root_mean_square(errors: Floats) -> float:
    return float(np.sqrt(np.mean(errors**2))) if errors.size else float("nan")
