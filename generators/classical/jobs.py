"""The one job of a `gp-*` campaign: draw the paths of every split and run the model on them.

Starting a process takes longer than a split of a thousand paths, so one job makes them all.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike

from granbench.errors import ModelError
from granbench.generators.campaign import Job
from granbench.generators.classical.admissible import admissible_factors, scaled_volume
from granbench.generators.classical.design import (
    FAMILIES,
    ClassicalPreset,
    GroundTruth,
    SplitPlan,
    split_seed,
)
from granbench.generators.classical.response import isotropic_start, response
from granbench.generators.rounding import recorded
from granbench.models.classical import ClassicalCell
from granbench.models.ground_truth import recording_cell
from granbench.paths.drawn import DrawnPaths, on_strain_grid

RECORD_FILE = "record.npz"
PARAMETERS_FILE = "parameters.npz"
PERMANENT_FAILURES = (ModelError,)


def campaign_job(
    truth: GroundTruth, preset: ClassicalPreset, plans: Sequence[SplitPlan], seed: int
) -> Job:
    """The job that makes the paths of every split, in their order.

    Parameters
    ----------
    truth : the model and its start
    preset : how the paths are recorded
    plans : the splits
    seed : of the dataset
    """
    return Job(
        key=truth.dataset,
        function="granbench.generators.classical.jobs:run_paths",
        configuration={
            "model": truth.model,
            "parameters": truth.cell().values(),
            "initial_mean_stress": truth.initial_mean_stress,
            "steps": preset.steps,
            "tangents": preset.tangents,
            "splits": [
                {
                    "name": plan.name,
                    "loading_family": plan.family.loading_family,
                    "family": plan.family.model_dump(mode="json"),
                    "count": plan.count,
                    "admissible": plan.admissible,
                }
                for plan in plans
            ],
        },
        seed=seed,
    )


def run_paths(
    configuration: Mapping[str, Any], seed: int, inputs: Mapping[str, Path], out: Path
) -> None:
    """Keep what was drawn for all paths, and their records as a dataset has them, in `out`.

    Raises
    ------
    ModelError
        If the model cannot follow a path.
    """
    cell = recording_cell(configuration["model"], configuration["parameters"])
    drawn = drawn_paths(cell, configuration, seed)
    run = response(
        cell,
        torch.from_numpy(drawn.strain),
        isotropic_start(cell, configuration["initial_mean_stress"], len(drawn.strain)),
        tangents=configuration["tangents"],
    )
    series: dict[str, ArrayLike] = {
        "strain": drawn.strain,
        "stress": run.stress,
        **run.internals,
    }
    if run.tangent is not None:
        series["tangent"] = run.tangent
    record = {name: recorded(name, values) for name, values in series.items()}
    for name, values in record.items():
        broken = ~np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
        if broken.any():
            raise ModelError(
                f"{cell.name} gives no finite {name} on {broken.sum()} of {len(values)} paths, "
                f"the first is number {int(np.argmax(broken))}; draw smaller strains"
            )
    # mypy matches the names with savez's own allow_pickle.
    np.savez(out / RECORD_FILE, **record)  # type: ignore[arg-type]
    np.savez(out / PARAMETERS_FILE, **drawn.parameters)  # type: ignore[arg-type]


def drawn_paths(cell: ClassicalCell, configuration: Mapping[str, Any], seed: int) -> DrawnPaths:
    """The strain paths of every split, on the strain grid and such that the model can follow them.

    Parameters
    ----------
    cell : the model
    configuration : as of `campaign_job`
    seed : of the dataset

    Returns
    -------
    Paths in the order of the splits; a parameter that does not apply to the family of a path
    is NaN there
    """
    splits = configuration["splits"]
    parts = [
        FAMILIES[split["loading_family"]]
        .model_validate(split["family"])
        .draw(
            np.random.default_rng(split_seed(split["name"], seed)),
            split["count"],
            configuration["steps"],
        )
        for split in splits
    ]
    strain = np.concatenate([part.strain for part in parts])
    parameters = {
        name: np.concatenate(
            [part.parameters.get(name, np.full(len(part.strain), np.nan)) for part in parts]
        )
        for name in dict.fromkeys(name for part in parts for name in part.parameters)
    }
    if not cell.pressure_dependent:
        return DrawnPaths(on_strain_grid(strain), parameters)
    factor = np.ones(len(strain))
    scaled = np.repeat([split["admissible"] for split in splits], [s["count"] for s in splits])
    if scaled.any():
        pressure = configuration["initial_mean_stress"]
        factor[scaled] = admissible_factors(cell, strain[scaled], pressure)
    return DrawnPaths(scaled_volume(strain, factor), parameters | {"volumetric_factor": factor})
