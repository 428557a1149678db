"""One stress-controlled test of a prepared specimen, driven interval by interval of its servo.

An interval, here a chunk, takes the test from a driving length s to s' in n time steps:

                     s ........ middle ........ s' ....... middle' .......
    time step        0  1  2  ...               n  1  2  ...
    sampled             .     .     .     .     .     .     the virial, some SAMPLES_A_CHUNK times
    known                                       *  mean stress of the chunk that ends, which stands
                                                   for its middle; edges and contacts at s'
    decided                                     *  driving rate and free rates of the next chunk
    commanded        *                          *  whole strain of the chunk that begins: speeds of
                                                   the edges, affine velocities of the grains

The driven strain of a chunk is the programme's, known in advance. From the mean stress follow the
driving rate of the next chunk, which holds the inertial number at that p, and its free rates,
which answer the error at the middle and the targets' change from there to the next middle: the
servo lags by one chunk. A record is taken at some s'. Its geometry is that of the moment; its
stress lies between two middles, so it needs the chunk that begins there too
(`granbench.generators.dem.recording`).

The edges in the engine are one time step ahead of the grains (`GrainBox.strain`): those that the
grains meet in step k are put in place at the end of step k - 1, and those of step 1 still by the
chunk before. `GrainBox.lengths` are the grains' edges, not the engine's.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.generators.dem.box import GrainBox
from granbench.generators.dem.measurement import contacts, inertial_number, rate_at
from granbench.generators.dem.preparation import PreparedSpecimen
from granbench.generators.dem.recording import (
    Chunk,
    DrivenSeries,
    QualityError,
    Snapshot,
    TestRecord,
    assemble,
    require_quality,
)
from granbench.generators.dem.servo import StressServo
from granbench.paths import LoadingProgramme

Floats = NDArray[np.float64]

INERTIAL_NUMBER = 2.4e-3
"""What is driven at: a little below the dataset's bound, as p changes in a chunk."""

LONGEST_CHUNK = 5e-4
SHORTEST_CHUNK = 1e-4
CHUNKS_A_RECORD = 3
CHUNK_STRESS_STEP = 0.012
"""Elastic stress change K d(eps) / p in a chunk: stiff packings need shorter chunks."""

FEWEST_STEPS_A_CHUNK = 4

SAMPLES_A_CHUNK = 5


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
    EngineError : the engine is missing
    SimulationFailure : grains were lost
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
    record = assemble(programme, series)
    require_quality(record)
    return record


def _driven(driver: _Driver, positions: Floats) -> DrivenSeries:
    """Drive from record to record, and a little beyond the last."""
    # Contacts can be read only after a first run.
    initial = driver.hold()
    snapshots = [driver.snapshot()]
    chunks: list[Chunk] = []
    for start, end in itertools.pairwise(positions):
        chunks += driver.drive(start, end)
        snapshots.append(driver.snapshot())
    # One chunk beyond the end, so that the last record is an interpolation too.
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
        longest = min(LONGEST_CHUNK, record_length / CHUNKS_A_RECORD)
        chunk = min(max(CHUNK_STRESS_STEP / stiffness, SHORTEST_CHUNK), longest)
        self._chunk = max(chunk, FEWEST_STEPS_A_CHUNK * a_step)
        box.sample_every(max(1, int(self._chunk / a_step / SAMPLES_A_CHUNK)))

    def hold(self) -> Floats:
        """Return the stress (6,) of the box at rest."""
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
            raise QualityError(f"the mean stress vanished at a driving strain of {end:.4f}")
        # The tangent stiffness of contacts grows about with the root of p.
        modulus = self._modulus * math.sqrt(self._mean_stress / programme.pressure)
        middle = 0.5 * (start + end)
        error = programme.targets(middle) - programme.controlled_stresses @ stress[:3]
        change = programme.targets(middle + end - start) - programme.targets(middle)
        self._rates = self._servo.rates(error, change, modulus, duration, rate)
        number = inertial_number(rate, self._d50, self._density, self._mean_stress)
        return Chunk(start, end, stress, number, steps)

    def _driving_rate(self) -> float:
        return rate_at(INERTIAL_NUMBER, self._d50, self._density, self._mean_stress)
