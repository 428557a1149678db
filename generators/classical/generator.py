"""The generator of the `gp-*` datasets: Gaussian-process strain paths through classical models.

One job draws the paths of all splits and runs the model along them, because starting a process
takes longer than a split of a thousand paths.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from granbench import __version__
from granbench.generators.assembly import Assembled, read_arrays
from granbench.generators.campaign import Job
from granbench.generators.classical.admissible import EXPLANATION
from granbench.generators.classical.design import (
    DATASETS,
    PRESETS,
    ClassicalDataset,
    ClassicalPreset,
    split_seed,
    splits,
)
from granbench.generators.classical.jobs import PARAMETERS_FILE, RECORD_FILE
from granbench.generators.generator import Generator
from granbench.generators.rounding import ROUNDING, rounding_attributes
from granbench.models.ground_truth import described
from granbench.records.schema import GROUND_TRUTH, PLANE_STRAIN_CONVENTIONS

EXACT_START = "what is recorded at step 0 is exactly what the model started from"
TANGENTS = (
    "`granbench generate {dataset} --preset tangents` makes the same paths with the tangent of "
    "every step, which takes up to twice the room"
)
"""Text of the attribute `tangents` of a file without them."""


def jobs(dataset: ClassicalDataset, preset: ClassicalPreset, seed: int) -> list[Job]:
    """The one job of a campaign, which makes the paths of every split in their order."""
    return [
        Job(
            key=dataset.dataset,
            function="granbench.generators.classical.jobs:run_paths",
            configuration={
                "model": dataset.model,
                "parameters": dataset.cell().values(),
                "initial_mean_stress": dataset.initial_mean_stress,
                "steps": preset.steps,
                "tangents": preset.tangents,
                "splits": [plan.described() for plan in splits(dataset, preset)],
            },
            seed=seed,
        )
    ]


def assemble(
    dataset: ClassicalDataset, preset: ClassicalPreset, seed: int, results: Mapping[str, Path]
) -> Assembled:
    """Put the result of a campaign together.

    Every path is its own specimen, because the material is the same everywhere: two splits may
    not share a strain path.
    """
    cell, plans = dataset.cell(), splits(dataset, preset)
    series = read_arrays(results[dataset.dataset] / RECORD_FILE)
    counts = [plan.count for plan in plans]
    names = [f"{plan.name}/{number:04d}" for plan in plans for number in range(plan.count)]
    paths: dict[str, ArrayLike] = {
        "path_id": names,
        "specimen": names,
        "split": np.repeat([plan.name for plan in plans], counts),
        "loading_family": np.repeat([plan.family.loading_family for plan in plans], counts),
        "initial_mean_stress": np.full(len(names), dataset.initial_mean_stress),
        "seed": np.repeat([split_seed(plan.name, seed) for plan in plans], counts).astype(np.int64),
        **read_arrays(results[dataset.dataset] / PARAMETERS_FILE),
    }
    attributes = {
        GROUND_TRUTH: described(cell),
        "conventions": PLANE_STRAIN_CONVENTIONS,
        "rounding": f"{ROUNDING}; {EXACT_START}",
    }
    if any(plan.admissible for plan in plans):
        attributes["admissible_scaling"] = EXPLANATION
    if not preset.tangents:
        attributes["tangents"] = TANGENTS.format(dataset=dataset.dataset)
    return Assembled(
        order="plane",
        series=series,
        paths=paths,
        title=f"Random strain paths through {cell.title}, preset {preset.name}",
        engine=f"granbench.models {cell.name}",
        engine_version=__version__,
        thesis_section=dataset.thesis_section,
        configuration={
            "ground_truth": described(cell),
            "start": dataset.model_dump(mode="json"),
            "splits": {
                plan.name: {key: value for key, value in plan.described().items() if key != "name"}
                for plan in plans
            },
        },
        attributes=attributes,
        variable_attributes={
            **{name: rounding_attributes(name) for name in series},
            "seed": {"long_name": "seed of the split's random numbers"},
        },
    )


GENERATOR = Generator(datasets=DATASETS, presets=PRESETS, jobs=jobs, assemble=assemble)
