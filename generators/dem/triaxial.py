"""One stress-controlled test of a prepared specimen.

The test is driven in chunks, one for each interval of the servo. A chunk takes it from a driving
length s to s' in n time steps:

                     s ........ middle ........ s' ....... middle' .......
    time step        0  1  2  ...               n  1  2  ...
    sampled             .     .     .     .     .     .     the virial, SAMPLES_PER_CHUNK times
    known                                       *  mean stress of the chunk that ends, assigned to
                                                   its middle; edges and contacts at s'
    decided                                     *  driving rate and free rates of the next chunk
    commanded        *                          *  total strain of the chunk that begins: speeds of
                                                   the edges, affine velocities of the grains

The programme prescribes the driven strain of a chunk. The mean stress determines the driving rate
of the next chunk, which keeps the inertial number at that p, and its free rates, which correct the
error at the middle and follow the change of the targets from there to the next middle: the servo
lags by one chunk. A record is taken at some s'. Its geometry is that of the moment; its stress lies
between two middles, so that the chunk that begins there is needed as well
(`granbench.generators.dem.recording`).

The edges in LIGGGHTS are one time step ahead of the grains (`GrainBox.strain`): the edges for the
forces of step k are set at the end of step k - 1, and those for step 1 by the last chunk.
`GrainBox.lengths` are the edges that the forces see, not those in LIGGGHTS.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.generators.dem.box import GrainBox
from granbench.generators.dem.measurement import contacts, inertial_number, rate_at
from granbench.generators.dem.recording import (
    Chunk,
    DrivenSeries,
    QualityError,
    Snapshot,
    TestRecord,
    record_of,
    require_quality,
)
from granbench.generators.dem.servo import StressServo
from granbench.generators.dem.specimen import PreparedSpecimen
from granbench.paths import LoadingProgramme

Floats = NDArray[np.float64]

INERTIAL_NUMBER = 2.4e-3
"""Target of the driving rate: slightly below the limit of the dataset, as p changes in a chunk."""

LONGEST_CHUNK = 5e-4
SHORTEST_CHUNK = 1e-4
CHUNKS_PER_RECORD = 3
CHUNK_STRESS_STEP = 0.012
"""Elastic stress change K d(eps) / p in a chunk; stiff packings need shorter chunks."""

FEWEST_STEPS_PER_CHUNK = 4

SAMPLES_PER_CHUNK = 5


def run_test(
    specimen: PreparedSpecimen,
    programme: LoadingProgramme,
    log_path: Path,
    records: int = 240,
) -> TestRecord:
    """Run a loading programme from its prepared state; call it in a new process.

    Parameters
    ----------
    specimen : prepared at the programme's pressure
    programme : strains and stresses that are prescribed
    log_path : log of LIGGGHTS
    records : number of recorded states after the initial one, at equal driving lengths

    Returns
    -------
    Record of the test with `records` + 1 rows

    Raises
    ------
    QualityError
        If a limit of the dataset is exceeded; the text names it.
    EngineError
        If LIGGGHTS is missing.
    SimulationFailure
        If grains were lost.
    """
    state = specimen.state(programme.pressure)
    box = GrainBox.from_restart(
        log_path, specimen.folder / state.restart_file, specimen.diameters(), specimen.material,
        specimen.material.friction,
    )  # fmt: skip
    positions = np.linspace(0.0, programme.path_length, records + 1)
    driver = _Driver(box, specimen.d50, state.bulk_modulus, programme, positions[1])
    series = _driven(driver, positions)
    box.close()
    record = record_of(programme, series)
    require_quality(record)
    return record


def _driven(driver: _Driver, positions: Floats) -> DrivenSeries:
    """Drive from record to record, and one chunk beyond the last."""
    # Contacts can be read only after a first run.
    initial = driver.hold()
    snapshots = [driver.snapshot()]
    chunks: list[Chunk] = []
    for start, end in itertools.pairwise(positions):
        chunks += driver.drive(start, end)
        snapshots.append(driver.snapshot())
    # One chunk beyond the end, so that the last stress is interpolated as well.
    beyond = driver.drive(positions[-1], positions[-1] + chunks[-1].end - chunks[-1].start)
    return DrivenSeries(positions, snapshots, initial, chunks, beyond)


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
        stiffness = bulk_modulus / programme.pressure
        a_step = self._driving_rate() * box.time_step
        longest = min(LONGEST_CHUNK, record_length / CHUNKS_PER_RECORD)
        chunk = min(max(CHUNK_STRESS_STEP / stiffness, SHORTEST_CHUNK), longest)
        self._chunk = max(chunk, FEWEST_STEPS_PER_CHUNK * a_step)
        box.sample_every(max(1, int(self._chunk / a_step / SAMPLES_PER_CHUNK)))

    def hold(self) -> Floats:
        """Return the stress of the box at rest, (6,), Pa."""
        steps = self._box.whole_chunk(self._chunk / self._driving_rate() / self._box.time_step)
        return self._box.strain(np.zeros(3), steps)

    def snapshot(self) -> Snapshot:
        """Measure the geometry of the present state."""
        return Snapshot(
            -np.log(self._box.lengths / self._start), self._box.void_ratio, contacts(self._box)
        )

    def drive(self, start: float, end: float) -> list[Chunk]:
        """Drive the programme from one driving length to another."""
        chunks = []
        corners = [s for s in self._programme.turning_points if start < s < end]
        for low, high in zip([start, *corners], [*corners, end], strict=True):
            count = max(1, math.ceil((high - low) / self._chunk - 1e-6))
            edges = np.linspace(low, high, count + 1)
            chunks += [self._drive_chunk(a, b) for a, b in itertools.pairwise(edges)]
        return chunks

    def _drive_chunk(self, start: float, end: float) -> Chunk:
        box, programme = self._box, self._programme
        if start in programme.turning_points:
            self._servo.rescale(-1.0)
            self._rates = -self._rates
        steps = box.whole_chunk((end - start) / (self._driving_rate() * box.time_step))
        duration = steps * box.time_step
        driven = programme.driven_strain(end) - programme.driven_strain(start)
        stress = box.strain(driven + programme.free_directions @ self._rates * duration, steps)
        self._mean_stress = float(stress[:3].mean())
        rate = (end - start) / duration
        if not self._mean_stress > 0:
            raise QualityError(f"the mean stress is not positive at a driving strain of {end:.4f}")
        # The tangent stiffness of contacts grows roughly as the square root of p.
        modulus = self._modulus * math.sqrt(self._mean_stress / programme.pressure)
        middle = 0.5 * (start + end)
        error = programme.targets(middle) - programme.controlled_stresses @ stress[:3]
        change = programme.targets(middle + end - start) - programme.targets(middle)
        self._rates = self._servo.rates(error, change, modulus, duration, rate)
        number = inertial_number(rate, self._d50, self._density, self._mean_stress)
        return Chunk(start, end, stress, number, steps)

    def _driving_rate(self) -> float:
        return rate_at(INERTIAL_NUMBER, self._d50, self._density, self._mean_stress)
