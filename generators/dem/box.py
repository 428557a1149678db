"""A periodic box of grains in LIGGGHTS that is strained in chunks without set-up between them.

A ``run`` with set-up rebuilds neighbour lists and forces: at 20 steps a chunk that is a sixth of
the time. Here ``fix deform`` reads its edges from equal-style variables, which may be redefined
between runs, so every chunk is a plain continuation of the last (``run N pre no post no``).

The grains' velocities carry the affine motion (``remap v``). With ``remap x`` LIGGGHTS moves the
grains behind the contacts' back: tangential springs grow with velocities alone, and would miss the
affine part of sliding (an FCC lattice then shears as if it had no friction).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from granbench.errors import EngineError
from granbench.generators.dem.chunk_average import ChunkAverage
from granbench.generators.dem.engine import Liggghts, SimulationFailure
from granbench.generators.dem.material import ContactMaterial

SKIN_OVER_D50 = 0.1
"""Neighbour skin; the speed has a flat optimum around it, for narrow and wide gradings."""

SMALLEST_VOID_RATIO = 0.05
"""Below it no packing of these grains exists: LIGGGHTS has lost contacts without an error."""

CONTACT_MODEL = "model hertz tangential history rolling_friction epsd2"

_FULL_ORDER = [0, 1, 2, 5, 4, 3]
"""LIGGGHTS gives xx, yy, zz, xy, xz, yz; the datasets' full order is xx, yy, zz, yz, xz, xy."""

_STYLES = (
    "units si",
    "atom_style sphere",
    "atom_modify map array sort 0 0",
    "boundary p p p",
    "newton off",
    "communicate single vel yes",
)


