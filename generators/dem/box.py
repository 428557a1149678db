"""A periodic box of grains in LIGGGHTS that is strained in chunks without set-up between them.

A ``run`` with set-up rebuilds neighbour lists and forces, which takes a sixth of the time at 20
steps per chunk. Here ``fix deform`` reads the box edges from equal-style variables, which may be
redefined between runs, so that every chunk continues the last one (``run N pre no post no``).

The velocities of the grains contain the affine motion (``remap v``). With ``remap x`` LIGGGHTS
would move the grains without a velocity: tangential springs grow with velocities only, and would
miss the affine part of sliding (an FCC lattice then shears as if it had no friction).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from granbench.errors import EngineError
from granbench.generators.dem.chunk_average import ChunkAverage
from granbench.generators.dem.engine import Liggghts, SimulationFailure
from granbench.generators.dem.input_lines import (
    STYLES,
    contact_lines,
    pair_property,
    write_packing,
)
from granbench.generators.dem.material import ContactMaterial

SKIN_OVER_D50 = 0.1
"""Neighbour skin over d50: the fastest, by little, for narrow and wide gradings."""

SMALLEST_VOID_RATIO = 0.05
"""No packing has a smaller void ratio: below it LIGGGHTS has lost contacts without an error."""

_FULL_ORDER = [0, 1, 2, 5, 4, 3]
"""Positions in the order of LIGGGHTS (xx, yy, zz, xy, xz, yz) of the full component order."""


class GrainBox:
    """Grains in a periodic box whose edges follow prescribed strain rates.

    Make it with `from_packing` or `from_restart`; a process can make only one box.

    Parameters
    ----------
    engine : an instance that holds the grains
    diameters : (grain,), m
    material : contact material; its friction is not used
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
        skin = SKIN_OVER_D50 * _mass_median(diameters)
        engine.command(*contact_lines(material, friction, skin, self.time_step))
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
        """Make a box of grains at rest.

        Parameters
        ----------
        log_path : log of LIGGGHTS
        data_path : file for the grains
        positions : (grain, 3), m
        diameters : (grain,), m
        box_edge : of the cube, m
        material : contact material
        friction : sliding friction of all contacts
        """
        write_packing(data_path, positions, diameters, box_edge, material.density)
        engine = Liggghts(log_path)
        engine.command(*STYLES)
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
        """Make a box from a restart file, which includes the history of the contacts.

        Parameters
        ----------
        log_path : log of LIGGGHTS
        restart_path : file that `write_restart` wrote
        diameters : (grain,), m
        material : contact material
        friction : sliding friction of all contacts

        Raises
        ------
        EngineError
            If the restart file is missing.
        """
        if not Path(restart_path).is_file():
            raise EngineError(
                f"the restart file {restart_path} is missing; prepare the specimen again"
            )
        engine = Liggghts(log_path)
        engine.command("newton off")
        engine.file_command("read_restart", restart_path)
        engine.command("communicate single vel yes")
        return cls(engine, diameters, material, friction)

    def set_friction(self, friction: float) -> None:
        """Change the sliding friction of every contact from the next chunk on."""
        self.engine.command(
            "unfix coefficientFriction", pair_property("coefficientFriction", friction)
        )
        self._set_up_needed = True

    def sample_every(self, steps: int) -> None:
        """Set the number of steps between two samples of the stress; it divides every chunk."""
        if steps != self._stress.interval:
            self._stress.interval = steps
            self._set_up_needed = True

    def whole_chunk(self, steps: float) -> int:
        """Return the smallest number of steps of a chunk that is at least `steps`."""
        return self._stress.whole_chunk(steps)

    def strain(self, increment: Sequence[float] | np.ndarray, steps: int) -> np.ndarray:
        """Strain the box in one chunk.

        Parameters
        ----------
        increment : (3,), logarithmic strain, compression positive
        steps : time steps of the chunk

        Returns
        -------
        stress : (6,), Pa, compression positive, full order: virial of the contact forces
            (Eq 2.5), averaged over the chunk

        Raises
        ------
        SimulationFailure
            If grains were lost, or the void ratio is smaller than any packing can have.
        """
        if self._set_up_needed:
            self._set_up()
        lengths = self.lengths
        speeds = lengths * np.expm1(-np.asarray(increment, dtype=float)) / steps
        self._set_edge_speeds(speeds / self.time_step)
        # The edges are moved at the end of a step, so the forces see those of the step before.
        # Moved one step ahead, the edges fit the grains at every step of a chunk except the first,
        # in which they have moved at the speeds of the last chunk: contacts across a face are then
        # off by the change of speed times one time step.
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
        """Void volume over solid volume; overlaps of contacts count twice as solid."""
        return self.volume / self.solid_volume - 1

    def contact_pairs(self) -> np.ndarray:
        """Return the pairs of grains in contact, (contact, 2), numbered from 0."""
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
        """Write the state, with the history of the contacts, to a restart file.

        The file appears under its name only when it is complete.
        """
        self._set_edge_speeds(np.zeros(3))  # a restart starts from a box at rest
        partial = Path(path).with_name(Path(path).name + ".part")
        self.engine.file_command("write_restart", partial)
        partial.replace(path)
        # The command re-initialises everything: without a new set-up the edges would jump.
        self._set_up_needed = True

    def close(self) -> None:
        """End the engine."""
        self.engine.close()

    def _contact_rows(self) -> np.ndarray:
        """Both ids, a flag, the force and the area of every contact, (contact, 7)."""
        area = self.engine.compute_scalar("contact_area")
        if area == 0:
            return np.zeros((0, 7))
        count = round(area / self.engine.compute_scalar("contact_mean"))
        return self.engine.compute_local("contacts", count, 7)

    def _set_edge_speeds(self, edge_speeds: np.ndarray) -> None:
        """Change the affine part of the velocities to new edge speeds, (3,), m/s."""
        change = self._affine_velocities(edge_speeds - self._edge_speeds)
        self.engine.set_velocities(self.engine.velocities() + change)
        self._edge_speeds = edge_speeds

    def _affine_velocities(self, edge_speeds: np.ndarray) -> np.ndarray:
        place = (self.engine.positions() - self.engine.box_low()) / self.engine.box_lengths()
        return (place - 0.5) * edge_speeds

    def _set_up(self) -> None:
        """Make the fixes that store an initial state again, before a run with set-up."""
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
