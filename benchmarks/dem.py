"""CPU time of driving LIGGGHTS, and the speed-up by a second campaign worker.

Driver, servo and recording against one uninterrupted LIGGGHTS run of the same number of steps at
the same mean strain rates from the same restart: CPU time, start of the engine included, each in
a process of its own, the two by turns. And the wall-clock time of the same campaign by one worker
and by two.
"""

import argparse
import json
import multiprocessing
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from granbench.generators.campaign import run_campaign
from granbench.generators.dem.box import GrainBox
from granbench.generators.dem.design import DATASETS, TriaxialPreset
from granbench.generators.dem.diameters import realise_grading
from granbench.generators.dem.generator import jobs as triaxial_jobs
from granbench.generators.dem.gradings import GRADINGS
from granbench.generators.dem.preparation import prepare_specimen
from granbench.generators.dem.specimen import PreparedSpecimen
from granbench.generators.dem.triaxial import run_test
from granbench.paths import ConstantMeanStress

GRADINGS_MEASURED = ("mono", "fractal-1.0")
"""Equal spheres, and a wide grading with d_max / d_min = 10."""

PRESSURE = 0.5e6
RECORD_STRAIN = 0.4 / 240
"""Strain between two records of the core campaign."""

WORKERS = 2


@dataclass(frozen=True)
class Size:
    """Sizes of the simulations.

    Parameters
    ----------
    particle_count : grains of the driven specimens
    strain : axial strain of the driven tests
    repeats : of each, by turns
    campaign_particles : grains of the specimens of the small campaign
    campaign_strain : axial strain of its monotonic tests
    """

    particle_count: int
    strain: float
    repeats: int
    campaign_particles: int
    campaign_strain: float


LONG = Size(3800, 0.1, 3, 1000, 0.1)
QUICK = Size(800, 0.02, 1, 400, 0.01)


def alone(function: Callable, *arguments: object) -> dict[str, object]:
    """Result of a function in a new process, because LIGGGHTS starts only once in a process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context, initializer=silence) as executor:
        return executor.submit(function, *arguments).result()


def silence() -> None:
    """Keep the greeting of LIGGGHTS off the standard output, which is for the JSON."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def prepare(grading: str, particle_count: int, folder: Path) -> dict[str, object]:
    realised = realise_grading(GRADINGS[grading], particle_count, np.random.default_rng(0))
    prepare_specimen(realised, 0.1, (PRESSURE,), 0, folder)
    return {}


def driven(folder: Path, strain: float) -> dict[str, object]:
    """One test as a campaign runs it; all time steps are counted, not only the recorded ones."""
    chunks: list[int] = []
    whole_strain = np.zeros(3)
    strain_box = GrainBox.strain

    def counted(box: GrainBox, increment: np.ndarray, steps: int) -> np.ndarray:
        nonlocal whole_strain
        chunks.append(steps)
        whole_strain = whole_strain + increment
        return strain_box(box, increment, steps)

    GrainBox.strain = counted
    specimen = PreparedSpecimen.load(folder)
    programme = ConstantMeanStress(pressure=PRESSURE, b=0.0, axial_strain=strain)
    begin = time.process_time()
    run_test(specimen, programme, folder / "driven.log", records=round(strain / RECORD_STRAIN))
    seconds = time.process_time() - begin
    return {
        "cpu_seconds": seconds,
        "chunks": len(chunks),
        "steps": sum(chunks),
        "strain": whole_strain.tolist(),
    }


def uninterrupted(folder: Path, strain: list[float], steps: int) -> dict[str, object]:
    """The same box along the same strain in the same steps, with one `run`."""
    specimen = PreparedSpecimen.load(folder)
    state = specimen.state(PRESSURE)
    begin = time.process_time()
    box = GrainBox.from_restart(
        folder / "plain.log", folder / state.restart_file, specimen.diameters(),
        specimen.material, specimen.material.friction,
    )  # fmt: skip
    box.sample_every(steps)  # no stress is needed during the run
    box.strain(np.array(strain), steps)
    box.close()
    return {"cpu_seconds": time.process_time() - begin}


def overhead(size: Size, folder: Path) -> list[dict[str, object]]:
    """CPU times of driven and uninterrupted runs, and their ratio, by grading."""
    rows: list[dict[str, object]] = []
    for grading in GRADINGS_MEASURED:
        place = folder / grading
        alone(prepare, grading, size.particle_count, place)
        pairs = []
        for _ in range(size.repeats):
            test = alone(driven, place, size.strain)
            plain = alone(uninterrupted, place, test["strain"], test["steps"])
            pairs.append((test["cpu_seconds"], plain["cpu_seconds"]))
        rows.append(
            {
                "grading": grading,
                "particle_count": size.particle_count,
                "steps": test["steps"],
                "chunks": test["chunks"],
                "driven_cpu_seconds": statistics.median(one for one, _ in pairs),
                "uninterrupted_cpu_seconds": statistics.median(two for _, two in pairs),
                "driven_over_uninterrupted": statistics.median(one / two for one, two in pairs),
                "ratios": [one / two for one, two in pairs],
            }
        )
    return rows


def scaling(size: Size, folder: Path) -> dict[str, object]:
    """Wall-clock seconds of one campaign by one worker and by two."""
    preset = TriaxialPreset(
        name="benchmark",
        version="0",
        particle_count=size.campaign_particles,
        gradings=("mono",),
        preparation_frictions=(0.0, 0.05, 0.1, 0.3),
        pressures=(PRESSURE,),
        monotonic_strain=size.campaign_strain,
        records=60,
    )
    jobs = triaxial_jobs(DATASETS["dem-triaxial"], preset, 0)
    seconds = {}
    for workers in (1, WORKERS):
        begin = time.perf_counter()
        report = run_campaign(jobs, folder / f"{workers}", workers=workers, progress="quiet")
        seconds[workers] = time.perf_counter() - begin
    return {
        "jobs": len(jobs),
        # Packings this small may miss a limit of the dataset; the work is the same in both runs.
        "failed": len(report.failed),
        "workers": WORKERS,
        "cores": os.cpu_count(),
        "wall_seconds_one_worker": seconds[1],
        "wall_seconds": seconds[WORKERS],
        "speed_up": seconds[1] / seconds[WORKERS],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--quick", action="store_true", help="small boxes and one repeat")
    arguments = parser.parse_args()
    size = QUICK if arguments.quick else LONG
    with tempfile.TemporaryDirectory() as folder:
        rows = overhead(size, Path(folder))
        gain = scaling(size, Path(folder) / "campaign")
    if arguments.json:
        print(json.dumps({"benchmark": "dem", "overhead": rows, "scaling": gain}, indent=2))
        return
    table = Table(
        "grading", "grains", "steps", "chunks", "driven", "uninterrupted", "ratio",
        title="CPU s, one core",
    )  # fmt: skip
    for row in rows:
        times = (row["driven_cpu_seconds"], row["uninterrupted_cpu_seconds"])
        table.add_row(
            *(str(row[name]) for name in ("grading", "particle_count", "steps", "chunks")),
            *(f"{seconds:.2f}" for seconds in times),
            f"{row['driven_over_uninterrupted']:.2f}",
        )
    Console().print(table)
    Console().print(
        f"{gain['jobs']} jobs: {gain['wall_seconds_one_worker']:.1f} s by one worker, "
        f"{gain['wall_seconds']:.1f} s by {gain['workers']} on {gain['cores']} cores: "
        f"{gain['speed_up']:.2f} times as fast"
    )


if __name__ == "__main__":
    main()
