"""The generator of the `fem-*` datasets: Gauss-point histories of finite-element analyses."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from granbench import __version__
from granbench.fem.stated_problem import build_problem
from granbench.fem.statement import EMBEDDED_ANALYSES, as_attribute
from granbench.generators.assembly import Assembled, read_arrays
from granbench.generators.campaign import Job
from granbench.generators.fem.design import DATASETS, PRESETS, FemDataset, FemPreset
from granbench.generators.fem.jobs import POINT, POSITION, RECORD_FILE
from granbench.generators.fem.plan import AnalysisPlan, embedded_analyses_of, planned_analyses
from granbench.generators.generator import Generator
from granbench.generators.rounding import ROUNDING, rounding_attributes
from granbench.models.ground_truth import described
from granbench.models.isotropic_start import stiffest_normal_modulus
from granbench.records.schema import GROUND_TRUTH, PLANE_STRAIN_CONVENTIONS

THESIS_SECTION = "5.3"
THINNING = (
    "a step of a path is an output step of an explicit analysis, which took some tens of time "
    "steps to it; the stress is that of the analysis, which a model that is driven along the "
    "recorded steps meets up to what it makes of their size"
)
"""Text of the global attribute `thinning` of a file."""


def jobs(dataset: FemDataset, preset: FemPreset, seed: int) -> list[Job]:
    """One job for each analysis."""
    parameters = dataset.cell().values()
    return [
        Job(
            key=plan.name,
            function="granbench.generators.fem.jobs:run_analysis",
            configuration={
                "model": dataset.model,
                "parameters": parameters,
                "steps": preset.steps,
                "plan": plan.model_dump(mode="json"),
            },
            seed=seed,
        )
        for plan in planned_analyses(dataset, preset, seed)
    ]


def assemble(
    dataset: FemDataset, preset: FemPreset, seed: int, results: Mapping[str, Path]
) -> Assembled:
    """Put the results of a campaign together; all paths of an analysis belong to one specimen."""
    plans = planned_analyses(dataset, preset, seed)
    records = [read_arrays(results[plan.name] / RECORD_FILE) for plan in plans]
    points = np.concatenate([record.pop(POINT) for record in records])
    joined = {name: np.concatenate([record[name] for record in records]) for name in records[0]}
    counts = [len(record[POSITION[0]]) for record in records]
    by_plan: dict[str, ArrayLike] = {
        "specimen": [plan.name for plan in plans],
        "split": [plan.split for plan in plans],
        "loading_family": [plan.loading_family for plan in plans],
        "programme": [_programme(plan) for plan in plans],
        "initial_mean_stress": [plan.confinement for plan in plans],
        "seed": [plan.seed for plan in plans],
    }
    paths = {name: np.repeat(np.asarray(values), counts) for name, values in by_plan.items()}
    names = zip(paths["specimen"], points, strict=True)
    paths["path_id"] = np.array([f"{specimen}/{point:04d}" for specimen, point in names])
    paths |= {name: joined.pop(name) for name in POSITION}
    cell = dataset.cell()
    modulus = {
        plan.name: stiffest_normal_modulus(cell, plan.confinement)
        for plan in plans
        if plan.embedded
    }
    return Assembled(
        order="plane",
        series=joined,
        paths=paths,
        title=f"Gauss points of finite-element analyses with {cell.title}, preset {preset.name}",
        engine=f"granbench.fem with granbench.models {cell.name}",
        engine_version=__version__,
        thesis_section=THESIS_SECTION,
        configuration={
            "ground_truth": described(cell),
            "analyses": [plan.model_dump(mode="json") for plan in plans],
            "explicit": {plan.problem: vars(build_problem(plan).explicit()) for plan in plans},
        },
        attributes={
            GROUND_TRUTH: described(cell),
            EMBEDDED_ANALYSES: as_attribute(embedded_analyses_of(plans, preset, modulus)),
            "conventions": PLANE_STRAIN_CONVENTIONS,
            "rounding": ROUNDING,
            "thinning": THINNING,
        },
        variable_attributes={
            **{name: rounding_attributes(name) for name in joined},
            "seed": {"long_name": "seed of the random confinement"},
        },
    )


def _programme(plan: AnalysisPlan) -> str:
    programme = plan.model_dump(mode="json", include={"problem", "mesh", "choices"})
    return json.dumps(programme, sort_keys=True)


GENERATOR = Generator(datasets=DATASETS, presets=PRESETS, jobs=jobs, assemble=assemble)
