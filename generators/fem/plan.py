"""The analyses of a `fem-*` dataset, and their splits.

Analyses are split by problem and loading, never by Gauss point: all points of one analysis are in
one split. The strains of IME do not depend on a constant confining pressure, so that analyses under
different constant pressures would repeat each other; every split therefore has its own random
confining pressures (Eq 4.21).
"""

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from granbench.fem.statement import SOLVERS, EmbeddedAnalysis, ProblemStatement
from granbench.generators.fem.design import FemDataset, FemPreset

DEVIATION = 0.2
"""Standard deviation of a random confining pressure over its mean."""

SEED_SPACING = 1000
"""Difference between the seeds of random confining pressures of two successive dataset seeds."""


class AnalysisPlan(ProblemStatement):
    """One analysis of a dataset.

    Parameters
    ----------
    split : of all its Gauss points
    points : largest number of Gauss points that are kept, evenly spread over their numbers
    embedded : whether models are also tested inside this analysis
    """

    split: str
    points: int
    embedded: bool = False

    @property
    def loading_family(self) -> str:
        """Problem and kind of loading."""
        cyclic = str(self.choices.get("cycles", "monotonic")).startswith("cyclic")
        return f"{self.problem}-{'cyclic' if cyclic else 'monotonic'}"

    @property
    def seed(self) -> int:
        """Seed of the random confining pressure; 0 if the pressure is constant."""
        confinement: Any = self.choices["confinement"]
        return int(confinement["seed"]) if isinstance(confinement, Mapping) else 0


class _Row(BaseModel):
    """One row of the plan: problem, loading and confining pressure, for any preset."""

    split: str
    problem: str
    surface: str
    cycles: str
    mesh: int = 0
    pressure: float
    curvature: float | None = None
    seed: int = 0
    embedded: str = ""


_SURFACES = {"biaxial": "ends", "retaining-wall": "wall", "strip-footing": "base"}
"""Choice of each problem that is rough or smooth."""


def _row(split: str, problem: str, surface: str, cycles: str, **others: Any) -> _Row:
    return _Row(split=split, problem=problem, surface=surface, cycles=cycles, **others)


_ROWS = (
    _row("train", "biaxial", "rough", "monotonic", pressure=1e5),
    _row("train", "biaxial", "rough", "monotonic", pressure=5e4, curvature=1.0, seed=1),
    _row("train", "biaxial", "rough", "monotonic", pressure=2e5, curvature=3.0, seed=2),
    _row("train", "biaxial", "rough", "cyclic-8-4", pressure=1e5, curvature=2.0, seed=3),
    _row("train", "biaxial", "rough", "cyclic-7-5", pressure=2e5, curvature=5.0, seed=4, mesh=1),
    _row("train", "biaxial", "rough", "cyclic", pressure=5e4, curvature=4.0, seed=5),
    _row("train", "biaxial", "rough", "monotonic", pressure=1e5, curvature=5.0, seed=9),
    _row("train", "biaxial", "rough", "cyclic-7-5", pressure=5e4, curvature=2.0, seed=10),
    _row("train", "biaxial", "smooth", "monotonic", pressure=1e5, curvature=4.0, seed=6, mesh=1),
    _row("train", "biaxial", "smooth", "cyclic-8-4", pressure=2e5, curvature=2.0, seed=7, mesh=1),
    _row("train", "biaxial", "smooth", "cyclic", pressure=5e4, curvature=1.0, seed=8, mesh=1),
    _row("validation", "biaxial", "rough", "monotonic", pressure=1.25e5, curvature=2.0, seed=11),
    _row(
        "validation", "biaxial", "rough", "cyclic-8-4", pressure=1.25e5, curvature=3.0, seed=12,
        mesh=1,
    ),
    _row(
        "test", "biaxial", "rough", "monotonic", pressure=7.5e4, curvature=3.0, seed=21,
        embedded="biaxial",
    ),
    _row(
        "test", "biaxial", "rough", "cyclic-8-4", pressure=1.5e5, curvature=1.0, seed=22,
        embedded="biaxial-cyclic",
    ),
    _row("test", "biaxial", "smooth", "cyclic-7-5", pressure=7.5e4, curvature=5.0, seed=23, mesh=1),
    _row(
        "ood-wall", "retaining-wall", "smooth", "monotonic", pressure=1e5,
        embedded="retaining-wall",
    ),
    _row("ood-wall", "retaining-wall", "rough", "cyclic-8-4", pressure=1e5, curvature=2.0, seed=31),
    _row(
        "ood-footing", "strip-footing", "rough", "monotonic", pressure=1e5,
        embedded="strip-footing",
    ),
    _row("ood-footing", "strip-footing", "smooth", "cyclic-8-4", pressure=1e5, curvature=2.0,
         seed=41),
)  # fmt: skip


def planned_analyses(dataset: FemDataset, preset: FemPreset, seed: int) -> list[AnalysisPlan]:
    """Every analysis of a dataset, in the order of its paths.

    Parameters
    ----------
    dataset, preset : what is made
    seed : of the dataset; the seeds of the random confining pressures follow from it
    """
    return [_plan(row, dataset, preset, seed) for row in _ROWS]


def _plan(row: _Row, dataset: FemDataset, preset: FemPreset, seed: int) -> AnalysisPlan:
    meshes = preset.meshes[row.problem]
    confinement: float | dict[str, int | float] = row.pressure
    if row.curvature is not None:
        confinement = {
            "curvature": row.curvature,
            "seed": SEED_SPACING * seed + row.seed,
            "mean": row.pressure,
            "deviation": DEVIATION * row.pressure,
        }
    kind = "random" if row.curvature is not None else "constant"
    uniform = row.problem == "biaxial" and row.surface == "smooth"
    end_strain = preset.strain_scale * dataset.end_strains[row.problem]
    named = f"{row.problem}-{row.surface}-{row.cycles}-{kind}-{row.pressure / 1e3:g}kpa"
    return AnalysisPlan(
        name=row.embedded or named,
        problem=row.problem,
        mesh=meshes[row.mesh % len(meshes)],
        choices={
            _SURFACES[row.problem]: row.surface,
            "cycles": row.cycles,
            "confinement": confinement,
            "end_strain": end_strain,
            "speed": preset.speed,
        },
        split=row.split,
        points=preset.uniform_points if uniform else preset.points,
        embedded=bool(row.embedded),
    )


def embedded_analyses_of(
    plans: Sequence[AnalysisPlan], preset: FemPreset, modulus: Mapping[str, float]
) -> tuple[EmbeddedAnalysis, ...]:
    """The analyses in which models are tested in place of the ground truth.

    Parameters
    ----------
    plans : all of the dataset
    preset : says how finely they are compared
    modulus : largest normal modulus of the ground truth at the start, by name of analysis, Pa
    """
    return tuple(
        EmbeddedAnalysis(
            name=plan.name,
            problem=plan.problem,
            mesh=plan.mesh,
            choices=plan.choices,
            solvers=SOLVERS,
            outputs=preset.embedded_outputs,
            points=preset.embedded_points,
            modulus=modulus[plan.name],
        )
        for plan in plans
        if plan.embedded
    )
