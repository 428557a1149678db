"""Finite elements: CPU time of explicit and implicit biaxial tests, one core, ratios in one run.

Rivals of the explicit solver: the same J2 material and central differences as bare NumPy with the
same sparse operators, without energies, checks or records; and the solver itself with its cell
called point by point. Rival of the implicit solver, where it is installed: torch-fem with the same
mesh, von Mises material and reactions.
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from granbench.baselines.gru import GruConfiguration, GruNetwork
from granbench.baselines.whole_paths import PathCell
from granbench.cells.contract import Conditions, MaterialCell
from granbench.fem import ExplicitSettings, ImplicitSettings, PlaneMesh, rectangle, run
from granbench.fem.gauss_points import GaussPoints
from granbench.fem.operators import build_operators
from granbench.fem.problems.biaxial import HEIGHT, WIDTH, Biaxial
from granbench.fem.time_step import choose_time_step
from granbench.models import MODELS, ClassicalCell
from granbench.models.ime import IME
from granbench.models.j2 import J2

DENSITY = 2650.0
SPEED = 0.1

FEW = 3
"""Steps for which points are called one by one; all steps take the same time."""

LOAD_STEPS = 100

Seconds = dict[str, float]


@dataclass(frozen=True)
class Sizes:
    """Sizes of the timed analyses.

    Parameters
    ----------
    steps : of the explicit runs on the thesis' mesh; it has 5000
    grids : columns and rows of the meshes of growing size
    grid_steps : steps on each of them
    repeats : of each run on it, interleaved
    """

    steps: int
    grids: tuple[tuple[int, int], ...]
    grid_steps: tuple[int, ...]
    repeats: int


WHOLE = Sizes(5000, ((5, 5), (11, 22), (35, 70), (112, 224)), (1000, 500, 100, 10), 3)
QUICK = Sizes(200, ((5, 5), (11, 22)), (100, 50), 2)


def explicit_run(cell: MaterialCell, mesh: PlaneMesh, steps: int) -> Callable[[], float]:
    """CPU seconds of some steps of the biaxial test, for all its parts together."""
    step = time_step(cell, mesh)
    problem = Biaxial(confinement=1e5, end_strain=steps * step * SPEED / HEIGHT, speed=SPEED)
    settings = ExplicitSettings(time_step=step, modulus=modulus_of(cell), outputs=1)

    def timed() -> float:
        begin = time.process_time()
        run(problem, cell, solver=settings, mesh=mesh).check()
        return time.process_time() - begin

    return timed


def time_step(cell: MaterialCell, mesh: PlaneMesh) -> float:
    operators = build_operators(mesh)
    stress = Biaxial(confinement=1e5).initial_stress(operators.points, DENSITY)
    points = GaussPoints(cell, stress, operators.points)
    return choose_time_step(operators, points, ExplicitSettings(modulus=modulus_of(cell))).chosen


def gru() -> PathCell:
    """The untrained `gru` baseline: an update takes the same time as a trained one's."""
    torch.manual_seed(0)
    network = GruNetwork(GruConfiguration())
    network.increment_scale.fill_(1e-3)
    network.stress_scale.fill_(1e3)
    return PathCell(network.float(), "gru")


def modulus_of(cell: MaterialCell) -> float | None:
    """Modulus for the time step if the cell's own tangent cannot give it."""
    return 2e7 if isinstance(cell, PathCell) else None


