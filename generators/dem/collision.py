"""One collision of two grains, or of a grain and a plane, to check the contact law.

The pair style and the properties are those of the periodic box.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.errors import ConfigurationError, EngineError
from granbench.generators.dem.engine import Liggghts
from granbench.generators.dem.input_lines import CONTACT_MODEL
from granbench.generators.dem.material import ContactMaterial

Floats = NDArray[np.float64]

STEPS_PER_CONTACT = 800
"""Time steps in the contact time of Hertz; resolves the peak force to 1e-5, the time to 1/400."""


@dataclass(frozen=True)
class Collision:
    """The result of one collision; z is the contact normal, x the direction of sliding.

    Parameters
    ----------
    time_step : s
    overlap : (step,), m, while in contact
    normal_force : (step,), N, repulsion positive
    tangential_force : (step,), N, along x on the grain
    velocity : (3,), m/s, of the grain after the contact
    spin : (3,), rad/s, of the grain after the contact
    """

    time_step: float
    overlap: Floats
    normal_force: Floats
    tangential_force: Floats
    velocity: Floats
    spin: Floats

    @property
    def contact_time(self) -> float:
        """Duration of the contact, s."""
        return self.overlap.size * self.time_step

    @property
    def impulse_ratio(self) -> float:
        """Tangential over normal impulse; the friction coefficient if the contact always slides."""
        return float(abs(self.tangential_force.sum()) / self.normal_force.sum())


def hertz_contact_time(mass: float, radius: float, modulus: float, speed: float) -> float:
    """Return the duration in s of an elastic normal impact.

    Parameters
    ----------
    mass, radius, modulus : effective m*, R*, E*, SI
    speed : of approach, m/s
    """
    return 2.868 * (mass**2 / (radius * modulus**2 * speed)) ** 0.2


def collide(
    log_path: Path,
    material: ContactMaterial,
    radius: float,
    speed: float,
    *,
    angle: float = 0.0,
    plane_stiffness: float | None = None,
) -> Collision:
    """Let a grain collide without gravity; call it in a new process.

    Parameters
    ----------
    log_path : log of LIGGGHTS; the grains are written beside it
    material : of the grain, and of the plane except for its modulus
    radius : m
    speed : of the grain, m/s; two grains have the same speed, towards each other
    angle : of the velocity from the normal, rad, from 0 to below pi / 2
    plane_stiffness : Young's modulus of a fixed plane over that of the grain; None to collide
        with an equal grain

    Returns
    -------
    collision : Collision

    Raises
    ------
    ConfigurationError
        If the grain does not approach.
    EngineError
        If LIGGGHTS is missing, or the grains do not separate again.
    """
    if not (radius > 0 and speed > 0 and 0 <= angle < math.pi / 2):
        raise ConfigurationError(
            f"radius {radius!r} and speed {speed!r} must be positive, and angle {angle!r} must be "
            "from 0 to below pi/2"
        )
    time_step = _contact_time(material, radius, speed * math.cos(angle), plane_stiffness)
    time_step /= STEPS_PER_CONTACT
    velocity = speed * np.array([math.sin(angle), 0.0, -math.cos(angle)])
    height = radius + 2.5 * time_step * abs(velocity[2])
    signs = (1.0,) if plane_stiffness is not None else (1.0, -1.0)
    data = Path(log_path).with_suffix(".data")
    _write_grains(data, height * np.array(signs), radius, material.density)
    with Liggghts(log_path) as engine:
        _install(engine, data, material, radius, time_step, plane_stiffness)
        engine.set_velocities(np.array([sign * velocity for sign in signs]))
        engine.run(0)
        return _run_contact(engine, radius, time_step)


def _contact_time(
    material: ContactMaterial, radius: float, speed: float, plane_stiffness: float | None
) -> float:
    mass = material.density * 4 / 3 * math.pi * radius**3
    modulus = material.young_modulus / (1 - material.poisson_ratio**2)
    if plane_stiffness is None:
        return hertz_contact_time(mass / 2, radius / 2, modulus / 2, 2 * speed)
    return hertz_contact_time(mass, radius, modulus / (1 + 1 / plane_stiffness), speed)


def _run_contact(engine: Liggghts, radius: float, time_step: float) -> Collision:
    overlaps, forces = [], []
    for _ in range(4 * STEPS_PER_CONTACT):
        engine.resume(1)
        # The plane is at z = 0, and so is the middle between two grains, by symmetry.
        places = engine.positions()[:, 2]
        overlap = radius - places[0] if places.size == 1 else 2 * radius - (places[0] - places[1])
        if overlap > 0:
            overlaps.append(float(overlap))
            forces.append(engine.forces()[0])
        elif overlaps:
            along = np.array(forces)
            return Collision(
                time_step=time_step,
                overlap=np.array(overlaps),
                normal_force=along[:, 2],
                tangential_force=along[:, 0],
                velocity=engine.velocities()[0],
                spin=engine.angular_velocities()[0],
            )
    raise EngineError(
        f"the grains did not separate within four contact times; see {engine.log_path}"
    )


def _install(
    engine: Liggghts,
    data: Path,
    material: ContactMaterial,
    radius: float,
    time_step: float,
    plane_stiffness: float | None,
) -> None:
    stiffer = material.young_modulus * (plane_stiffness or 1.0)
    pairs = {
        "coefficientRestitution": material.restitution,
        "coefficientFriction": material.friction,
        "coefficientRollingFriction": material.rolling_friction,
    }
    engine.command(
        "units si",
        "hard_particles yes",  # without it LIGGGHTS refuses moduli above 1 GPa
        "atom_style sphere",
        "atom_modify map array sort 0 0",
        "boundary f f f",
        "newton off",
        "communicate single vel yes",
    )
    engine.file_command("read_data", data)
    engine.command(
        f"neighbor {0.2 * radius:.17g} bin",
        "neigh_modify delay 0",
        f"fix modulus all property/global youngsModulus peratomtype "
        f"{material.young_modulus:.17g} {stiffer:.17g}",
        f"fix poisson all property/global poissonsRatio peratomtype "
        f"{material.poisson_ratio} {material.poisson_ratio}",
        *(
            f"fix {name} all property/global {name} peratomtypepair 2 " + f"{figure:.17g} " * 4
            for name, figure in pairs.items()
        ),
        f"pair_style gran {CONTACT_MODEL}",
        "pair_coeff * *",
        f"timestep {time_step:.17g}",
        "fix integrate all nve/sphere",
        "thermo_style custom step atoms",
        "thermo 1000000000",
    )
    if plane_stiffness is not None:
        engine.command(f"fix plane all wall/gran {CONTACT_MODEL} primitive type 2 zplane 0.0")


def _write_grains(path: Path, heights: Floats, radius: float, density: float) -> None:
    reach = 20 * radius
    edges = "\n".join(f"{-reach:.17g} {reach:.17g} {axis}lo {axis}hi" for axis in "xyz")
    grains = "\n".join(
        f"{i} 1 {2 * radius:.17g} {density:.17g} 0 0 {z:.17g}" for i, z in enumerate(heights, 1)
    )
    path.write_text(f"grains\n\n{len(heights)} atoms\n2 atom types\n{edges}\n\nAtoms\n\n{grains}\n")
