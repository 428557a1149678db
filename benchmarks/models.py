"""Classical models: CPU time of one update, of whole paths, and of back-propagation through them.

One core, ratios within one run. Rivals for J2: the textbook's return, point by point in NumPy,
and torch-fem's batched von Mises plasticity where it is installed. The latter always computes the
consistent tangent, so it is compared with J2 in three dimensions with its tangent as well. Every
model of the catalogue has its row.
"""

import argparse
import json
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import torch
from rich.console import Console
from rich.table import Table
from torch import Tensor

from granbench.cells.contract import Conditions
from granbench.models import MODELS, ClassicalCell
from granbench.models.j2 import J2

PRESSURE = 1e5
INCREMENT = 1.3e-3
"""Median norm of a strain increment on the random paths of the thesis."""

MILDER = 0.1
"""Factor on these increments for models whose mean stress would otherwise fall to zero."""

STEPS = 200
FEW = 200
"""Points for which the point-by-point update is timed; each takes the same time."""

BLOCK = 10_000
"""Points given to torch-fem at a time; with more, its fourth-order tensors fill the memory."""

SHORTEST = 0.02
"""Shortest timing in seconds: faster work is repeated."""

THREE_DIMENSIONAL = {"bulk_modulus": 2e7, "shear_modulus": 1.2e7, "yield_stress": 1e5}

Work = Callable[[], object]


@dataclass(frozen=True)
class Sizes:
    """Sizes of the timed work.

    Parameters
    ----------
    points : of one update
    paths : of a run of 200 steps
    trained_paths : of a run with back-propagation
    repeats : of each, interleaved
    """

    points: tuple[int, ...]
    paths: tuple[int, ...]
    trained_paths: tuple[int, ...]
    repeats: int


WHOLE = Sizes((100, 10_000, 1_000_000), (100, 1000, 5000, 10_000), (50, 500, 5000), 5)
QUICK = Sizes((100, 10_000), (100,), (50,), 2)


def strain_paths(cell: ClassicalCell, paths: int, steps: int) -> Tensor:
    """Smooth random strain, (path, step, component), from zero."""
    generator = torch.Generator().manual_seed(0)
    waves = torch.randn(4, paths, 1, cell.component_count, generator=generator)
    times = torch.linspace(0.0, 5.0, steps)[:, None]
    increments = sum(wave * torch.cos((k + 1) * times) for k, wave in enumerate(waves))
    size = INCREMENT * (MILDER if cell.pressure_dependent else 1.0) / math.sqrt(6.0)
    strain = size * increments.cumsum(dim=1)
    return strain - strain[:, :1]


def start_of(cell: ClassicalCell, points: int) -> Conditions:
    unit = cell.rows.normal[: cell.component_count].T
    return Conditions((PRESSURE * unit).expand(points, -1))


