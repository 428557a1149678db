"""From the result of a finished campaign to one `gp-*` dataset."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granbench import __version__
from granbench.generators.classical.admissible import EXPLANATION
from granbench.generators.classical.design import (
    ClassicalPreset,
    GroundTruth,
    SplitPlan,
    split_seed,
)
from granbench.generators.classical.jobs import PARAMETERS_FILE, RECORD_FILE
from granbench.generators.rounding import ROUNDING, rounding_attributes
from granbench.models.ground_truth import described
from granbench.tensors import COMPONENT_ORDERS

CONVENTIONS = (
    "compression positive; SI units; strain is small and cumulative from step 0; shear "
    "components are tensor components; plane strain where the model is three-dimensional"
)
DIMENSIONS = {
    "strain": ("component",),
    "stress": ("component",),
    "tangent": ("component", "strain_component"),
}
"""Of the recorded variables after (path, step); internal variables have no further one."""
TANGENTS = (
    "`{command} --preset tangents` makes the same paths with the tangent of every step, which "
    "takes up to twice the room"
)


def assemble(
    truth: GroundTruth,
    preset: ClassicalPreset,
    plans: Sequence[SplitPlan],
    result: Path,
    seed: int,
) -> xr.Dataset:
    """One dataset from the result of a campaign.

    Every path is a specimen of its own: the material is the same everywhere, and what two
    splits could share is a strain path.

    Parameters
    ----------
    truth, preset, seed : what the campaign was asked for
    plans : the splits, in the order of the dataset's paths
    result : folder of the campaign's job

    Returns
    -------
    Dataset that follows `granbench.records.schema.SCHEMA`, not sealed yet; units are added on
    writing
    """
    series, drawn = _arrays(result / RECORD_FILE), _arrays(result / PARAMETERS_FILE)
    counts = [plan.count for plan in plans]
    names = [f"{plan.name}/{number:04d}" for plan in plans for number in range(plan.count)]
    order = list(COMPONENT_ORDERS["plane"])
    axes = {"component": order} | ({"strain_component": order} if "tangent" in series else {})
    of_paths: dict[str, Any] = {
        "path_id": names,
        "specimen": names,
        "split": np.repeat([plan.name for plan in plans], counts),
        "loading_family": np.repeat([plan.family.loading_family for plan in plans], counts),
        "initial_mean_stress": np.full(len(names), truth.initial_mean_stress),
        **drawn,
    }
    if "void_ratio" in series:
        of_paths["initial_void_ratio"] = series["void_ratio"][:, 0].astype(np.float64)
    seeds = np.repeat([split_seed(plan.name, seed) for plan in plans], counts).astype(np.int64)
    return xr.Dataset(
        {
            name: (
                ("path", "step", *DIMENSIONS.get(name, ())),
                values,
                rounding_attributes(name),
            )
            for name, values in series.items()
        },
        coords={
            **axes,
            **{name: ("path", np.asarray(values)) for name, values in of_paths.items()},
            "seed": ("path", seeds, {"long_name": "seed of the split's random numbers"}),
        },
        attrs=_attributes(truth, preset, plans, seed),
    )


def _arrays(file: Path) -> dict[str, np.ndarray]:
    with np.load(file) as arrays:
        return dict(arrays)


def _attributes(
    truth: GroundTruth, preset: ClassicalPreset, plans: Sequence[SplitPlan], seed: int
) -> dict[str, Any]:
    cell = truth.cell()
    ground_truth = described(cell)
    configuration = {
        "ground_truth": ground_truth,
        "start": truth.model_dump(mode="json"),
        "preset": preset.model_dump(mode="json"),
        "splits": {
            plan.name: {
                "loading_family": plan.family.loading_family,
                "family": plan.family.model_dump(mode="json"),
                "count": plan.count,
                "admissible": plan.admissible,
            }
            for plan in plans
        },
        "seed": seed,
    }
    command = f"granbench generate {truth.dataset}"
    scaling = {"admissible_scaling": EXPLANATION} if any(p.admissible for p in plans) else {}
    tangents = {} if preset.tangents else {"tangents": TANGENTS.format(command=command)}
    return {
        "dataset": truth.dataset,
        "version": preset.version,
        "title": f"Random strain paths through {cell.title}, preset {preset.name}",
        "generator": f"{command} --preset {preset.name}" + (f" --seed {seed}" if seed else ""),
        "generator_version": __version__,
        "engine": f"granbench.models {cell.name}",
        "engine_version": __version__,
        "configuration": json.dumps(configuration, sort_keys=True),
        "ground_truth": json.dumps(ground_truth, sort_keys=True),
        "conventions": CONVENTIONS,
        "rounding": ROUNDING,
        "seed": seed,
        "licence": "CC-BY-4.0",
        "thesis_section": truth.thesis_section,
        **scaling,
        **tangents,
    }
