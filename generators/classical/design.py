"""The `gp-*` datasets, their presets, and the strain paths of their splits.

The paths depend only on the seed and the name of the split: all models follow the same paths,
except for the volume change, which `granbench.generators.classical.admissible` reduces.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from granbench.generators.model_dataset import ModelDataset
from granbench.models import find_model
from granbench.paths.drawn import PathFamily
from granbench.paths.gaussian import GaussianStrain
from granbench.paths.proportional import ProportionalStrain
from granbench.paths.strain_cycles import StrainCycles

CONFINEMENT = 1e5
"""Initial mean stress of the pressure-dependent models, Pa (thesis, chapter 6)."""

FAMILIES: Mapping[str, type[PathFamily]] = {
    family.loading_family: family for family in (GaussianStrain, ProportionalStrain, StrainCycles)
}

THESIS_PATHS = GaussianStrain()
OUT_OF_DISTRIBUTION: Mapping[str, PathFamily] = {
    # The correlation length is at least 0.1 in training: these turn two to six times as often.
    "ood-rougher": GaussianStrain(l=(0.04, 0.08)),
    "ood-amplitude": GaussianStrain(v=(0.2, 0.36)),  # twice that of training
    "ood-proportional": ProportionalStrain(),
    "ood-cyclic": StrainCycles(),
}
UNSCALED = "ood-unscaled"


class ClassicalDataset(ModelDataset):
    """A dataset of strain paths through one classical model.

    Parameters
    ----------
    thesis_section : where the thesis describes the paths and the model
    initial_mean_stress : isotropic stress at the start of every path, Pa
    unscaled_split : whether one more split has strain paths whose volume change is not reduced
    """

    thesis_section: str
    initial_mean_stress: float = 0.0
    unscaled_split: bool = False


DATASETS: Mapping[str, ClassicalDataset] = {
    dataset.dataset: dataset
    for dataset in (
        ClassicalDataset(dataset="gp-j2", model="j2", thesis_section="6.2.3, 6.6.2"),
        ClassicalDataset(
            dataset="gp-dp",
            model="drucker-prager",
            thesis_section="6.2.3, 6.6.2",
            initial_mean_stress=CONFINEMENT,
            unscaled_split=True,
        ),
        ClassicalDataset(
            dataset="gp-j2-hardening", model="j2-hardening", thesis_section="6.2.3, 6.6.2"
        ),
        ClassicalDataset(dataset="gp-ime", model="ime", thesis_section="6.2.3, 5.2.1"),
        ClassicalDataset(
            dataset="gp-csuh",
            model="csuh",
            thesis_section="6.2.3, 7.4",
            initial_mean_stress=CONFINEMENT,
        ),
    )
}


class ClassicalPreset(BaseModel):
    """The size of a `gp-*` dataset.

    Parameters
    ----------
    name : of the preset
    version : of the dataset that is made with it
    train, validation, test : number of paths in these splits
    ood : number of paths in each split that is out of distribution
    steps : increments of a path
    scaled : whether the volume change of paths is reduced for pressure-dependent models
    tangents : whether the consistent tangent of every step is recorded; it takes more room than
        everything else together
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
        # The same paths with their tangents, which would make `core` too large for the repository.
        CORE.model_copy(update={"name": "tangents", "version": "1.0.0+tangents", "tangents": True}),
        # The thesis has 1000 paths, a fifth of them for validation, without reduced volume change.
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
    family : random family that the paths are drawn from
    count : number of paths
    admissible : whether the volume change is reduced so that the model can follow the paths
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    family: PathFamily
    count: int
    admissible: bool

    def described(self) -> dict[str, Any]:
        """The plan as JSON values, for the settings of a job and of a dataset."""
        return {
            "name": self.name,
            "loading_family": self.family.loading_family,
            "family": self.family.model_dump(mode="json"),
            "count": self.count,
            "admissible": self.admissible,
        }


def split_seed(split: str, seed: int) -> int:
    """Seed of the random numbers of a split, from its name and the seed of the dataset."""
    return int(np.random.SeedSequence([seed, *split.encode()]).generate_state(1)[0])


def splits(dataset: ClassicalDataset, preset: ClassicalPreset) -> list[SplitPlan]:
    """Every split of a dataset that has paths."""
    scaled = preset.scaled and find_model(dataset.model).pressure_dependent
    counts = {"train": preset.train, "validation": preset.validation, "test": preset.test}
    families = dict.fromkeys(counts, THESIS_PATHS) | dict(OUT_OF_DISTRIBUTION)
    plans = [
        SplitPlan(name=name, family=family, count=counts.get(name, preset.ood), admissible=scaled)
        for name, family in families.items()
    ]
    if dataset.unscaled_split and preset.scaled:
        plans.append(
            SplitPlan(name=UNSCALED, family=THESIS_PATHS, count=preset.ood, admissible=False)
        )
    return [plan for plan in plans if plan.count]