@torch.no_grad()
def on_the_way(cell: ClassicalCell, points: int) -> tuple[Tensor, Tensor]:
    """A strain increment and the state halfway along random paths, stored by component."""
    known = min(points, BLOCK)
    increments = strain_paths(cell, known, STEPS)[:, : STEPS // 2].diff(dim=1)
    state = cell.initial_state(start_of(cell, known))
    for increment in increments.unbind(dim=1):
        _, state = cell.step(increment, state)
    copies = points // known
    return tuple(tensor.repeat(copies, 1).T.contiguous().T for tensor in (increments[:, -1], state))


def point_by_point(values: dict[str, float], increments: np.ndarray, stresses: np.ndarray) -> None:
    """Eq 7.37 for each point in turn, in place; stress and strain as (point, 2, 2)."""
    bulk, shear = values["bulk_modulus"], values["shear_modulus"]
    unit = np.eye(2)
    for increment, stress in zip(increments, stresses, strict=True):
        volumetric = np.trace(increment)
        trial = stress + bulk * volumetric * unit
        trial += 2.0 * shear * (increment - 0.5 * volumetric * unit)
        p = 0.5 * np.trace(trial)
        s = trial - p * unit
        q = np.sqrt(2.0 * np.sum(s * s))
        stress[:] = p * unit + s * min(1.0, values["yield_stress"] / q)


def numpy_step() -> Work:
    """A few points of the update of J2 by `point_by_point`."""
    cell = J2()
    strains, stresses = (matrices(tensor) for tensor in on_the_way(cell, FEW))
    values, ends = cell.values(), stresses.copy()
    point_by_point(values, strains, ends)
    with torch.no_grad():
        expected, _ = cell.step(*on_the_way(cell, FEW))
    np.testing.assert_allclose(ends, matrices(expected), rtol=1e-9, atol=1e-4)
    return lambda: point_by_point(values, strains, stresses.copy())


def matrices(components: Tensor) -> np.ndarray:
    """Components (point, 3) as matrices (point, 2, 2)."""
    xx, yy, xy = components.numpy().T
    return np.array([[xx, xy], [xy, yy]]).transpose(2, 0, 1).copy()


def torch_fem_step(cell: J2, points: int) -> Work | None:
    """The same increments of the same stresses with torch-fem; None if it is not installed."""
    try:
        from torchfem.materials import IsotropicPlasticity3D
    except ImportError:
        return None
    bulk, shear, strength = (cell.values()[name] for name in THREE_DIMENSIONAL)
    young = 9.0 * bulk * shear / (3.0 * bulk + shear)
    poisson = (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear)
    increment, state = on_the_way(cell, min(points, BLOCK))
    places = torch.tensor([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    strain, stress = increment[:, places], state[:, places]
    count = len(strain)
    material = IsotropicPlasticity3D(
        young, poisson, lambda q: torch.full_like(q, strength), torch.zeros_like
    ).vectorize(count)
    zeros = torch.zeros(count, 3, 3)
    unused = torch.eye(3).expand(count, 3, 3)
    plastic = torch.zeros(count, 1)

    def update() -> Tensor:
        return material.step(strain, unused, stress, plastic, zeros, zeros[:, 0, :1], 0)[0]

    with torch.no_grad():
        expected, _ = cell.step(increment, state)
    torch.testing.assert_close(update(), expected[:, places], rtol=1e-9, atol=1e-4)
    return lambda: [update() for _ in range(points // count)]


def interleaved(works: dict[str, Work], repeats: int) -> dict[str, float]:
    """CPU seconds of each, as the median of alternating repeats that are long enough to time."""
    calls = {name: max(1, math.ceil(SHORTEST / timed(work, 1))) for name, work in works.items()}
    times = [
        {name: timed(work, calls[name]) / calls[name] for name, work in works.items()}
        for _ in range(repeats)
    ]
    return {name: statistics.median(turn[name] for turn in times) for name in works}


def timed(work: Work, calls: int) -> float:
    begin = time.process_time()
    for _ in range(calls):
        work()
    return time.process_time() - begin


def updates(models: list[str], sizes: Sizes) -> list[dict[str, object]]:
    """Seconds of one update by implementation, at every number of points."""
    rows: list[dict[str, object]] = []
    for points in sizes.points:
        works = {name: step_of(MODELS[name](), points) for name in models}
        solid = J2(THREE_DIMENSIONAL, order="full")
        works["j2, 3-D"] = step_of(solid, points)
        if points <= BLOCK:
            works["j2, 3-D with tangent"] = step_of(solid, points, tangent=True)
        if torch_fem := torch_fem_step(solid, points):
            works["torch-fem, 3-D with tangent"] = torch_fem
        works["numpy, point by point"] = numpy_step()
        seconds = interleaved(works, sizes.repeats)
        seconds["numpy, point by point"] *= points / FEW
        speeds = {name: 1e-6 * points / value for name, value in seconds.items()}
        rows.append(
            {
                "points": points,
                "cpu_seconds": seconds,
                "million_updates_per_second": speeds,
                "ratios": ratios(seconds),
            }
        )
    return rows


def step_of(cell: ClassicalCell, points: int, *, tangent: bool = False) -> Work:
    increment, state = on_the_way(cell, points)

    def step() -> None:
        with torch.no_grad():
            cell.step(increment, state)

    return (lambda: cell.tangent(increment, state)) if tangent else step


def ratios(seconds: dict[str, float]) -> dict[str, float]:
    """How many times slower the other implementations are."""
    found = {"numpy_over_j2": seconds["numpy, point by point"] / seconds["j2"]}
    if rival := seconds.get("torch-fem, 3-D with tangent"):
        found["torch_fem_over_j2"] = rival / seconds["j2"]
        found["torch_fem_over_j2_3d"] = rival / seconds["j2, 3-D"]
        if like := seconds.get("j2, 3-D with tangent"):
            found["torch_fem_over_j2_3d_with_tangent"] = rival / like
    return found


def runs(models: list[str], sizes: Sizes, *, trained: bool) -> list[dict[str, object]]:
    """Seconds of whole paths by model, with back-propagation to the parameters if `trained`."""
    rows: list[dict[str, object]] = []
    for paths in sizes.trained_paths if trained else sizes.paths:
        works = {name: run_of(MODELS[name](), paths, trained) for name in models}
        seconds = interleaved(works, max(1, sizes.repeats // 2))
        over_j2 = {name: value / seconds["j2"] for name, value in seconds.items()}
        rows.append({"paths": paths, "steps": STEPS, "cpu_seconds": seconds, "over_j2": over_j2})
    return rows


def run_of(cell: ClassicalCell, paths: int, trained: bool) -> Work:
    strain, start = strain_paths(cell, paths, STEPS + 1), start_of(cell, paths)

    def free_run() -> None:
        with torch.no_grad():
            cell.rollout(strain, start)

    def training_step() -> None:
        cell.zero_grad()
        cell.rollout(strain, start).stress.square().mean().backward()

    return training_step if trained else free_run


def installed(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def results(models: list[str], sizes: Sizes) -> dict[str, object]:
    torch.set_num_threads(1)
    torch.set_default_dtype(torch.float64)  # torch-fem has no other setting for this
    return {
        "benchmark": "models",
        "versions": {name: installed(name) for name in ("torch", "numpy", "torch-fem")},
        "updates": updates(models, sizes),
        "runs": runs(models, sizes, trained=False),
        "back_propagation": runs(models, sizes, trained=True),
    }


def print_tables(found: dict) -> None:
    console = Console()
    table = Table("", *(f"{row['points']:,} points" for row in found["updates"]))
    table.title = "million updates a second, one core"
    for name in dict.fromkeys(name for row in found["updates"] for name in row["cpu_seconds"]):
        speeds = [row["million_updates_per_second"].get(name) for row in found["updates"]]
        table.add_row(name, *("–" if speed is None else f"{speed:.3g}" for speed in speeds))
    for ratio in dict.fromkeys(name for row in found["updates"] for name in row["ratios"]):
        factors = [row["ratios"].get(ratio) for row in found["updates"]]
        shown = ("–" if factor is None else f"{factor:.3g} x" for factor in factors)
        table.add_row(ratio.replace("_", " "), *shown)
    console.print(table)
    for key, title in (("runs", "free runs"), ("back_propagation", "forward and backward")):
        table = Table("", *(f"{row['paths']:,} paths" for row in found[key]))
        table.title = f"{title}, {STEPS} steps: CPU s, one core"
        for name in found[key][0]["cpu_seconds"]:
            table.add_row(name, *(f"{row['cpu_seconds'][name]:.3g}" for row in found[key]))
        console.print(table)
    rival = found["versions"]["torch-fem"]
    console.print(f"torch-fem {rival}" if rival else "torch-fem is not installed: not compared")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--quick", action="store_true", help="small sizes and two repeats")
    parser.add_argument(
        "--models",
        nargs="+",
        choices=list(MODELS),
        default=list(MODELS),
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
