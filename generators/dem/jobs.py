"""The two jobs of a `dem-triaxial` campaign: prepare a specimen, run one test on it.

Both are pure functions of their configuration and seed, run in a process of their own, and
leave a folder of files (see `granbench.generators.campaign`).
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from granbench.errors import EngineError
from granbench.generators.campaign import Job
from granbench.generators.dem.design import Programme, TestPlan, TriaxialPreset
from granbench.generators.dem.diameters import realise_grading
from granbench.generators.dem.engine import SimulationFailure, last_error
from granbench.generators.dem.gradings import GRADINGS
from granbench.generators.dem.material import ContactMaterial
from granbench.generators.dem.preparation import PreparedSpecimen, prepare_specimen
from granbench.generators.dem.recording import TestRecord
from granbench.generators.dem.triaxial import run_test

PROGRAMMES = {
    family.loading_family: TypeAdapter(family)
    for family in Programme.__args__  # type: ignore[attr-defined]
}
LOG_FILE = "liggghts.log"
PREPARATION_LOG_FILE = "preparation.log"
PERMANENT_FAILURES = (SimulationFailure,)
MACHINE_FAILURE = re.compile(r"\b(open|read|write|file|allocate|memory|MPI)\b", re.IGNORECASE)
"""Words of LIGGGHTS' errors that are about the machine that it runs on."""


def campaign_jobs(preset: TriaxialPreset, plans: Sequence[TestPlan]) -> list[Job]:
    """Every job of a campaign, each specimen's preparation before its first test.

    Parameters
    ----------
    preset : what the campaign is made of
    plans : the tests, in the order in which they should run
    """
    jobs: dict[str, Job] = {}
    for plan in plans:
        specimen = plan.specimen
        need = f"specimen/{specimen.name}"
        if need not in jobs:
            jobs[need] = Job(
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
        jobs[plan.name] = Job(
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
    return list(jobs.values())


def prepare(
    configuration: Mapping[str, Any], seed: int, inputs: Mapping[str, Path], out: Path
) -> None:
    """Prepare one specimen at every pressure and keep its restart files in `out`."""
    material = ContactMaterial.model_validate(configuration["material"])
    grading = realise_grading(
        GRADINGS[configuration["grading"]],
        configuration["particle_count"],
        np.random.default_rng(seed),
    )
    prepare_specimen(
        grading,
        configuration["preparation_friction"],
        configuration["pressures"],
        seed,
        out,
        material,
    )
    facts = {
        "grading_index": grading.grading_index,
        "d_min": grading.d_min,
        "d_max": grading.d_max,
        "d50": grading.d50,
        "coefficient_of_uniformity": grading.coefficient_of_uniformity,
        "coefficient_of_curvature": grading.coefficient_of_curvature,
        "particle_count": len(grading.diameters),
        "time_step": material.time_step(grading.d_min / 2),
    }
    (out / "grading.json").write_text(json.dumps(facts, indent=1))
    (out / "grains.data").unlink()


def shear(
    configuration: Mapping[str, Any], seed: int, inputs: Mapping[str, Path], out: Path
) -> None:
    """Run one test on the prepared specimen and keep its record in `out`."""
    (folder,) = inputs.values()
    specimen = PreparedSpecimen.load(folder)
    programme = PROGRAMMES[configuration["loading_family"]].validate_python(
        configuration["programme"]
    )
    record = run_test(specimen, programme, out / LOG_FILE, records=configuration["records"])
    (out / LOG_FILE).unlink()  # hundreds of kB of one line a chunk; kept where a test fails
    state = specimen.state(programme.pressure)
    facts = json.loads((folder / "grading.json").read_text())
    summary = facts | {
        "initial_void_ratio": state.void_ratio,
        "box_edge_ratio": specimen.box_edge_ratio,
        "servo_error_rms": record.servo_error_rms,
        "stress_ratio_error_rms": record.stress_ratio_error_rms,
        "peak_inertial_number": record.peak_inertial_number,
        "steps": record.steps,
    }
    # mypy matches the names with savez_compressed's own allow_pickle.
    np.savez_compressed(out / "record.npz", **series(record))  # type: ignore[arg-type]
    (out / "summary.json").write_text(json.dumps(summary, indent=1))


def series(record: TestRecord) -> dict[str, np.ndarray]:
    """The recorded variables under their dataset names, in the dataset's float32."""
    parts = {
        "strain": record.strain,
        "stress": record.stress[:, :3],
        "shear_stress": record.stress[:, 3:],
        "fabric": record.fabric,
        "void_ratio": record.void_ratio,
        "coordination_number": record.coordination_number,
        "inertial_number": record.inertial_number,
        "servo_error": record.servo_error,
        "stress_ratio_error": record.stress_ratio_error,
    }
    return {name: part.astype(np.float32) for name, part in parts.items()}


def failure_reason(out: Path) -> str | None:
    """Why LIGGGHTS ended the process: the last error of its log; None where it says nothing.

    Raises
    ------
    EngineError
        If the error is about a file or about memory: the machine's failure, not the specimen's.
    """
    for name in (LOG_FILE, PREPARATION_LOG_FILE):
        if error := last_error(out / name):
            if MACHINE_FAILURE.search(error):
                raise EngineError(error)
            return error
    return None
