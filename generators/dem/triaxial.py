"""One stress-controlled test of a prepared specimen, recorded at equal steps of its path."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.errors import EngineError
from granbench.generators.dem.box import GrainBox
from granbench.generators.dem.measurement import Contacts, contacts, inertial_number, rate_at
from granbench.generators.dem.preparation import PreparedSpecimen
from granbench.generators.dem.servo import StressServo
from granbench.paths import LoadingProgramme

Floats = NDArray[np.float64]

INERTIAL_NUMBER = 2.4e-3
LARGEST_INERTIAL_NUMBER = 2.5e-3
"""Quasi-static bound of Eq 2.6; the drive keeps a little below it, as p changes in a chunk."""

LONGEST_CHUNK = 5e-4
SHORTEST_CHUNK = 1e-4
CHUNKS_A_RECORD = 3
CHUNK_STRESS_STEP = 0.012
"""Elastic stress change K d(eps) / p in a chunk: stiff packings need shorter chunks."""

FEWEST_STEPS_A_CHUNK = 4

SAMPLES_A_CHUNK = 5

LARGEST_SERVO_ERROR = 0.01
SERVO_START = 2e-3
"""Driving strain after which the RMS of the servo error counts."""

LARGEST_RATIO_ERROR = 0.02
RATIO_START = 1e-2
"""Driving strain after which the RMS of the error of b counts."""


class QualityError(EngineError):
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


@dataclass(frozen=True)
class _Chunk:
    """A driven piece of the path: from `start` to `end`, with the average stress in it."""

    start: float
    end: float
    stress: Floats
    inertial_number: float
    duration: float

    @property
    def middle(self) -> float:
        return 0.5 * (self.start + self.end)


@dataclass(frozen=True)
class _Snapshot:
    """The geometry at a record."""

    strain: Floats
    void_ratio: float
    contacts: Contacts


def run_test(
    specimen: PreparedSpecimen,
    programme: LoadingProgramme,
    log_path: Path,
    records: int = 240,
) -> TestRecord:
    """Run a loading programme from its prepared state; to be called in a process of its own.

    Parameters
    ----------
    specimen : prepared at the programme's pressure
    programme : what is prescribed
    log_path : LIGGGHTS' log
    records : recorded states after the initial one, at equal driving lengths

    Returns
    -------
    record : TestRecord with records + 1 rows

    Raises
    ------
    QualityError : a limit of the dataset is broken; the text says which and by how much
    EngineError : the engine is missing or grains were lost
    """
    state = specimen.state(programme.pressure)
    box = GrainBox.from_restart(
        log_path, specimen.folder / state.restart_file, specimen.diameters(), specimen.material,
        specimen.material.friction,
    )  # fmt: skip
    positions = np.linspace(0.0, programme.path_length, records + 1)
    driver = _Driver(box, specimen.d50, state.bulk_modulus, programme, positions[1])
    # Contacts can be read only after a first run.
    initial = driver.hold()
    snapshots = [driver.snapshot()]
    chunks: list[_Chunk] = []
    for start, end in itertools.pairwise(positions):
        chunks += driver.drive(start, end)
        snapshots.append(driver.snapshot())
    steps = driver.steps
    # One chunk beyond the end, so that the last record is an interpolation too.
    after = driver.drive(positions[-1], positions[-1] + chunks[-1].end - chunks[-1].start)
    box.close()
    record = _assemble(programme, positions, snapshots, initial, chunks, after, steps)
    _require_quality(record)
    return record


class _Driver:
    """Drives a box along a programme, chunk by chunk."""

    def __init__(
        self,
        box: GrainBox,
        d50: float,
        bulk_modulus: float,
        programme: LoadingProgramme,
        record_length: float,
    ) -> None:
        self._box = box
        self._programme = programme
        self._d50 = d50
        self._density = box.material.density
        self._modulus = bulk_modulus
        self._servo = StressServo(programme.free_directions, programme.controlled_stresses)
        self._start = box.lengths
        self._mean_stress = programme.pressure
        self._rates = np.zeros(programme.free_directions.shape[1])
        self.steps = 0
        stiffness = bulk_modulus / programme.pressure
        a_step = self._driving_rate() * box.time_step
        longest = min(LONGEST_CHUNK, record_length / CHUNKS_A_RECORD)
        chunk = min(max(CHUNK_STRESS_STEP / stiffness, SHORTEST_CHUNK), longest)
        self._chunk = max(chunk, FEWEST_STEPS_A_CHUNK * a_step)
        box.sample_every(max(1, int(self._chunk / a_step / SAMPLES_A_CHUNK)))

    def hold(self) -> Floats:
        """Return the stress (6,) of the box at rest."""
        steps = self._box.whole_chunk(self._chunk / self._driving_rate() / self._box.time_step)
        return self._box.strain(np.zeros(3), steps)

    def snapshot(self) -> _Snapshot:
        """Measure the geometry of the present state."""
        return _Snapshot(
            -np.log(self._box.lengths / self._start), self._box.void_ratio, contacts(self._box)
        )

    def drive(self, start: float, end: float) -> list[_Chunk]:
        """Drive the programme from one driving length to another."""
        chunks = []
        corners = [s for s in self._programme.turning_points if start < s < end]
        for low, high in zip([start, *corners], [*corners, end], strict=True):
            count = max(1, math.ceil((high - low) / self._chunk - 1e-6))
            edges = np.linspace(low, high, count + 1)
            chunks += [self._drive_chunk(a, b) for a, b in itertools.pairwise(edges)]
        return chunks

    def _drive_chunk(self, start: float, end: float) -> _Chunk:
        box, programme = self._box, self._programme
        if start in programme.turning_points:
            self._servo.rescale(-1.0)
            self._rates = -self._rates
        steps = box.whole_chunk((end - start) / (self._driving_rate() * box.time_step))
        duration = steps * box.time_step
        driven = programme.driven_strain(end) - programme.driven_strain(start)
        stress = box.strain(driven + programme.free_directions @ self._rates * duration, steps)
        self.steps += steps
        self._mean_stress = float(stress[:3].mean())
        rate = (end - start) / duration
        if not self._mean_stress > 0:
            raise QualityError(f"the mean stress vanished at a driving strain of {end:.4f}")
        # The tangent stiffness of contacts grows about with the root of p.
        modulus = self._modulus * math.sqrt(self._mean_stress / programme.pressure)
        middle = 0.5 * (start + end)
        error = programme.targets(middle) - programme.controlled_stresses @ stress[:3]
        change = programme.targets(middle + end - start) - programme.targets(middle)
        self._rates = self._servo.rates(error, change, modulus, duration, rate)
        number = inertial_number(rate, self._d50, self._density, self._mean_stress)
        return _Chunk(start, end, stress, number, duration)

    def _driving_rate(self) -> float:
        return rate_at(INERTIAL_NUMBER, self._d50, self._density, self._mean_stress)


def _assemble(
    programme: LoadingProgramme,
    positions: Floats,
    snapshots: list[_Snapshot],
    initial: Floats,
    chunks: list[_Chunk],
    after: list[_Chunk],
    steps: int,
) -> TestRecord:
    nodes = np.array([0.0, *(chunk.middle for chunk in chunks + after)])
    averages = np.array([initial, *(chunk.stress for chunk in chunks + after)])
    stress = np.stack([np.interp(positions, nodes, c) for c in averages.T], axis=1)
    held = [
        (c.middle, programme.stress_error(c.stress[:3], c.middle),
         programme.stress_ratio_error(c.stress[:3]))
        for c in chunks
    ]  # fmt: skip
    at, error, ratio_error = np.array(held).T
    numbers = np.array([c.inertial_number for c in chunks])
    ends = np.array([c.end for c in chunks])
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
        steps=steps,
    )


def _errors(
    measure: Callable[[Floats, float], float], stress: Floats, positions: Floats
) -> Iterator[float]:
    for row, position in zip(stress, positions, strict=True):
        yield measure(row[:3], position)


def _root_mean_square(errors: Floats) -> float:
    return float(np.sqrt(np.mean(errors**2))) if errors.size else float("nan")


def _require_quality(record: TestRecord) -> None:
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
