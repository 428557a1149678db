"""Which specimens are prepared, how each is loaded, and which split it belongs to.

The loading design is a lattice: specimen (g, m) - grading g, preparation friction m - takes the
pressure level g + 2m + s and the ratio level 2g + m + s (both modulo 5), with a shift s of its own
for each numbered loading. The map is one-to-one on the 5 x 5 levels, so a block of five gradings by
five frictions has each of the 25 (p0, b) pairs once: a rank-2 lattice, even over (p0, b) without a
random draw. The two monotonic families alternate along it; gradings that are not tested closely
skip it at every second friction, and the densest and the loosest specimens leave it with their
first test (see `ANCHOR_PRESSURE`).
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from granbench.errors import ConfigurationError, RegistryError
from granbench.paths.cyclic import CyclicTriaxial
from granbench.paths.random_strain import RandomStrain
from granbench.paths.triaxial import ConstantMeanStress, ConstantMinorStress

Programme = ConstantMeanStress | ConstantMinorStress | CyclicTriaxial | RandomStrain
Monotonic = type[ConstantMeanStress] | type[ConstantMinorStress]
Split = Literal["train", "validation", "test", "ood-psd"]

UNSEEN_GRADING = "fractal-1.5"
ANCHOR_PRESSURE = 0.5e6
"""Pa; every grading's densest and loosest specimens share a constant-p compression (b = 0) at it
as their first test, so that peak and critical states can be compared at equal stress."""

# Friction level of each seen grading that goes to these splits. Found by random search over
# assignments that use every level at least once in each split, for a wide cover of pressures and
# ratios in both; frozen since. (With the anchor tests of today, validation has none at b = 0.5.)
TEST_FRICTION_LEVEL = (0, 1, 2, 5, 4, 6, 5, 6, 3)
VALIDATION_FRICTION_LEVEL = (1, 0, 4, 3, 6, 5, 4, 3, 2)


class TriaxialPreset(BaseModel):
    """A whole `dem-triaxial` campaign.

    Every specimen gets one cyclic and one random-strain test, and every second friction level a
    monotonic one. The specimens of `closer_gradings`, whose time step is long for their median
    diameter and which are cheap for that, get two monotonic tests at every level and more of the
    other two families.

    Parameters
    ----------
    version : of the dataset that it makes
    particle_count : grains of every specimen, whatever its grading (Algorithm 1)
    gradings : names of `GRADINGS`
    preparation_frictions : mu0, rising; each makes a looser specimen
    only_gradings, only_levels : names of the gradings and indices of the frictions that are
        really prepared, a part of the campaign of all; all by default
    pressures : consolidation mean stresses p0, Pa, rising
    ratios : intermediate stress ratios b
    monotonic_strain : axial strain at which the monotonic tests end
    records : recorded steps of a test, the initial state not counted
    closer_gradings : gradings that are tested more closely
    closer_cyclic, closer_random : their further tests of these families
    replicates : specimens prepared again with another seed and loaded the same way
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
PRESETS = {
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


class SpecimenPlan(BaseModel):
    """One packing: its grading, preparation and place in the splits."""

    model_config = ConfigDict(frozen=True)

    grading: str
    preparation_friction: float
    replicate: int
    seed: int
    split: Split

    @property
    def name(self) -> str:
        """Identifier of the packing, unique in the dataset."""
        return f"{self.grading}-f{self.preparation_friction:.3f}-r{self.replicate}"


class TestPlan(BaseModel):
    """One test: a specimen and a loading programme."""

    model_config = ConfigDict(frozen=True)
    __test__ = False

    specimen: SpecimenPlan
    programme: Programme
    number: int

    @property
    def name(self) -> str:
        """Identifier of the path, unique in the dataset."""
        return f"{self.specimen.name}/{self.number:02d}-{self.programme.loading_family}"


def preset(name: str) -> TriaxialPreset:
    """The preset of that name.

    Raises
    ------
    RegistryError
        If there is none.
    """
    if name not in PRESETS:
        raise RegistryError(f"preset {name!r} of dem-triaxial is unknown; use {', '.join(PRESETS)}")
    return PRESETS[name]


def specimens(preset: TriaxialPreset, seed: int) -> list[SpecimenPlan]:
    """Every packing of the campaign, replicates last.

    Splits are by (grading, preparation friction): of the seven frictions of each grading, one
    goes to test and one to validation, another one for each grading, so that both hold dense,
    medium and loose specimens. The unseen grading is wholly out of distribution. A replicate
    has the split of its original.
    """
    plans = [
        SpecimenPlan(
            grading=grading,
            preparation_friction=friction,
            replicate=0,
            seed=_seed(seed, grading, m, 0),
            split=_split(preset, g, m),
        )
        for m, friction in enumerate(preset.preparation_frictions)
        for g, grading in enumerate(preset.gradings)
    ]
    plans += [
        plans[i].model_copy(update={"replicate": 1, "seed": _seed(seed, plans[i].grading, m, 1)})
        for i, m in _replicated(preset)
    ]
    levels = preset.only_levels or range(len(preset.preparation_frictions))
    frictions = {preset.preparation_frictions[m] for m in levels}
    gradings = preset.only_gradings or preset.gradings
    return [
        plan
        for plan in plans
        if plan.preparation_friction in frictions and plan.grading in gradings
    ]


def planned_tests(preset: TriaxialPreset, seed: int) -> list[TestPlan]:
    """Every test of the campaign, in the order in which they should run.

    All tests of a specimen stand together, so that a finished specimen is not needed again, and
    the densest and loosest specimens of all gradings come first, so that a campaign that is
    looked at half-way shows the range.
    """
    count = len(preset.preparation_frictions)
    levels = sorted(range(count), key=lambda m: (-abs(2 * m - count + 1), m))
    rank = {preset.preparation_frictions[m]: levels.index(m) for m in range(count)}
    ordered = sorted(specimens(preset, seed), key=lambda plan: rank[plan.preparation_friction])
    return [plan for specimen in ordered for plan in tests(preset, specimen, seed)]


def tests(preset: TriaxialPreset, specimen: SpecimenPlan, seed: int) -> list[TestPlan]:
    """Every test on one specimen; a replicate is loaded exactly as its original."""
    programmes = list(_programmes(preset, specimen, seed))
    return [
        TestPlan(specimen=specimen, programme=programme, number=number)
        for number, programme in enumerate(programmes)
    ]


def _programmes(preset: TriaxialPreset, specimen: SpecimenPlan, seed: int) -> Iterator[Programme]:
    g = preset.gradings.index(specimen.grading)
    m = preset.preparation_frictions.index(specimen.preparation_friction)
    levels = len(preset.pressures), len(preset.ratios)

    def pressure(shift: int) -> float:
        return preset.pressures[(g + 2 * m + shift) % levels[0]]

    def monotonic(family: Monotonic, shift: int) -> Programme:
        ratio = preset.ratios[(2 * g + m + shift) % levels[1]]
        return family(pressure=pressure(shift), b=ratio, axial_strain=preset.monotonic_strain)

    def cyclic(k: int) -> Programme:
        rng = np.random.default_rng([seed, g, m, 1, k])
        return CyclicTriaxial.draw(rng, pressure(1 + 2 * k))

    def random(k: int) -> Programme:
        rng = np.random.default_rng([seed, g, m, 2, k])
        return RandomStrain.draw(rng, pressure(4 + 2 * k))

    families: tuple[Monotonic, ...] = (ConstantMeanStress, ConstantMinorStress)
    closer = specimen.grading in preset.closer_gradings
    if m in (0, len(preset.preparation_frictions) - 1) and ANCHOR_PRESSURE in preset.pressures:
        yield ConstantMeanStress(
            pressure=ANCHOR_PRESSURE, b=0.0, axial_strain=preset.monotonic_strain
        )
    elif closer or m % 2 == 0:
        yield monotonic(families[(g + m // 2) % 2], 0)
    yield cyclic(0)
    yield random(0)
    if closer:
        yield monotonic(families[(g + m // 2 + 1) % 2], 2)
        yield from (cyclic(k) for k in range(1, 1 + preset.closer_cyclic))
        yield from (random(k) for k in range(1, 1 + preset.closer_random))


def _split(preset: TriaxialPreset, g: int, m: int) -> Split:
    if preset.gradings[g] == UNSEEN_GRADING:
        return "ood-psd"
    if preset.preparation_frictions != ALL_FRICTIONS or g >= len(TEST_FRICTION_LEVEL):
        return "train"  # too few packings to split: a smoke campaign is no benchmark
    if m == TEST_FRICTION_LEVEL[g]:
        return "test"
    if m == VALIDATION_FRICTION_LEVEL[g]:
        return "validation"
    return "train"


def _replicated(preset: TriaxialPreset) -> list[tuple[int, int]]:
    """(index of the original, its friction level): one a grading, the levels spread."""
    grading_count, friction_count = len(preset.gradings), len(preset.preparation_frictions)
    if preset.replicates > grading_count * friction_count:
        raise ConfigurationError(
            f"replicates = {preset.replicates} exceeds the {grading_count * friction_count} "
            "specimens; lower it"
        )
    chosen = []
    for k in range(preset.replicates):
        g, turn = k % grading_count, k // grading_count
        m = (3 * g + 1 + 2 * turn) % friction_count
        chosen.append((m * grading_count + g, m))
    return chosen


def _seed(seed: int, grading: str, m: int, replicate: int) -> int:
    """A seed of the packing's own, so that adding a grading changes no other packing."""
    words = [seed, *grading.encode(), m, replicate]
    return int(np.random.SeedSequence(words).generate_state(1)[0])
