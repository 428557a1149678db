"""Drawings of boundary-value problems: mesh, supports, what moves and what presses."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from granbench.fem.loading import Prescribed, Pressure
from granbench.fem.mesh import PlaneMesh
from granbench.fem.problems import Problem
from granbench.plotting.fem import tame_ticks
from granbench.plotting.style import MODEL_COLOURS, figure_grid, house_style

DRAWN_PRESSURE = 1e5
"""Pa; so that the boundaries that a confinement acts on are seen. Its arrows have one length."""

HELD, MOVED, PRESSED = "0.15", MODEL_COLOURS[1], MODEL_COLOURS[0]

SUPPORTS = {"x": ">", "y": "^", "xy": "s"}
"""Markers by the directions that are held."""

ARROW = 0.09
"""Length of an arrow as a share of the body's larger side."""

MOST_MARKS = 9
"""On one boundary."""


@house_style
def problem_figure(problems: Sequence[Problem], mesh: str | None = None) -> Figure:
    """One drawing for each problem.

    Parameters
    ----------
    problems : with their choices; a confinement is drawn where none is chosen
    mesh : name of a mesh that all of them have; their default ones otherwise
    """
    columns = min(3, len(problems))
    rows = -(-len(problems) // columns)
    figure, axes = figure_grid(rows, columns, panel=(2.9, 2.7))
    for axis, problem in zip(axes, problems, strict=False):
        draw_problem(axis, problem, problem.mesh(mesh))
        axis.set_title(problem.title, fontsize=9)
    for axis in axes[len(problems) :]:
        axis.set_axis_off()
    _explain(axes[-1], inside=len(problems) == len(axes))
    return figure


def draw_problem(axis: Axes, problem: Problem, mesh: PlaneMesh) -> None:
    """Elements in grey; supports as marks, prescribed motion and pressure as arrows.

    A triangle to the right holds x, one that points up holds y, a square both.
    """
    corners = mesh.nodes[mesh.element_nodes[:, : mesh.kind.corners]]
    outlines = np.concatenate([corners, corners[:, :1]], axis=1)
    axis.add_collection(LineCollection(list(outlines), colors="0.8", linewidths=0.4))
    size = float(np.ptp(mesh.nodes, axis=0).max())
    if problem.confinement is None:
        problem = replace(problem, confinement=DRAWN_PRESSURE)
    loading = problem.loading(mesh)
    for motion in loading.prescribed:
        _draw_motion(axis, motion, mesh, size)
    for force in loading.forces:
        if isinstance(force, Pressure):
            _draw_pressure(axis, force.boundary, mesh, size)
    axis.set(aspect="equal", xlabel="$x$ [m]", ylabel="$y$ [m]")
    tame_ticks(axis, mesh.nodes)
    axis.margins(0.14)
    axis.autoscale_view()


def _draw_motion(axis: Axes, motion: Prescribed, mesh: PlaneMesh, size: float) -> None:
    where = motion.where
    nodes = mesh.nodes_on(where) if isinstance(where, str) else [mesh.node_at(*where)]
    places = mesh.nodes[nodes]
    values = {}
    for direction, value in (("x", motion.x), ("y", motion.y)):
        if value is not None:
            values[direction] = value(places) if callable(value) else np.full(len(places), value)
    held = "".join(name for name, value in values.items() if not value.any())
    chosen = _spread(places)
    if held:
        axis.plot(
            *places[chosen].T, SUPPORTS[held], color=HELD, markersize=4.0, clip_on=False, zorder=3
        )
    moves = np.column_stack([values.get(name, np.zeros(len(places))) for name in "xy"])
    moving = chosen[moves[chosen].any(axis=1)]
    if len(moving):
        _arrows(axis, places[moving], ARROW * size * moves[moving], MOVED, begins=True)


def _draw_pressure(axis: Axes, boundary: str, mesh: PlaneMesh, size: float) -> None:
    facets = mesh.facets_on(boundary)
    geometry = mesh.geometry
    start, end = (geometry.p[:, geometry.facets[number, facets]].T for number in (0, 1))
    inside = geometry.p[:, geometry.t[: mesh.kind.corners, geometry.f2t[0, facets]]].mean(axis=1).T
    middle = 0.5 * (start + end)
    normal = (end - start)[:, ::-1] * (1.0, -1.0)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    inward = np.where(
        ((inside - middle) * normal).sum(axis=1, keepdims=True) > 0.0, normal, -normal
    )
    chosen = _spread(middle)
    _arrows(axis, middle[chosen], ARROW * size * inward[chosen], PRESSED, begins=False)


def _arrows(
    axis: Axes,
    places: NDArray[np.float64],
    moves: NDArray[np.float64],
    colour: str,
    *,
    begins: bool,
) -> None:
    """Arrows that begin, or end, at places."""
    axis.quiver(
        *places.T,
        *moves.T,
        color=colour,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        units="inches",
        width=0.018,
        pivot="tail" if begins else "tip",
        zorder=4,
    )


def _spread(places: NDArray[np.float64]) -> NDArray[np.intp]:
    """A few places, evenly along a boundary, both ends among them."""
    along = np.lexsort(places.T[:: 1 if np.ptp(places[:, 1]) > np.ptp(places[:, 0]) else -1])
    count = min(MOST_MARKS, len(places))
    return along[np.linspace(0, len(places) - 1, count).round().astype(int)]


def _explain(axis: Axes, *, inside: bool) -> None:
    for marker, colour, text in (
        (SUPPORTS["x"], HELD, "held in $x$"),
        (SUPPORTS["y"], HELD, "held in $y$"),
        (SUPPORTS["xy"], HELD, "held in both"),
        (r"$\rightarrow$", MOVED, "driving displacement"),
        (r"$\rightarrow$", PRESSED, "confinement"),
    ):
        axis.plot([], [], linestyle="none", marker=marker, color=colour, label=text)
    axis.legend(loc="best" if inside else "center", fontsize=8)