def bare_numpy(mesh: PlaneMesh, steps: int) -> Callable[[], float]:
    """J2 and central differences on arrays, in the simplest form."""
    cell = J2()
    values = cell.values()
    bulk, twice_shear = values["bulk_modulus"], 2.0 * values["shear_modulus"]
    strength, dt = values["yield_stress"], time_step(cell, mesh)
    operators = build_operators(mesh)
    settings = ExplicitSettings()
    mass = operators.lumped_mass(DENSITY)
    y = mesh.nodes[:, 1]
    ends = np.flatnonzero((y < 1e-9) | (y > HEIGHT - 1e-9))
    driven = np.concatenate([np.zeros_like(y), -SPEED * dt * y / HEIGHT])
    half = 0.5 * settings.damping_rate * dt
    gain = dt * dt / (mass * (1.0 + half))
    gain[ends] = gain[ends + len(y)] = 0.0
    loss = (1.0 - half) / (1.0 + half)
    force = 1e5 * sum(operators.pressure_force(side) for side in ("left", "right"))

    def timed() -> float:
        begin = time.process_time()
        strain_of, force_of = operators.strain, operators.force
        stress = np.outer((1.0, 1.0, 0.0), np.full(operators.point_count, 1e5))
        relative = np.zeros_like(mass)
        for _ in range(steps):
            relative *= loss
            relative += gain * (force - force_of @ stress.ravel())
            strain = (strain_of @ (relative + driven)).reshape(3, -1)
            volumetric = strain[0] + strain[1]
            p = 0.5 * (stress[0] + stress[1]) + bulk * volumetric
            s = 0.5 * (stress[0] - stress[1]) + 0.5 * twice_shear * (strain[0] - strain[1])
            t = stress[2] + twice_shear * strain[2]
            ratio = np.minimum(1.0, strength / np.maximum(2.0 * np.sqrt(s * s + t * t), 1e-30))
            s *= ratio
            t *= ratio
            stress = np.stack([p + s, p - s, t])
        return time.process_time() - begin

    return timed


def point_by_point(cell: MaterialCell, mesh: PlaneMesh) -> float:
    """CPU seconds of one step that calls its cell for one point after the other."""
    operators = build_operators(mesh)
    stress = torch.from_numpy(Biaxial(confinement=1e5).initial_stress(operators.points, DENSITY)).T
    states = [cell.initial_state(Conditions(row[None])) for row in stress]
    increment = torch.tensor([[-1e-5, 2e-5, 1e-6]], dtype=cell.dtype)
    begin = time.process_time()
    with torch.no_grad():
        for _ in range(FEW):
            states = [cell.step(increment, state)[1] for state in states]
    return (time.process_time() - begin) / FEW


def interleaved(works: dict[str, Callable[[], float]], repeats: int) -> Seconds:
    turns = [{name: work() for name, work in works.items()} for _ in range(repeats)]
    return {name: statistics.median(turn[name] for turn in turns) for name in works}


def thesis_mesh(models: list[str], sizes: Sizes) -> dict[str, object]:
    """The 484 Gauss points and 5000 steps of Table 5.2."""
    mesh = Biaxial().mesh("table-5.2")
    cells: dict[str, MaterialCell] = {name: MODELS[name]() for name in models}
    cells["gru"] = gru()
    works = {name: explicit_run(cell, mesh, sizes.steps) for name, cell in cells.items()}
    works["j2, bare NumPy"] = bare_numpy(mesh, sizes.steps)
    seconds = interleaved(works, sizes.repeats)
    single = {name: sizes.steps * point_by_point(cell, mesh) for name, cell in cells.items()}
    return {
        "gauss_points": build_operators(mesh).point_count,
        "steps": sizes.steps,
        "cpu_seconds": seconds,
        "point_by_point_cell_cpu_seconds": single,
        "ratios": {
            "j2_over_bare_numpy": seconds["j2"] / seconds["j2, bare NumPy"],
            **{f"point_by_point_over_{name}": single[name] / seconds[name] for name in cells},
        },
    }


def growth(models: list[str], sizes: Sizes) -> list[dict[str, object]]:
    """CPU milliseconds of a step at growing numbers of Gauss points."""
    rows: list[dict[str, object]] = []
    for (columns, lines), steps in zip(sizes.grids, sizes.grid_steps, strict=True):
        mesh = rectangle(WIDTH, HEIGHT, columns, lines)
        works = {name: explicit_run(MODELS[name](), mesh, steps) for name in models}
        short = {name: explicit_run(MODELS[name](), mesh, 1) for name in models}
        whole, start = (interleaved(each, 2) for each in (works, short))
        rows.append(
            {
                "gauss_points": build_operators(mesh).point_count,
                "cpu_milliseconds_per_step": {
                    name: 1e3 * (whole[name] - start[name]) / (steps - 1) for name in models
                },
            }
        )
    return rows


