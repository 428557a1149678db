"""Write the tables and figures of docs/fem.md.

Run ``python docs/fem_page.py`` from the root of the checkout; `make docs` does this. A test checks
that the page is up to date.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr
from fem_network import EXHIBITS, network_figure, network_part
from fem_network import analyses as network_analyses
from matplotlib.figure import Figure
from page_parts import table, with_parts, write_picture

from granbench.fem import PROBLEMS, ExplicitSettings, ImplicitSettings, Problem, find_problem, run
from granbench.fem.operators import build_operators
from granbench.models import MODELS
from granbench.plotting.fem import draw_body
from granbench.plotting.problem import problem_figure
from granbench.plotting.style import (
    LINE_STYLES,
    MODEL_COLOURS,
    figure_grid,
    house_style,
)

PAGE = Path(__file__).parent / "fem.md"
FOLDER = Path(__file__).parent / "fem"

STRENGTH, YOUNG, PRESSURE = 1e5, 200e6, 1e5
"""Strength and modulus of the perfectly plastic material, and surcharge in the limit loads; Pa."""

DRAWN_STEPS = 50


def problems_part() -> str:
    """Table of the problems with their drives and meshes."""
    rows = []
    for name, kind in PROBLEMS.items():
        problem = kind()
        meshes = []
        for mesh in kind.meshes:
            points = build_operators(problem.mesh(mesh)).point_count
            default = " (default)" if mesh == kind.default_mesh else ""
            meshes.append(f"`{mesh}` {points}{default}")
        rows.append((f"`{name}`", kind.drive, kind.length, kind.reaction, ", ".join(meshes)))
    length = "driving strain is the displacement divided by the"
    header = ("problem", "drive", length, "reaction", "meshes, Gauss points")
    return table(header, rows)


def choices_part() -> str:
    """Table of the choices of all problems, with their defaults."""
    meanings = {
        field.name: field.metadata["meaning"]
        for kind in PROBLEMS.values()
        for field in fields(kind)
        if "meaning" in field.metadata  # a subclass that changes a default leaves it out
    }
    owners: dict[str, dict[str, str]] = {}
    for name, kind in PROBLEMS.items():
        for choice, value in kind().configuration().items():
            owners.setdefault(choice, {})[name] = _shown(choice, value)
    rows = []
    for choice, values in owners.items():
        everywhere = len(values) == len(PROBLEMS)
        same = len(set(values.values())) == 1
        if everywhere and same:
            defaults = next(iter(values.values()))
        else:
            defaults = "; ".join(f"{name} {value}" for name, value in values.items())
        rows.append((f"`{choice}`", meanings[choice], defaults))
    return table(("choice", "meaning", "default"), rows)


def _shown(choice: str, value: object) -> str:
    if value is None:
        return "none" if choice == "load_path" else "by the model"
    return "no" if value is False else f"{value:g}" if isinstance(value, float) else str(value)


def _stiff(name: str) -> object:
    values = {"bulk_modulus": YOUNG / 1.6, "shear_modulus": YOUNG / 2.4}
    return MODELS[name](values | ({"yield_stress": STRENGTH} if name == "j2" else {}))


def _friction_coefficient() -> float:
    sine = 0.5 * MODELS["drucker-prager"]().values()["friction_slope"]
    return (1.0 + sine) / (1.0 - sine)


LIMITS: Mapping[str, tuple[Callable[[], Problem], str, str, float]] = {
    "smooth footing: $(2+\\pi) k$ over its half (Prandtl)": (
        partial(find_problem, "strip-footing", base="smooth", end_strain=0.012),
        "j2", "coarse medium fine", (2.0 + np.pi) * 0.5 * STRENGTH * 0.5,
    ),
    "rough footing, the same": (
        partial(find_problem, "strip-footing", end_strain=0.012),
        "j2", "coarse medium fine", (2.0 + np.pi) * 0.5 * STRENGTH * 0.5,
    ),
    "smooth wall: $2kH+q_0H$ (Rankine)": (
        partial(find_problem, "retaining-wall", confinement=PRESSURE, end_strain=0.01),
        "j2", "coarse medium", STRENGTH + PRESSURE,
    ),
    "smooth wall, friction: $K_p q_0 H$ (Rankine)": (
        partial(find_problem, "retaining-wall", end_strain=0.02),
        "drucker-prager", "coarse medium", _friction_coefficient() * PRESSURE,
    ),
    "perforated plate: $2k(b-a)$ (net section)": (
        partial(find_problem, "perforated-plate", end_strain=0.01),
        "j2", "coarse medium", STRENGTH * 0.075,
    ),
    "dog bone: $2k$ over its gauge": (
        partial(find_problem, "dog-bone", end_strain=0.01),
        "j2", "coarse medium", STRENGTH * 0.030,
    ),
}  # fmt: skip
"""Limit loads: problem, model, meshes, exact load, N/m."""


def limits_part() -> str:
    """Table of the limit loads of the implicit solver, divided by the exact ones."""
    rows = []
    for meaning, (problem, model, meshes, exact) in LIMITS.items():
        found = dict.fromkeys(("coarse", "medium", "fine"), "–")
        for mesh in meshes.split():
            settings = ImplicitSettings(steps=30)
            dataset = run(problem(), _stiff(model), solver=settings, mesh=mesh).check()
            found[mesh] = f"{float(dataset['reaction'][-1]) / exact:.3f}"
        rows.append((meaning, f"`{model}`", f"{exact / 1e3:.4g}", *found.values()))
    return table(("limit load", "model", "exact, kN/m", *found), rows)


def speeds_part() -> str:
    """Table of the reactions at the end: implicit, and how far the explicit ones differ."""
    rows = []
    for name in PROBLEMS:
        static = run(find_problem(name), MODELS["j2"](), solver="implicit", mesh="coarse").check()
        last = float(static["reaction"][-1])
        row = [f"`{name}`", f"{last / 1e3:.4g}"]
        for damping in (1.0, 0.1):
            settings = ExplicitSettings(damping=damping)
            moved = run(find_problem(name), MODELS["j2"](), solver=settings, mesh="coarse").check()
            row.append(f"{100.0 * (float(moved['reaction'][-1]) / last - 1.0):+.1f} %")
        rows.append(row)
    return table(("problem", "implicit, kN/m", "explicit, γ = 1", "explicit, γ = 0.1"), rows)


def analyses() -> dict[str, xr.Dataset]:
    """Implicit analyses of all problems with `ime`, for the figure of results."""
    settings = ImplicitSettings(steps=DRAWN_STEPS)
    return {
        name: run(find_problem(name), MODELS["ime"](), solver=settings, mesh="medium").check()
        for name in PROBLEMS
    }


@house_style
def results_figure(found: Mapping[str, xr.Dataset]) -> Figure:
    """Reactions of all problems, and each body at its end."""
    figure, axes = figure_grid(2, 3, panel=(3.0, 2.6))
    curves, *bodies = axes
    for number, (name, dataset) in enumerate(found.items()):
        reaction = dataset["reaction"].values
        curves.plot(
            100.0 * dataset["driving_strain"],
            reaction / np.abs(reaction).max(),
            color=MODEL_COLOURS[number],
            linestyle=LINE_STYLES[number],
            label=name,
        )
    curves.set(xlabel="driving strain [%]", ylabel="reaction over its largest [–]")
    curves.legend()
    for axis, dataset in zip(bodies, found.values(), strict=True):
        draw_body(axis, dataset)
        axis.set_title(str(dataset.attrs["title"]), fontsize=9)
    return figure


def cheap_parts() -> dict[str, str]:
    """Parts that need no analysis."""
    return {"problems": problems_part(), "choices": choices_part()}


def analysed_parts() -> dict[str, str]:
    """Parts that need analyses of classical models, about half a minute."""
    return {"limits": limits_part(), "speeds": speeds_part()}


def main() -> None:
    """Write the page and its figures."""
    FOLDER.mkdir(exist_ok=True)
    write_picture(problem_figure([kind() for kind in PROBLEMS.values()]), FOLDER / "problems.png")
    # Shades and lines together are many colours.
    write_picture(results_figure(analyses()), FOLDER / "results.png", colours=256)
    parts = cheap_parts() | analysed_parts()
    for part, exhibit in EXHIBITS.items():
        with_networks = network_analyses(exhibit)
        write_picture(network_figure(exhibit, with_networks), FOLDER / f"{part}.png")
        parts[part] = network_part(exhibit, with_networks)
    PAGE.write_text(with_parts(PAGE.read_text(encoding="utf-8"), parts), encoding="utf-8")


if __name__ == "__main__":
    main()
