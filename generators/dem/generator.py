"""The generator of the `dem-*` datasets: tests on packings of spheres in LIGGGHTS."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from granbench.generators.assembly import Assembled, read_arrays
from granbench.generators.campaign import Job
from granbench.generators.dem.design import DATASETS, PRESETS, DemDataset, TriaxialPreset
from granbench.generators.dem.engine import engine_version
from granbench.generators.dem.gradings import GRADINGS
from granbench.generators.dem.jobs import FACTS_FILE, RECORD_FILE
from granbench.generators.dem.material import ContactMaterial
from granbench.generators.dem.plan import TestPlan, planned_tests
from granbench.generators.generator import Generator
from granbench.records.schema import SCHEMA


def jobs(dataset: DemDataset, preset: TriaxialPreset, seed: int) -> list[Job]:
    """Two kinds of jobs: each specimen is prepared before its first test."""
    planned: dict[str, Job] = {}
    for plan in planned_tests(preset, seed):
        specimen = plan.specimen
        need = f"specimen/{specimen.name}"
        if need not in planned:
            planned[need] = Job(
                key=need,
                function="granbench.generators.dem.jobs:prepare",
                configuration={
                    "grading": specimen.grading,
                    "particle_count": preset.particle_count,
                    "preparation_friction": specimen.preparation_friction,
                    "pressures": list(preset.pressures),
                    "material": ContactMaterial().model_dump(),
                },
                seed=specimen.seed,
            )
        planned[plan.name] = Job(
            key=plan.name,
            function="granbench.generators.dem.jobs:shear",
            configuration={
                "loading_family": plan.programme.loading_family,
                "programme": plan.programme.model_dump(mode="json"),
                "records": preset.records,
            },
            seed=specimen.seed,
            needs=(need,),
        )
    return list(planned.values())


def assemble(
    dataset: DemDataset, preset: TriaxialPreset, seed: int, results: Mapping[str, Path]
) -> Assembled:
    """Put the results of a campaign together.

    A test that the simulation could not finish, or that misses the limits of the dataset, has no
    path; the attribute `planned_paths` says how many tests were planned.
    """
    plans = sorted(planned_tests(preset, seed), key=lambda plan: plan.name)
    done = [plan for plan in plans if plan.name in results]
    records = [read_arrays(results[plan.name] / RECORD_FILE) for plan in done]
    facts = [json.loads((results[plan.name] / FACTS_FILE).read_text()) for plan in done]
    return Assembled(
        order="principal",
        series={
            name: np.stack([record[name] for record in records]).astype(np.float32)
            for name in records[0]
        },
        paths={
            # A job may note more than the schema has, such as its number of time steps.
            **{name: [fact[name] for fact in facts] for name in facts[0] if name in SCHEMA},
            **_planned(done),
        },
        title=f"{dataset.title}, preset {preset.name}",
        engine="LIGGGHTS",
        engine_version=engine_version().removeprefix("LIGGGHTS "),
        thesis_section=dataset.thesis_section,
        configuration={"material": ContactMaterial().model_dump()},
        attributes={
            # Version 1.0.0 of dem-triaxial was published with this text, without the preset.
            "generator": "granbench generate dem-triaxial",
            "planned_paths": len(plans),
        },
    )


def _planned(plans: Sequence[TestPlan]) -> dict[str, ArrayLike]:
    """Values of each path that are known before its test."""
    specimens = [plan.specimen for plan in plans]
    gradings = [GRADINGS[specimen.grading] for specimen in specimens]
    return {
        "path_id": [plan.name for plan in plans],
        "specimen": [specimen.name for specimen in specimens],
        "grading": [specimen.grading for specimen in specimens],
        "grading_kind": [str(grading.kind) for grading in gradings],
        "fractal_dimension": [
            np.nan if grading.fractal_dimension is None else grading.fractal_dimension
            for grading in gradings
        ],
        "preparation_friction": [specimen.preparation_friction for specimen in specimens],
        "seed": [specimen.seed for specimen in specimens],
        "replicate": [specimen.replicate for specimen in specimens],
        "split": [specimen.split for specimen in specimens],
        "loading_family": [plan.programme.loading_family for plan in plans],
        "programme": [plan.programme.model_dump_json() for plan in plans],
        "initial_mean_stress": [plan.programme.pressure for plan in plans],
        "intermediate_stress_ratio": [plan.programme.intermediate_stress_ratio for plan in plans],
    }


GENERATOR = Generator(
    datasets=DATASETS,
    presets=PRESETS,
    jobs=jobs,
    assemble=assemble,
    check_machine=engine_version,
    permanent_failures=True,
)
