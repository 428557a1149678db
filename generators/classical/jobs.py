"""The job of a `gp-*` campaign: draw the paths of every split and run the model along them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike

from granbench.errors import ModelError
from granbench.generators.classical.admissible import admissible_factors, scaled_volume
from granbench.generators.classical.design import FAMILIES, split_seed
from granbench.generators.classical.response import isotropic_start, response
from granbench.generators.rounding import recorded
from granbench.models.classical import ClassicalCell
from granbench.models.ground_truth import recording_cell
from granbench.paths.drawn import DrawnPaths, on_strain_grid

RECORD_FILE = "record.npz"
PARAMETERS_FILE = "parameters.npz"
PERMANENT_FAILURES = (ModelError,)


def run_paths(
    configuration: Mapping[str, Any], seed: int, inputs: Mapping[str, Path], out: Path
) -> None:
    """Write the records of all paths, rounded, and the parameters that were drawn for them.

    Parameters
    ----------
    configuration : of the job, see `granbench.generators.classical.generator.jobs`
    seed : of the dataset
    inputs : not used
    out : folder for the files

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
                f"{cell.name}: {name} is not finite on {broken.sum()} of {len(values)} paths, the "
                f"first is path {int(np.argmax(broken))}; draw smaller strains"
            )
    # mypy matches the names with savez's own allow_pickle.
    np.savez(out / RECORD_FILE, **record)  # type: ignore[arg-type]
    np.savez(out / PARAMETERS_FILE, **drawn.parameters)  # type: ignore[arg-type]


def drawn_paths(cell: ClassicalCell, configuration: Mapping[str, Any], seed: int) -> DrawnPaths:
    """Draw the strain paths of every split, on the strain grid and admissible for the model.

    Parameters
    ----------
    cell : the model
    configuration : of the job
    seed : of the dataset

    Returns
    -------
    Paths in the order of the splits; a parameter that does not apply to a path is NaN
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
