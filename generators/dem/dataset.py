"""From the folders of a finished campaign to one `dem-triaxial` dataset."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granbench import __version__
from granbench.errors import DatasetError
from granbench.generators.dem.design import SpecimenPlan, TestPlan, TriaxialPreset
from granbench.generators.dem.gradings import GRADINGS
from granbench.tensors import COMPONENT_ORDERS, SHEAR_COMPONENTS

DATASET = "dem-triaxial"

SERIES = {
    "strain": ("component",),
    "stress": ("component",),
    "shear_stress": ("shear_component",),
    "fabric": ("fabric_component",),
    "void_ratio": (),
    "coordination_number": (),
    "inertial_number": (),
    "servo_error": (),
    "stress_ratio_error": (),
}
"""Recorded variables and their dimensions after (path, step)."""

SPECIMEN_FACTS = (
    "grading_index",
    "d_min",
    "d_max",
    "d50",
    "coefficient_of_uniformity",
    "coefficient_of_curvature",
    "particle_count",
    "time_step",
)
TEST_FACTS = (
    "initial_void_ratio",
    "box_edge_ratio",
    "servo_error_rms",
    "stress_ratio_error_rms",
    "peak_inertial_number",
)


def assemble(
    plans: Sequence[TestPlan],
    results: Mapping[str, Path],
    *,
    preset: TriaxialPreset,
    seed: int,
    configuration: Mapping[str, Any],
    engine_version: str,
) -> xr.Dataset:
    """One dataset from the results of a campaign.

    Parameters
    ----------
    plans : every planned test, in the order of the dataset's paths
    results : folder of each finished test, by the test's name; a test that is absent (failed
        or refused for its quality) has no path in the dataset
    preset, seed : what the campaign was asked for
    configuration : everything the records depend on, printed in full into the file
    engine_version : what the simulation engine calls itself

    Returns
    -------
    Dataset that follows `granbench.records.SCHEMA`, not sealed yet; units are added on writing

    Raises
    ------
    DatasetError
        If no test succeeded.
    """
    done = [plan for plan in plans if plan.name in results]
    if not done:
        raise DatasetError(
            "no test of the campaign succeeded, so there is no dataset to write; read the "
            "reasons in the campaign's `failed` folder"
        )
    series: dict[str, list[np.ndarray]] = {name: [] for name in SERIES}
    facts: dict[str, list[Any]] = {name: [] for name in (*SPECIMEN_FACTS, *TEST_FACTS)}
    for plan in done:
        with np.load(results[plan.name] / "record.npz") as record:
            for name in SERIES:
                series[name].append(record[name].astype(np.float32))
        summary = json.loads((results[plan.name] / "summary.json").read_text())
        for name in facts:
            facts[name].append(summary[name])
    variables = {
        name: (("path", "step", *extra), np.stack(series[name])) for name, extra in SERIES.items()
    }
    coordinates: dict[str, Any] = {
        "component": list(COMPONENT_ORDERS["principal"]),
        "shear_component": list(SHEAR_COMPONENTS),
        "fabric_component": list(COMPONENT_ORDERS["full"]),
    }
    coordinates |= {name: ("path", np.asarray(values)) for name, values in facts.items()}
    coordinates |= {
        name: ("path", np.asarray(values)) for name, values in _design_coordinates(done).items()
    }
    return xr.Dataset(
        variables,
        coords=coordinates,
        attrs={
            "dataset": DATASET,
            "version": preset.version,
            "title": f"True-triaxial DEM tests of sphere packings, preset {preset.name}",
            "generator": "granbench generate dem-triaxial",
            "generator_version": __version__,
            "engine": "LIGGGHTS",
            "engine_version": engine_version.removeprefix("LIGGGHTS "),
            "configuration": json.dumps(configuration, sort_keys=True),
            "seed": seed,
            "licence": "CC-BY-4.0",
            "thesis_section": "2.1",
            "planned_paths": len(plans),
        },
    )


def _design_coordinates(plans: Sequence[TestPlan]) -> dict[str, list[Any]]:
    specimens: list[SpecimenPlan] = [plan.specimen for plan in plans]
    gradings = [GRADINGS[specimen.grading] for specimen in specimens]
    return {
        "path_id": [plan.name for plan in plans],
        "specimen": [specimen.name for specimen in specimens],
        "grading": [specimen.grading for specimen in specimens],
        "grading_kind": [str(spec.kind) for spec in gradings],
        "fractal_dimension": [
            np.nan if spec.fractal_dimension is None else spec.fractal_dimension
            for spec in gradings
        ],
        "preparation_friction": [specimen.preparation_friction for specimen in specimens],
        "seed": [specimen.seed for specimen in specimens],
        "replicate": [specimen.replicate for specimen in specimens],
        "split": [specimen.split for specimen in specimens],
        "loading_family": [plan.programme.loading_family for plan in plans],
        "programme": [plan.programme.model_dump_json() for plan in plans],
        "initial_mean_stress": [plan.programme.pressure for plan in plans],
        "intermediate_stress_ratio": [
            plan.programme.b if hasattr(plan.programme, "b") else np.nan for plan in plans
        ],
    }