IMPLICIT = Biaxial(confinement=0.0, end_strain=0.1)

TANGENT_TEST = Biaxial(confinement=1e5, end_strain=0.05)
"""Rough biaxial test with CSUH, which has no tangent in closed form."""


def implicit_run(
    cell: ClassicalCell, mesh: PlaneMesh, found: dict, problem: Biaxial = IMPLICIT
) -> Callable[[], float]:
    settings = ImplicitSettings(steps=LOAD_STEPS)

    def timed() -> float:
        begin = time.process_time()
        dataset = run(problem, cell, solver=settings, mesh=mesh).check()
        seconds = time.process_time() - begin
        found["reaction"] = float(dataset["reaction"][-1])
        found["iterations"] = int(dataset["iterations"].sum())
        return seconds

    return timed


def torch_fem_run(cell: IME, mesh: PlaneMesh, found: dict) -> Callable[[], float] | None:
    """The same body with torch-fem; None if it is not installed.

    Its yield stress grows with the length of the plastic strain's path, which in this monotonic
    test differs little from the norm that `ime` has.
    """
    try:
        from torchfem import Planar
        from torchfem.materials import IsotropicPlasticityPlaneStrain
    except ImportError:
        return None
    v = cell.values()
    fixed, modulus, start, power = (
        v[name]
        for name in ("yield_stress", "hardening_modulus", "hardening_strain", "hardening_exponent")
    )
    root = 1.5**0.5
    material = IsotropicPlasticityPlaneStrain(
        v["young_modulus"],
        v["poisson_ratio"],
        lambda q: fixed + modulus * (start + root * q) ** power,
        lambda q: modulus * power * root * (start + root * q) ** (power - 1.0),
    )
    # scikit-fem's rectangles are numbered clockwise.
    elements = torch.from_numpy(mesh.element_nodes[:, [0, 3, 2, 1, 7, 6, 5, 4]].astype(np.int64))
    body = Planar(torch.from_numpy(mesh.nodes), elements, material)
    ends = {name: torch.from_numpy(mesh.nodes_on(name)) for name in ("top", "bottom")}
    for nodes in ends.values():
        body.constraints[nodes] = True
    body.displacements[ends["top"], 1] = -IMPLICIT.end_strain * HEIGHT

    def timed() -> float:
        begin = time.process_time()
        _, forces, *_ = body.solve(
            increments=torch.linspace(0.0, 1.0, LOAD_STEPS + 1), rtol=1e-6, max_iter=25
        )
        seconds = time.process_time() - begin
        found["reaction"] = float(-forces[ends["top"], 1].sum())
        return seconds

    return timed


def implicit(models: list[str], sizes: Sizes) -> dict[str, object]:
    """The fine mesh, 8 x 16, in 100 load steps."""
    mesh = Biaxial().mesh("fine")
    found: dict[str, dict] = {name: {} for name in (*models, "torch-fem, ime")}
    works = {name: implicit_run(MODELS[name](), mesh, found[name]) for name in models}
    works["ime"] = implicit_run(IME(), mesh, found.setdefault("ime", {}))
    rival = torch_fem_run(IME(), mesh, found["torch-fem, ime"])
    if rival is not None:
        works["torch-fem, ime"] = rival
    seconds = interleaved(works, max(1, sizes.repeats - 1))
    ratios = {}
    if rival is not None:
        ratios["torch_fem_over_ime"] = seconds["torch-fem, ime"] / seconds["ime"]
    return {
        "gauss_points": build_operators(mesh).point_count,
        "load_steps": LOAD_STEPS,
        "cpu_seconds": seconds,
        "last_load_step": {name: values for name, values in found.items() if values},
        "ratios": ratios,
    }