class GrainBox:
    """Grains under periodic boundaries whose edges follow prescribed strain rates.

    Use `from_packing` or `from_restart`; a process can hold one box in its life.

    Parameters
    ----------
    engine : an instance that holds the grains
    diameters : (grain,), m
    material : contact material; its friction is not used here
    friction : sliding friction of all contacts until `set_friction`
    """

    def __init__(
        self,
        engine: Liggghts,
        diameters: np.ndarray,
        material: ContactMaterial,
        friction: float,
    ) -> None:
        self.engine = engine
        self.log_path = engine.log_path
        self.material = material
        self.grain_count = diameters.size
        self.solid_volume = float(math.pi / 6 * np.sum(diameters**3))
        self.time_step = material.time_step(float(diameters.min()) / 2)
        self._set_up_needed = True
        self._installed = False
        self._step = engine.current_step()
        self._stress = ChunkAverage(engine, "stress", [f"c_virial[{i + 1}]" for i in range(6)])
        self._edge_speeds = np.zeros(3)
        self._install(friction, SKIN_OVER_D50 * _mass_median(diameters))
        self.radii = engine.radii()
        self._start = self.lengths = engine.box_lengths()
        self._require_sound()

    @classmethod
    def from_packing(
        cls,
        log_path: Path,
        data_path: Path,
        positions: np.ndarray,
        diameters: np.ndarray,
        box_edge: float,
        material: ContactMaterial,
        friction: float,
    ) -> GrainBox:
        """Start from grains at rest: (grain, 3) and (grain,) in m, in a cube of `box_edge` m."""
        _write_packing(data_path, positions, diameters, box_edge, material.density)
        engine = Liggghts(log_path)
        engine.command(*_STYLES)
        engine.file_command("read_data", data_path)
        return cls(engine, diameters, material, friction)

    @classmethod
    def from_restart(
        cls,
        log_path: Path,
        restart_path: Path,
        diameters: np.ndarray,
        material: ContactMaterial,
        friction: float,
    ) -> GrainBox:
        """Continue a written state, contact history included."""
        if not Path(restart_path).is_file():
            raise EngineError(f"the prepared state {restart_path} is missing; prepare it again")
        engine = Liggghts(log_path)
        engine.command("newton off")
        engine.file_command("read_restart", restart_path)
        engine.command("communicate single vel yes")
        return cls(engine, diameters, material, friction)

    def set_friction(self, friction: float) -> None:
        """Change the sliding friction of every contact from the next chunk on."""
        self.engine.command(
            "unfix coefficientFriction", _pair_property("coefficientFriction", friction)
        )
        self._set_up_needed = True

    def sample_every(self, steps: int) -> None:
        """Sample the stress every `steps` steps; chunks are whole multiples of it."""
        if steps != self._stress.interval:
            self._stress.interval = steps
            self._set_up_needed = True

    def whole_chunk(self, steps: float) -> int:
        """Return the smallest number of steps, at least `steps`, that a chunk may have."""
        return self._stress.whole_chunk(steps)

    def strain(self, increment: Sequence[float] | np.ndarray, steps: int) -> np.ndarray:
        """Strain the box by a logarithmic increment (3,), compression positive, in `steps`.

        Returns
        -------
        stress : (6,), Pa, compression positive, full order: virial of the contact forces
            (Eq 2.5), averaged over the chunk

        Raises
        ------
        SimulationFailure : grains were lost, or the void ratio fell below what a packing can have
        """
        if self._set_up_needed:
            self._set_up()
        lengths = self.lengths
        speeds = lengths * np.expm1(-np.asarray(increment, dtype=float)) / steps
        self._carry(speeds / self.time_step)
        # The edges are moved at the end of a step, so the grains meet those of the step before.
        # One step ahead, they fit the grains at every step of a chunk but its first: there they
        # have moved at the speeds of the chunk before, and contacts across a face are off by one
        # time step of the change of speed.
        ahead = self._step - 1
        for axis, length, start, speed in zip("xyz", lengths, self._start, speeds, strict=True):
            self.engine.command(
                f"variable d{axis} equal {length - start:.17g}+({speed:.17g})*(step-{ahead})",
                f"variable v{axis} equal {speed / self.time_step:.17g}",
            )
        if self._set_up_needed:
            self.engine.run(steps)
            self._set_up_needed = False
        else:
            self.engine.resume(steps)
        self._step += steps
        self.lengths = lengths + speeds * steps
        self._require_sound()
        return self._stress.of_chunk(steps)[_FULL_ORDER]

    @property
    def volume(self) -> float:
        """Box volume, m3."""
        return float(np.prod(self.lengths))

    @property
    def void_ratio(self) -> float:
        """Void over solid volume; the overlaps of contacts count as solid twice."""
        return self.volume / self.solid_volume - 1

    def contact_pairs(self) -> np.ndarray:
        """Return the numbers of the grains in contact, (contact, 2), from 0."""
        return self._contact_rows()[:, :2].astype(int) - 1

    def contact_forces(self) -> np.ndarray:
        """Return the force on the first grain of every pair of `contact_pairs`, (contact, 3), N."""
        return self._contact_rows()[:, 3:6]

    def kinetic_energy(self) -> float:
        """Translational kinetic energy of the motion relative to the affine one, J."""
        mass = self.material.density * 4 / 3 * math.pi * self.radii**3
        relative = self.engine.velocities() - self._affine_velocities(self._edge_speeds)
        return float(0.5 * np.sum(mass[:, None] * relative**2))

    def stop_grains(self) -> None:
        """Stop all translation relative to the affine motion."""
        self.engine.set_velocities(self._affine_velocities(self._edge_speeds))

    def write_restart(self, path: Path) -> None:
        """Write the state with its contact history, whole or not at all."""
        self._carry(np.zeros(3))  # a restart begins with a box at rest
        partial = Path(path).with_name(Path(path).name + ".part")
        self.engine.file_command("write_restart", partial)
        partial.replace(path)
        # The command re-initialises everything: without a new set-up the next edges would jump.
        self._set_up_needed = True

    def close(self) -> None:
        """End the engine."""
        self.engine.close()

    def _contact_rows(self) -> np.ndarray:
        """Both ids, a flag, the force (3) and the area of every contact, (contact, 7)."""
        area = self.engine.compute_scalar("contact_area")
        if area == 0:
            return np.zeros((0, 7))
        count = round(area / self.engine.compute_scalar("contact_mean"))
        return self.engine.compute_local("contacts", count, 7)

    def _carry(self, edge_speeds: np.ndarray) -> None:
        """Give the grains the affine velocities of new edge speeds (3,), m/s, over the old ones."""
        change = self._affine_velocities(edge_speeds - self._edge_speeds)
        self.engine.set_velocities(self.engine.velocities() + change)
        self._edge_speeds = edge_speeds

    def _affine_velocities(self, edge_speeds: np.ndarray) -> np.ndarray:
        place = (self.engine.positions() - self.engine.box_low()) / self.engine.box_lengths()
        return (place - 0.5) * edge_speeds

    def _install(self, friction: float, skin: float) -> None:
        material = self.material
        self.engine.command(
            f"neighbor {skin:.17g} bin",
            "neigh_modify delay 0",
            f"fix modulus all property/global youngsModulus peratomtype {material.young_modulus}",
            f"fix poisson all property/global poissonsRatio peratomtype {material.poisson_ratio}",
            _pair_property("coefficientRestitution", material.restitution),
            _pair_property("coefficientFriction", friction),
            _pair_property("coefficientRollingFriction", material.rolling_friction),
            f"pair_style gran {CONTACT_MODEL}",
            "pair_coeff * *",
            f"timestep {self.time_step:.17g}",
            "fix integrate all nve/sphere",
            "thermo_style custom step atoms",
            "thermo 1000000000",
            # Of the contact forces only, and without the sum over grains that stress/atom needs.
            "compute virial all pressure thermo_temp virial",
            # LIGGGHTS takes one such compute only, and none after the first run.
            "compute contacts all pair/gran/local id force contactArea",
            "compute contact_area all reduce sum c_contacts[7]",
            "compute contact_mean all reduce ave c_contacts[7]",
        )

    def _set_up(self) -> None:
        """Renew the fixes that remember a start, so that the run's set-up finds them fresh."""
        if self._installed:
            self.engine.command("unfix edges")
            self._stress.stop()
        self._installed = True
        self._start = self.engine.box_lengths()
        for axis in "xyz":
            self.engine.command(f"variable d{axis} equal 0", f"variable v{axis} equal 0")
        self.engine.command(
            "fix edges all deform 1 x variable v_dx v_vx y variable v_dy v_vy "
            "z variable v_dz v_vz remap v"
        )
        self._stress.start(self._step)

    def _require_sound(self) -> None:
        count = self.engine.grain_count()
        if count != self.grain_count:
            raise SimulationFailure(
                f"{self.grain_count - count} of {self.grain_count} grains left the box; lower the "
                "strain rate or the time step"
            )
        if not self.void_ratio > SMALLEST_VOID_RATIO:
            raise SimulationFailure(
                f"the void ratio is {self.void_ratio:.3f}, below {SMALLEST_VOID_RATIO}: contacts "
                "are missing or the pressure is too high for the material"
            )


def _mass_median(diameters: np.ndarray) -> float:
    ordered = np.sort(diameters)
    mass = np.cumsum(ordered**3)
    return float(ordered[np.searchsorted(mass, 0.5 * mass[-1])])


def _pair_property(name: str, figure: float) -> str:
    return f"fix {name} all property/global {name} peratomtypepair 1 {figure:.17g}"


def _write_packing(
    path: Path, positions: np.ndarray, diameters: np.ndarray, box_edge: float, density: float
) -> None:
    edges = "\n".join(f"0 {box_edge:.17g} {axis}lo {axis}hi" for axis in "xyz")
    grains = "\n".join(
        f"{i} 1 {d:.17g} {density:.17g} {x:.17g} {y:.17g} {z:.17g}"
        for i, (d, (x, y, z)) in enumerate(zip(diameters, positions, strict=True), start=1)
    )
    Path(path).write_text(
        f"grains\n\n{diameters.size} atoms\n1 atom types\n{edges}\n\nAtoms\n\n{grains}\n"
    )
