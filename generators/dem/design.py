"""The `dem-*` datasets, and the presets that say how many specimens and tests they have."""

from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict

UNSEEN_GRADING = "fractal-1.5"
"""Grading whose specimens are all out of distribution."""


class DemDataset(BaseModel):
    """A dataset of tests on packings of spheres.

    Parameters
    ----------
    title : what the tests are
    thesis_section : where the thesis describes them
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: str
    thesis_section: str


DATASETS: Mapping[str, DemDataset] = {
    "dem-triaxial": DemDataset(
        title="True-triaxial DEM tests of sphere packings", thesis_section="2.1"
    ),
}


class TriaxialPreset(BaseModel):
    """The size of a `dem-triaxial` dataset.

    Every specimen has one cyclic and one random-strain test, and at every second friction level
    a monotonic one. The specimens of `closer_gradings`, which are cheap because their time step
    is long for their median diameter, have two monotonic tests at every level and more tests of
    the other two families.

    Parameters
    ----------
    name : of the preset
    version : of the dataset that is made with it
    particle_count : number of grains of every specimen (Algorithm 1)
    gradings : names of `GRADINGS`
    preparation_frictions : mu0, rising; a higher one makes a looser specimen
    only_gradings, only_levels : names of the gradings and indices of the frictions that are
        prepared, to make a part of the dataset; all by default
    pressures : consolidation mean stresses p0, Pa, rising
    ratios : intermediate stress ratios b
    monotonic_strain : axial strain at which the monotonic tests end
    records : recorded steps of a test, without the initial state
    closer_gradings : gradings with more tests
    closer_cyclic, closer_random : number of their additional tests of these families
    replicates : number of specimens that are prepared again with another seed and tested in the
        same way
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    version: str
    particle_count: int
    gradings: tuple[str, ...]
    preparation_frictions: tuple[float, ...]
    only_gradings: tuple[str, ...] | None = None
    only_levels: tuple[int, ...] | None = None
    pressures: tuple[float, ...]
    ratios: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75, 1.0)
    monotonic_strain: float = 0.4
    records: int = 240
    closer_gradings: tuple[str, ...] = ()
    closer_cyclic: int = 3
    closer_random: int = 3
    replicates: int = 0


ALL_GRADINGS = (
    "bell",
    "mono",
    "binary",
    "linear",
    "fractal-m5.0",
    "fractal-1.0",
    "fractal-2.0",
    "fractal-2.5",
    "fractal-2.9",
    UNSEEN_GRADING,
)
ALL_FRICTIONS = (0.0, 0.005, 0.01, 0.04, 0.1, 0.2, 0.3)
ALL_PRESSURES = (0.1e6, 0.5e6, 1.0e6, 2.0e6, 4.0e6)

CORE = TriaxialPreset(
    name="core",
    version="1.0.0",
    particle_count=3800,  # keeps the box at three largest diameters for fractal-2.9
    gradings=ALL_GRADINGS,
    preparation_frictions=ALL_FRICTIONS,
    pressures=ALL_PRESSURES,
    closer_gradings=("mono", "bell", "binary", "fractal-2.9"),
    replicates=10,
)
PRESETS: Mapping[str, TriaxialPreset] = {
    "smoke": TriaxialPreset(
        name="smoke",
        version="0.0.0+smoke",
        particle_count=400,
        gradings=("mono",),
        preparation_frictions=(0.0, 0.3),
        pressures=(0.5e6, 1.0e6),
        monotonic_strain=0.1,
        records=60,
    ),
    "core": CORE,
    "paper": CORE.model_copy(
        update={
            "name": "paper",
            "version": "1.0.0+paper",
            "particle_count": 10_000,
            "closer_gradings": ALL_GRADINGS,
            "closer_cyclic": 31,
            "closer_random": 30,
        }
    ),
}
