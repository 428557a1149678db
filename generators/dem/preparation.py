"""Preparation of specimens: random grains, compressed isotropically and kept as restart files.

The preparation friction mu0 makes a packing dense or loose. It acts up to the lowest pressure;
there it is replaced by the friction of the material, and the packing is consolidated to the higher
pressures one after another. One preparation therefore serves all loading paths.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from granbench.errors import ConfigurationError
from granbench.generators.dem.box import GrainBox
from granbench.generators.dem.diameters import Grading
from granbench.generators.dem.engine import SimulationFailure
from granbench.generators.dem.material import ContactMaterial
from granbench.generators.dem.measurement import contacts, rate_at
from granbench.generators.dem.packing import default_solid_fraction, place_grains
from granbench.generators.dem.servo import ServoGains, StressServo
from granbench.generators.dem.specimen import (
    DIAMETERS_FILE,
    SPECIMEN_FILE,
    PreparedSpecimen,
    PreparedState,
)

APPROACH_INERTIAL_NUMBER = 3e-2
"""Inertial number while grains hardly touch, relative to the lowest pressure."""

COMPRESSION_INERTIAL_NUMBER = 1e-2
"""Largest inertial number between isotropic states; every state is at rest when it is written."""

LARGEST_STRESS_STEP = 0.05
"""Largest change of the mean stress in a chunk, over the target. It prevents an overshoot, which
would leave the packing overconsolidated."""

RESPONSE_TIME = 1.6
"""Duration of a chunk in Rayleigh times of the median grain; about 8 steps of equal spheres."""

GAINS = ServoGains(integral=0.03, integral_limit=0.1, rate_limit=1.0)
"""Gains for a constant target: the integral part only has to follow creep. With larger limits it
would wind up on the way, and overshoot the target by a third."""

PROBE_STRAIN = 2e-4

STRESS_TOLERANCE = 3e-3
"""Relative error of each normal stress at which a state counts as reached."""

ENERGY_TOLERANCE = 1e-4
"""Kinetic energy over p V at which a state counts as quasi-static; the servo alone causes nearly as
much at 4 MPa, where the grains are stiff."""

FIRST_MODULUS = 40.0
"""Bulk modulus over pressure, assumed before it has been measured."""

SMALLEST_BOX_EDGE_RATIO = 3.0
"""Smallest box edge over largest diameter; below it grains touch their own periodic images."""

SETTLED_CHUNKS = 5
QUENCH_CHUNKS = 10
"""While a state settles, the grains are stopped each time after this number of chunks."""

MOST_CHUNKS = 5000


def prepare_specimen(
    grading: Grading,
    preparation_friction: float,
    pressures: Sequence[float],
    seed: int,
    folder: Path,
    material: ContactMaterial | None = None,
) -> PreparedSpecimen:
    """Prepare one packing at every pressure; call it in a new process.

    Parameters
    ----------
    grading : the grains
    preparation_friction : mu0, up to the lowest pressure
    pressures : mean stresses p0, Pa
    seed : of the positions of the grains
    folder : is made; the description of the specimen is written last, so that a folder with one is
        complete
    material : contact material; the default one if None

    Raises
    ------
    EngineError
        If LIGGGHTS is missing.
    SimulationFailure
        If a state was not reached.
    ConfigurationError
        If a pressure is not positive or the friction is negative.
    """
    if not pressures or min(pressures) <= 0:
        raise ConfigurationError(f"pressures must be positive, not {tuple(pressures)!r} Pa")
    if preparation_friction < 0:
        raise ConfigurationError(
            f"preparation_friction must not be negative, but is {preparation_friction!r}"
        )
    material = material or ContactMaterial()
    levels = sorted(pressures)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    positions, edge = place_grains(
        grading.diameters, default_solid_fraction(grading), np.random.default_rng(seed)
    )
    np.save(folder / DIAMETERS_FILE, grading.diameters)
    box = GrainBox.from_packing(
        folder / "preparation.log", folder / "grains.data", positions, grading.diameters, edge,
        material, preparation_friction,
    )  # fmt: skip
    steps = response_steps(box, grading.d50)
    _approach(box, levels[0], grading.d50, steps)
    modulus, reached = FIRST_MODULUS * levels[0], levels[0]
    settle(box, reached, grading.d50, modulus, steps)
    box.set_friction(material.friction)
    states = []
    for pressure in levels:
        modulus *= (pressure / reached) ** 0.5
        stress, reached = settle(box, pressure, grading.d50, modulus, steps), pressure
        name = f"p{pressure / 1e6:g}.restart"
        state = {
            "pressure": pressure,
            "restart_file": name,
            "stress": tuple(stress.tolist()),
            "void_ratio": box.void_ratio,
            "coordination_number": contacts(box).coordination_number,
            "kinetic_energy_ratio": box.kinetic_energy() / (pressure * box.volume),
        }
        edge = float(box.lengths.mean())
        box.write_restart(folder / name)
        modulus = probe_bulk_modulus(box, steps)
        states.append(PreparedState(**state, bulk_modulus=modulus))
    box.close()
    if edge < SMALLEST_BOX_EDGE_RATIO * grading.d_max:
        raise SimulationFailure(
            f"the box edge is {edge / grading.d_max:.2f} of the largest diameter at "
            f"{levels[-1]:g} Pa, below {SMALLEST_BOX_EDGE_RATIO:g}; use more grains"
        )
    specimen = PreparedSpecimen(
        folder=folder, material=material, preparation_friction=preparation_friction, seed=seed,
        particle_count=grading.diameters.size, d50=grading.d50,
        box_edge_ratio=edge / grading.d_max, states=tuple(states),
    )  # fmt: skip
    partial = folder / (SPECIMEN_FILE + ".part")
    partial.write_text(specimen.model_dump_json(indent=1))
    partial.replace(folder / SPECIMEN_FILE)
    return specimen


def response_steps(box: GrainBox, d50: float) -> int:
    """Return the steps of a chunk in which the grains respond, and set the sampling of the box.

    Parameters
    ----------
    box : the grains
    d50 : median diameter by mass, m
    """
    duration = RESPONSE_TIME * box.material.rayleigh_time_step(d50 / 2)
    box.sample_every(max(1, round(duration / box.time_step / 5)))
    return box.whole_chunk(duration / box.time_step)


def settle(
    box: GrainBox, pressure: float, d50: float, bulk_modulus: float, steps: int
) -> np.ndarray:
    """Bring every normal stress to `pressure` (Pa) and wait until the grains are at rest.

    Parameters
    ----------
    box : the grains, near or below the pressure
    pressure : mean stress, Pa
    d50 : median diameter by mass, m
    bulk_modulus : estimate of the tangent K at the pressure, Pa
    steps : of a chunk, from `response_steps`

    Returns
    -------
    stress : (6,), Pa, mean over the last chunks, in which the stress was within its tolerance

    Raises
    ------
    SimulationFailure
        If the state is not reached.
    """
    rate = rate_at(COMPRESSION_INERTIAL_NUMBER, d50, box.material.density, pressure)
    duration = steps * box.time_step
    largest = min(rate * duration, LARGEST_STRESS_STEP * pressure / (3 * bulk_modulus))
    servo = StressServo(np.eye(3), np.eye(3), GAINS)
    increment = np.zeros(3)
    settled: list[np.ndarray] = []
    for number in range(MOST_CHUNKS):
        stress = box.strain(increment, steps)
        error = pressure - stress[:3]
        # Loose grains without friction lose their energy very slowly.
        since_stop = number % QUENCH_CHUNKS
        if since_stop == 0:
            box.stop_grains()
        if np.max(np.abs(error)) < STRESS_TOLERANCE * pressure:
            settled.append(stress)
            quiet = box.kinetic_energy() < ENERGY_TOLERANCE * pressure * box.volume
            if len(settled) >= SETTLED_CHUNKS and since_stop >= SETTLED_CHUNKS and quiet:
                return np.mean(settled[-SETTLED_CHUNKS:], axis=0)
        else:
            settled.clear()
        rates = servo.rates(error, np.zeros(3), bulk_modulus, duration, largest / duration)
        increment = np.clip(rates * duration, -largest, largest)
    raise SimulationFailure(
        f"the stress did not settle at {pressure:g} Pa in {MOST_CHUNKS} chunks; see {box.log_path}"
    )


def probe_bulk_modulus(box: GrainBox, steps: int) -> float:
    """Return the tangent bulk modulus K, Pa, measured by a small isotropic compression."""
    before = box.strain(np.zeros(3), steps)[:3].mean()
    box.strain(np.full(3, PROBE_STRAIN / 3), steps)
    after = box.strain(np.zeros(3), steps)[:3].mean()
    return float((after - before) / PROBE_STRAIN)


def _approach(box: GrainBox, pressure: float, d50: float, steps: int) -> None:
    """Compress the loose grains until they carry a tenth of `pressure`."""
    rate = rate_at(APPROACH_INERTIAL_NUMBER, d50, box.material.density, pressure)
    increment = np.full(3, rate * steps * box.time_step)
    for _ in range(MOST_CHUNKS):
        if box.strain(increment, steps)[:3].mean() >= 0.1 * pressure:
            return
    raise SimulationFailure(f"the packing never reached {0.1 * pressure:g} Pa; see {box.log_path}")
