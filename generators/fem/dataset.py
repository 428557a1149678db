"""From the results of a finished campaign to one `fem-*` dataset."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granbench import __version__
from granbench.benchmark.axes.embedded.posed import posed, stiffest_at
from granbench.fem.statement import EMBEDDED_ANALYSES, as_attribute
from granbench.generators.classical.dataset import CONVENTIONS
from granbench.generators.classical.recorded import KEEP_BITS, rounding_attributes
from granbench.generators.fem.design import (
    THESIS_SECTION,
    AnalysisPlan,
    FemPreset,
    GroundTruth,
    embedded_of,
)
from granbench.generators.fem.jobs import POSITION, RECORD_FILE
from granbench.models.ground_truth import described
from granbench.paths.drawn import STRAIN_GRID
from granbench.tensors import COMPONENT_ORDERS

ROUNDING = (
    f"numbers without unit are multiples of 2^{int(np.log2(STRAIN_GRID))}, exact in single "
    f"precision; stresses are rounded to {KEEP_BITS} bits of mantissa, a relative error of at "
    f"most 2^-{KEEP_BITS + 1}"
)
THINNING = (
    "a step of a path is an output step of an explicit analysis, which took some tens of time "
    "steps to it; the stress is that of the analysis, which a model that is driven along the "
    "recorded steps meets up to what it makes of their size"
)


def assemble(
    truth: GroundTruth,
    preset: FemPreset,
    plans: Sequence[AnalysisPlan],
    results: Mapping[str, Path],
    seed: int,
) -> xr.Dataset:
    """One dataset from the results of a campaign.

    All paths of an analysis belong to one specimen.

    Parameters
    ----------
    truth, preset, seed : what the campaign was asked for
    plans : the analyses, in the order of the dataset's paths
    results : folder of each analysis, by its name

    Returns
    -------
    Dataset that follows `granbench.records.schema.SCHEMA`, not sealed yet; units are added on
    writing
    """
    records = [_arrays(results[plan.name] / RECORD_FILE) for plan in plans]
    counts = [len(record["point"]) for record in records]
    points = np.concatenate([record.pop("point") for record in records])
    joined = {name: np.concatenate([record[name] for record in records]) for name in records[0]}
    of_plans: dict[str, list[Any]] = {
        "specimen": [plan.name for plan in plans],
        "split": [plan.split for plan in plans],
        "loading_family": [plan.loading_family for plan in plans],
        "programme": [_programme(plan) for plan in plans],
        "initial_mean_stress": [plan.confinement for plan in plans],
        "seed": [plan.seed for plan in plans],
    }
    of_paths = {name: np.repeat(np.asarray(values), counts) for name, values in of_plans.items()}
    names = zip(of_paths["specimen"], points, strict=True)
    of_paths["path_id"] = np.array([f"{specimen}/{point:04d}" for specimen, point in names])
    of_paths |= {name: joined.pop(name) for name in POSITION}
    if "void_ratio" in joined:
        of_paths["initial_void_ratio"] = joined["void_ratio"][:, 0].astype(np.float64)
    coordinates: dict[str, Any] = {name: ("path", values) for name, values in of_paths.items()}
    coordinates["seed"] = (*coordinates["seed"], {"long_name": "seed of the random confinement"})
    return xr.Dataset(
        {
            name: (_dimensions(values), values, rounding_attributes(name))
            for name, values in joined.items()
        },
        coords={"component": list(COMPONENT_ORDERS["plane"]), **coordinates},
        attrs=_attributes(truth, preset, plans, seed),
    )


def _arrays(file: Path) -> dict[str, np.ndarray]:
    with np.load(file) as arrays:
        return dict(arrays)


def _dimensions(values: np.ndarray) -> tuple[str, ...]:
    return ("path", "step", "component")[: values.ndim]


def _programme(plan: AnalysisPlan) -> str:
    programme = plan.model_dump(mode="json", include={"problem", "mesh", "choices"})
    return json.dumps(programme, sort_keys=True)


def _attributes(
    truth: GroundTruth, preset: FemPreset, plans: Sequence[AnalysisPlan], seed: int
) -> dict[str, Any]:
    cell = truth.cell()
    ground_truth = described(cell)
    modulus = {plan.name: stiffest_at(cell, plan.confinement) for plan in plans if plan.embedded}
    configuration = {
        "ground_truth": ground_truth,
        "preset": preset.model_dump(mode="json"),
        "analyses": [plan.model_dump(mode="json") for plan in plans],
        "explicit": {plan.problem: vars(posed(plan).explicit()) for plan in plans},
        "seed": seed,
    }
    command = f"granbench generate {truth.dataset} --preset {preset.name}"
    return {
        "dataset": truth.dataset,
        "version": preset.version,
        "title": f"Gauss points of finite-element analyses with {cell.title}, preset {preset.name}",
        "generator": command + (f" --seed {seed}" if seed else ""),
        "generator_version": __version__,
        "engine": f"granbench.fem with granbench.models {cell.name}",
        "engine_version": __version__,
        "configuration": json.dumps(configuration, sort_keys=True),
        "ground_truth": json.dumps(ground_truth, sort_keys=True),
        EMBEDDED_ANALYSES: as_attribute(embedded_of(plans, preset, modulus)),
        "conventions": CONVENTIONS,
        "rounding": ROUNDING,
        "thinning": THINNING,
        "seed": seed,
        "licence": "CC-BY-4.0",
        "thesis_section": THESIS_SECTION,
    }
