"""The two jobs of a `dem-triaxial` campaign: prepare a specimen, and run one test on it."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from granbench.errors import EngineError
from granbench.generators.dem.diameters import realise_grading
from granbench.generators.dem.engine import SimulationFailure, last_error
from granbench.generators.dem.gradings import GRADINGS
from granbench.generators.dem.material import ContactMaterial
from granbench.generators.dem.plan import Programme
from granbench.generators.dem.preparation import prepare_specimen
from granbench.generators.dem.recording import TestRecord
from granbench.generators.dem.specimen import PreparedSpecimen
from granbench.generators.dem.triaxial import run_test

PROGRAMMES = {
    family.loading_family: TypeAdapter(family)
    for family in Programme.__args__  # type: ignore[attr-defined]
}
RECORD_FILE = "record.npz"
FACTS_FILE = "summary.json"
GRADING_FILE = "grading.json"
LOG_FILE = "liggghts.log"
PREPARATION_LOG_FILE = "preparation.log"
PERMANENT_FAILURES = (SimulationFailure,)
MACHINE_FAILURE = re.compile(r"\b(open|read|write|file|allocate|memory|MPI)\b", re.IGNORECASE)
"""Words in the errors of LIGGGHTS that are caused by the machine it runs on."""


def prepare(
    configuration: Mapping[str, Any], seed: int, inputs: Mapping[str, Path], out: Path
) -> None:
    """Prepare one specimen at every pressure, and write its restart files and its grading."""
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
    (out / GRADING_FILE).write_text(json.dumps(facts, indent=1))
    (out / "grains.data").unlink()


def shear(
    configuration: Mapping[str, Any], seed: int, inputs: Mapping[str, Path], out: Path
) -> None:
    """Run one test on the prepared specimen, and write its series and its facts."""
    (folder,) = inputs.values()
    specimen = PreparedSpecimen.load(folder)
    programme = PROGRAMMES[configuration["loading_family"]].validate_python(
        configuration["programme"]
    )
    record = run_test(specimen, programme, out / LOG_FILE, records=configuration["records"])
    (out / LOG_FILE).unlink()  # hundreds of kB; kept if the test fails
    state = specimen.state(programme.pressure)
    facts = json.loads((folder / GRADING_FILE).read_text())
    facts |= {
        "initial_void_ratio": state.void_ratio,
        "box_edge_ratio": specimen.box_edge_ratio,
        "servo_error_rms": record.servo_error_rms,
        "stress_ratio_error_rms": record.stress_ratio_error_rms,
        "peak_inertial_number": record.peak_inertial_number,
        "steps": record.steps,
    }
    # mypy matches the names with savez_compressed's own allow_pickle.
    np.savez_compressed(out / RECORD_FILE, **series(record))  # type: ignore[arg-type]
    (out / FACTS_FILE).write_text(json.dumps(facts, indent=1))


def series(record: TestRecord) -> dict[str, np.ndarray]:
    """Series of a test under their dataset names, single precision."""
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
    """Return the last error in the log of LIGGGHTS, or None if there is none.

    The campaign calls this function when LIGGGHTS has ended the process of a job.

    Raises
    ------
    EngineError
        If the error is about a file or about memory, so that it was not caused by the test.
    """
    for name in (LOG_FILE, PREPARATION_LOG_FILE):
        if error := last_error(out / name):
            if MACHINE_FAILURE.search(error):
                raise EngineError(error)
            return error
    return None