def tangents(sizes: Sizes) -> dict[str, object]:
    """CSUH in the medium mesh, with finite differences and with automatic differentiation."""
    mesh = Biaxial().mesh("medium")
    found: dict[str, dict] = {"differences": {}, "automatic differentiation": {}}
    works = {}
    for name, last in found.items():
        cell = MODELS["csuh"]()
        cell.cheap_tangent = name != "differences"  # cheap ones are used as they are
        works[name] = implicit_run(cell, mesh, last, TANGENT_TEST)
    seconds = interleaved(works, max(1, sizes.repeats - 1))
    reactions = [last["reaction"] for last in found.values()]
    return {
        "gauss_points": build_operators(mesh).point_count,
        "load_steps": LOAD_STEPS,
        "cpu_seconds": seconds,
        "last_load_step": found,
        "reactions_differ_by": abs(reactions[1] / reactions[0] - 1.0),
        "ratios": {
            "csuh_automatic_differentiation_over_differences": seconds["automatic differentiation"]
            / seconds["differences"]
        },
    }


def installed(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def results(models: list[str], sizes: Sizes) -> dict[str, object]:
    torch.set_num_threads(1)
    torch.set_default_dtype(torch.float64)  # torch-fem has no other setting for this
    packages = ("torch", "numpy", "scipy", "scikit-fem", "torch-fem")
    elastoplastic = [name for name in models if not MODELS[name].pressure_dependent]
    return {
        "benchmark": "fem",
        "versions": {name: installed(name) for name in packages},
        "explicit": thesis_mesh(models, sizes),
        "growth": growth(models, sizes),
        "implicit": implicit(elastoplastic, sizes),
        "tangents": tangents(sizes),
    }


def print_tables(found: dict) -> None:
    console = Console()
    explicit = found["explicit"]
    table = Table("", "CPU s", "cell point by point, CPU s", title="explicit, one core")
    table.title = f"explicit, {explicit['gauss_points']} Gauss points, {explicit['steps']} steps"
    for name, seconds in explicit["cpu_seconds"].items():
        single = explicit["point_by_point_cell_cpu_seconds"].get(name)
        table.add_row(name, f"{seconds:.3g}", "–" if single is None else f"{single:.3g}")
    console.print(table)
    table = Table("CPU ms a step", *(f"{row['gauss_points']:,} points" for row in found["growth"]))
    for name in found["growth"][0]["cpu_milliseconds_per_step"]:
        cells = (row["cpu_milliseconds_per_step"][name] for row in found["growth"])
        table.add_row(name, *(f"{value:.3g}" for value in cells))
    console.print(table)
    implicit_ = found["implicit"]
    table = Table("", "CPU s", "reaction, kN/m", "iterations")
    table.title = f"implicit, {implicit_['gauss_points']} Gauss points, {LOAD_STEPS} load steps"
    for name, seconds in implicit_["cpu_seconds"].items():
        last = implicit_["last_load_step"][name]
        iterations = str(last.get("iterations", "–"))
        table.add_row(name, f"{seconds:.3g}", f"{last['reaction'] / 1e3:.5g}", iterations)
    console.print(table)
    tangents_ = found["tangents"]
    table = Table("csuh, tangent by", "CPU s", "reaction, kN/m", "iterations")
    table.title = f"implicit, {tangents_['gauss_points']} Gauss points, {LOAD_STEPS} load steps"
    for name, seconds in tangents_["cpu_seconds"].items():
        last = tangents_["last_load_step"][name]
        table.add_row(
            name, f"{seconds:.3g}", f"{last['reaction'] / 1e3:.5g}", str(last["iterations"])
        )
    console.print(table)
    console.print(f"these reactions differ by {tangents_['reactions_differ_by']:.1g}")
    for part in (explicit, implicit_, tangents_):
        for name, ratio in part["ratios"].items():
            console.print(f"{name.replace('_', ' ')}: {ratio:.3g} x")
    rival = found["versions"]["torch-fem"]
    console.print(f"torch-fem {rival}" if rival else "torch-fem is not installed: not compared")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--quick", action="store_true", help="few steps and two repeats")
    parser.add_argument(
        "--models",
        nargs="+",
        choices=list(MODELS),
        default=["ime", "csuh"],
        help="models to time in addition to j2",
    )
    arguments = parser.parse_args()
    models = list(dict.fromkeys(["j2", *arguments.models]))
    found = results(models, QUICK if arguments.quick else WHOLE)
    if arguments.json:
        print(json.dumps(found, indent=2))
        return
    print_tables(found)


if __name__ == "__main__":
    main()
