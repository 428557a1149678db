"""A prepared specimen: its grains and its isotropic states, in one folder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from granbench.errors import ConfigurationError, EngineError
from granbench.generators.dem.material import ContactMaterial

SPECIMEN_FILE = "specimen.json"
DIAMETERS_FILE = "diameters.npy"


class PreparedState(BaseModel):
    """An isotropic state that a test starts from.

    Parameters
    ----------
    pressure : target mean stress, Pa
    restart_file : name of the restart file in the specimen's folder
    stress : (6,), Pa, compression positive, full order
    void_ratio, coordination_number : of the state
    bulk_modulus : tangent K, Pa, from a small compression after the file was written
    kinetic_energy_ratio : kinetic energy over p V
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    pressure: float
    restart_file: str
    stress: tuple[float, ...]
    void_ratio: float
    coordination_number: float
    bulk_modulus: float
    kinetic_energy_ratio: float


class PreparedSpecimen(BaseModel):
    """A prepared packing: its grains and its states in one folder.

    Parameters
    ----------
    folder : with the restart files
    material : contact material
    preparation_friction : mu0
    seed : of the positions of the grains
    particle_count : number of grains
    d50 : median diameter by mass, m, the characteristic length of Eq 2.6
    box_edge_ratio : box edge over the largest diameter at the highest pressure
    states : one for each pressure
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    folder: Path = Field(exclude=True)
    material: ContactMaterial
    preparation_friction: float
    seed: int
    particle_count: int
    d50: float
    box_edge_ratio: float
    states: tuple[PreparedState, ...]

    def state(self, pressure: float) -> PreparedState:
        """Return the state at a pressure, Pa.

        Raises
        ------
        ConfigurationError
            If no state was prepared at it.
        """
        for state in self.states:
            if abs(state.pressure / pressure - 1) < 1e-9:
                return state
        known = ", ".join(f"{state.pressure:g}" for state in self.states)
        raise ConfigurationError(f"pressure {pressure:g} Pa was not prepared; use one of {known}")

    def diameters(self) -> np.ndarray:
        """Return the diameters of the grains, (grain,), m."""
        return np.load(self.folder / DIAMETERS_FILE)

    @classmethod
    def load(cls, folder: Path) -> Self:
        """Read a prepared specimen from its folder.

        Raises
        ------
        EngineError
            If the folder has no specimen.
        """
        path = Path(folder) / SPECIMEN_FILE
        try:
            facts = json.loads(path.read_text())
            return cls.model_validate(facts | {"folder": Path(folder)})
        except (OSError, ValueError) as broken:
            raise EngineError(
                f"{path} is not the description of a specimen; prepare it again"
            ) from broken
