"""Which model makes which `gp-*` dataset, and which strain paths are in which split.

The paths follow from the seed and the name of the split alone: all models are driven along the
same ones, but for what `granbench.generators.classical.admissible` takes off their volume change.
"""

from collections.abc import Mapping

import numpy as np
from pydantic import BaseModel, ConfigDict

from granbench.errors import RegistryError
from granbench.generators.ground_truth import ModelTruth
from granbench.models import find_model
from granbench.paths.drawn import PathFamily
from granbench.paths.gaussian import GaussianStrain
from granbench.paths.proportional import ProportionalStrain
from granbench.paths.strain_cycles import StrainCycles

CONFINEMENT = 1e5
"""Pa, initial mean stress of the pressure-dependent models (thesis, chapter 6)."""

FAMILIES: Mapping[str, type[PathFamily]] = {
    family.loading_family: family for family in (GaussianStrain, ProportionalStrain, StrainCycles)
}

THESIS_PATHS = GaussianStrain()
OUT_OF_DISTRIBUTION: Mapping[str, PathFamily] = {
    # The correlation length begins at 0.1 in training: these turn two to six times as often.
    "ood-rougher": GaussianStrain(l=(0.04, 0.08)),
    "ood-amplitude": GaussianStrain(v=(0.2, 0.36)),  # twice that of training
    "ood-proportional": ProportionalStrain(),
    "ood-cyclic": StrainCycles(),
}
UNSCALED = "ood-unscaled"


class GroundTruth(ModelTruth):
    """The model behind a dataset, and the state that its paths start from.

    Parameters
    ----------
    thesis_section : where the thesis describes the paths and the model
    initial_mean_stress : isotropic, Pa
    unscaled_split : whether a split keeps the strain paths as they were drawn
    """

    thesis_section: str
    initial_mean_stress: float = 0.0
    unscaled_split: bool = False


GROUND_TRUTHS: Mapping[str, GroundTruth] = {
    truth.dataset: truth
    for truth in (
        GroundTruth(dataset="gp-j2", model="j2", thesis_section="6.2.3, 6.6.2"),
        GroundTruth(
            dataset="gp-dp",
            model="drucker-prager",
            thesis_section="6.2.3, 6.6.2",
            initial_mean_stress=CONFINEMENT,
            unscaled_split=True,
        ),
        GroundTruth(dataset="gp-j2-hardening", model="j2-hardening", thesis_section="6.2.3, 6.6.2"),
        GroundTruth(dataset="gp-ime", model="ime", thesis_section="6.2.3, 5.2.1"),
        GroundTruth(
            dataset="gp-csuh",
            model="csuh",
            thesis_section="6.2.3, 7.4",
            initial_mean_stress=CONFINEMENT,
        ),
    )
}


class ClassicalPreset(BaseModel):
    """How many paths a `gp-*` dataset has.

    Parameters
    ----------
    version : of the dataset that it makes
    train, validation, test : paths of these splits
    ood : paths of each split that is out of distribution
    steps : increments of a path
    scaled : whether the paths of pressure-dependent models are made admissible
    tangents : whether the consistent tangent of every step is recorded; it takes more room than
        everything else
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    version: str
    train: int
    validation: int
    test: int
    ood: int
    steps: int = 200
    scaled: bool = True
    tangents: bool = False


CORE = ClassicalPreset(name="core", version="1.0.0", train=1000, validation=200, test=200, ood=50)
PRESETS: Mapping[str, ClassicalPreset] = {
    preset.name: preset
    for preset in (
        ClassicalPreset(
            name="smoke",
            version="0.0.0+smoke",
            train=24,
            validation=8,
            test=8,
            ood=4,
            steps=40,
            tangents=True,
        ),
        CORE,
        # The same paths: what `core` leaves out so that it can be kept beside the code.
        CORE.model_copy(update={"name": "tangents", "version": "1.0.0+tangents", "tangents": True}),
        # The thesis has 1000 paths, a fifth of them for validation, all as they were drawn.
        ClassicalPreset(
            name="paper",
            version="1.0.0+paper",
            train=800,
            validation=200,
            test=200,
            ood=0,
            scaled=False,
            tangents=True,
        ),
    )
}


class SplitPlan(BaseModel):
    """The paths of one split.

    Parameters
    ----------
    name : of the split
    family : that they are drawn from
    count : how many
    admissible : whether their volume change is scaled to what the model can follow
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    family: PathFamily
    count: int
    admissible: bool


def split_seed(split: str, seed: int) -> int:
    """Seed of a split's random numbers, from its name and the seed of the dataset."""
    return int(np.random.SeedSequence([seed, *split.encode()]).generate_state(1)[0])


def preset(name: str) -> ClassicalPreset:
    """The preset of that name.

    Raises
    ------
    RegistryError
        If there is none.
    """
    if name not in PRESETS:
        raise RegistryError(
            f"preset {name!r} of the gp datasets is unknown; use {', '.join(PRESETS)}"
        )
    return PRESETS[name]


def splits(truth: GroundTruth, preset: ClassicalPreset) -> list[SplitPlan]:
    """Every split of a dataset that has paths."""
    scaled = preset.scaled and find_model(truth.model).pressure_dependent
    counts = {"train": preset.train, "validation": preset.validation, "test": preset.test}
    families = dict.fromkeys(counts, THESIS_PATHS) | dict(OUT_OF_DISTRIBUTION)
    plans = [
        SplitPlan(name=name, family=family, count=counts.get(name, preset.ood), admissible=scaled)
        for name, family in families.items()
    ]
    if truth.unscaled_split and preset.scaled:
        plans.append(
            SplitPlan(name=UNSCALED, family=THESIS_PATHS, count=preset.ood, admissible=False)
        )
    return [plan for plan in plans if plan.count]
