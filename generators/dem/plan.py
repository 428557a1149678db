"""The plan of a `dem-triaxial` dataset: specimens, their tests, and their splits.

The loading plan is a lattice: specimen (g, m) - grading g, preparation friction m - has the
pressure level g + 2m + s and the ratio level 2g + m + s (both modulo 5), with its own shift s
for each numbered loading. The map is one-to-one on the 5 x 5 levels, so that a block of five
gradings by five frictions has each of the 25 (p0, b) pairs once: a rank-2 lattice, which covers
(p0, b) evenly without a random draw. The two monotonic families alternate along it. Gradings
without additional tests leave it out at every second friction, and the first test of the densest
and the loosest specimens is not on it (see `ANCHOR_PRESSURE`).
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from granbench.errors import ConfigurationError
from granbench.generators.dem.design import ALL_FRICTIONS, UNSEEN_GRADING, TriaxialPreset
from granbench.paths.cyclic import CyclicTriaxial
from granbench.paths.random_strain import RandomStrain
from granbench.paths.triaxial import ConstantMeanStress, ConstantMinorStress

Programme = ConstantMeanStress | ConstantMinorStress | CyclicTriaxial | RandomStrain
Monotonic = type[ConstantMeanStress] | type[ConstantMinorStress]
Split = Literal["train", "validation", "test", "ood-psd"]

ANCHOR_PRESSURE = 0.5e6
"""Pressure of the first test, a constant-p compression (b = 0), of the densest and the loosest
specimen of every grading, Pa: peak and critical states can be compared at equal stress."""

# Friction level of each seen grading that goes to these splits, found by random search over
# assignments that use every level at least once in each split, for a wide range of pressures and
# ratios in both. Published datasets fix it. (With the first tests at ANCHOR_PRESSURE, validation
# has no test at b = 0.5.)
TEST_FRICTION_LEVEL = (0, 1, 2, 5, 4, 6, 5, 6, 3)
VALIDATION_FRICTION_LEVEL = (1, 0, 4, 3, 6, 5, 4, 3, 2)


class SpecimenPlan(BaseModel):
    """One specimen: its grading, preparation and split."""

    model_config = ConfigDict(frozen=True)

    grading: str
    preparation_friction: float
    replicate: int
    seed: int
    split: Split

    @property
    def name(self) -> str:
        """Name of the specimen, unique in the dataset."""
        return f"{self.grading}-f{self.preparation_friction:.3f}-r{self.replicate}"


class TestPlan(BaseModel):
    """One test: a specimen, a loading programme, and its number on the specimen."""

    model_config = ConfigDict(frozen=True)
    __test__ = False

    specimen: SpecimenPlan
    programme: Programme
    number: int

    @property
    def name(self) -> str:
        """Name of the test and of its path, unique in the dataset."""
        return f"{self.specimen.name}/{self.number:02d}-{self.programme.loading_family}"


def specimens(preset: TriaxialPreset, seed: int) -> list[SpecimenPlan]:
    """Every specimen of the dataset, replicates last.

    Specimens are split by grading and preparation friction: of the seven frictions of each
    grading, one goes to test and one to validation. They differ between gradings, so that both
    splits have dense, medium and loose specimens. All specimens of the unseen grading are out of
    distribution. A replicate is in the split of its original.

    Parameters
    ----------
    preset : size of the dataset
    seed : of the dataset
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
    """Every test of the dataset, in the order in which they should run.

    The tests of a specimen follow each other, so that a finished specimen is not needed again.
    The densest and loosest specimens of all gradings come first, so that a half-finished campaign
    already shows the full range.

    Parameters
    ----------
    preset : size of the dataset
    seed : of the dataset
    """
    count = len(preset.preparation_frictions)
    levels = sorted(range(count), key=lambda m: (-abs(2 * m - count + 1), m))
    rank = {preset.preparation_frictions[m]: levels.index(m) for m in range(count)}
    ordered = sorted(specimens(preset, seed), key=lambda plan: rank[plan.preparation_friction])
    return [plan for specimen in ordered for plan in tests(preset, specimen, seed)]


def tests(preset: TriaxialPreset, specimen: SpecimenPlan, seed: int) -> list[TestPlan]:
    """Every test on one specimen; a replicate has exactly the tests of its original."""
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
        return "train"  # too few specimens to split, as in the smoke preset
    if m == TEST_FRICTION_LEVEL[g]:
        return "test"
    if m == VALIDATION_FRICTION_LEVEL[g]:
        return "validation"
    return "train"


def _replicated(preset: TriaxialPreset) -> list[tuple[int, int]]:
    """Index and friction level of each original: one for each grading, at different levels."""
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
    """Seed of one specimen; adding a grading does not change the others."""
    words = [seed, *grading.encode(), m, replicate]
    return int(np.random.SeedSequence(words).generate_state(1)[0])
