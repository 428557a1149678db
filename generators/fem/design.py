"""Which analyses make which `fem-*` dataset, and which of them are in which split.

A split is a matter of problem and loading, never of Gauss points: all points of one analysis are
in one split. IME does not feel a constant confinement, under which its strains would be those of
another one; so every split has random confinements of its own (Eq 4.21).
"""

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict

from granbench.errors import RegistryError
from granbench.fem.statement import SOLVERS, EmbeddedAnalysis, ProblemStatement
from granbench.generators.ground_truth import ModelTruth

THESIS_SECTION = "5.3"
DEVIATION = 0.2
"""Of a random confinement, over its mean."""

SEEDS_APART = 1000
"""Between the random confinements of one seed of a dataset and those of the next."""


class GroundTruth(ModelTruth):
    """The model behind a dataset, and how far its analyses go.

    Parameters
    ----------
    end_strains : driving strain at the end, by problem. CSUH softens: at twice these strains the
        corners under rough platens lose all pressure, and the explicit analysis with them.
    """

    end_strains: Mapping[str, float]


GROUND_TRUTHS: Mapping[str, GroundTruth] = {
    truth.dataset: truth
    for truth in (
        GroundTruth(
            dataset="fem-ime",
            model="ime",
            end_strains={"biaxial": 0.1, "retaining-wall": 0.05, "strip-footing": 0.1},
        ),
        GroundTruth(
            dataset="fem-csuh",
            model="csuh",
            end_strains={"biaxial": 0.05, "retaining-wall": 0.05, "strip-footing": 0.05},
        ),
    )
}


class AnalysisPlan(ProblemStatement):
    """One analysis of a dataset.

    Parameters
    ----------
    split : of all its Gauss points
    points : how many of them are kept, evenly spread over their numbers; all where there are fewer
    embedded : whether models take the place of the ground truth in it
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
        """Of its random confinement; 0 where it is constant."""
        confinement: Any = self.choices["confinement"]
        return int(confinement["seed"]) if isinstance(confinement, Mapping) else 0


class FemPreset(BaseModel):
    """How large a `fem-*` dataset is.

    Parameters
    ----------
    version : of the dataset that it makes
    steps : increments of a path, the output steps of an analysis
    points : Gauss points kept of a rough specimen or a foundation
    uniform_points : kept of a smooth specimen, which deforms uniformly
    strain_scale : on the driving strains at the end
    speed : of the drive, m/s
    meshes : by problem; those of biaxial tests in turn
    embedded_outputs, embedded_points : see `EmbeddedAnalysis`
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    version: str
    steps: int
    points: int
    uniform_points: int
    strain_scale: float = 1.0
    speed: float = 0.1
    meshes: Mapping[str, tuple[str, ...]]
    embedded_outputs: int = 90
    embedded_points: int = 64


PRESETS: Mapping[str, FemPreset] = {
    preset.name: preset
    for preset in (
        FemPreset(
            name="smoke",
            version="0.0.0+smoke",
            steps=20,
            points=16,
            uniform_points=1,
            strain_scale=0.1,
            speed=0.3,
            meshes={
                "biaxial": ("coarse",),
                "retaining-wall": ("coarse",),
                "strip-footing": ("coarse",),
            },
            embedded_outputs=18,
            embedded_points=16,
        ),
        FemPreset(
            name="core",
            version="1.0.0",
            steps=180,  # the turning points of most cycles are steps
            points=96,
            uniform_points=1,
            meshes={
                "biaxial": ("medium", "coarse"),
                "retaining-wall": ("coarse",),
                "strip-footing": ("coarse",),
            },
        ),
        # The meshes of the thesis, and every Gauss point of them.
        FemPreset(
            name="paper",
            version="1.0.0+paper",
            steps=360,
            points=1000,
            uniform_points=1,
            meshes={
                "biaxial": ("table-5.2",),
                "retaining-wall": ("table-5.2",),
                "strip-footing": ("table-5.2",),
            },
        ),
    )
}


class _Row(BaseModel):
    """A line of the plan: problem, loading and confinement, before it is fitted to a preset."""

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
"""What is rough or smooth in each problem."""


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


def preset(name: str) -> FemPreset:
    """The preset of that name.

    Raises
    ------
    RegistryError
        If there is none.
    """
    if name not in PRESETS:
        raise RegistryError(
            f"preset {name!r} of the fem datasets is unknown; use {', '.join(PRESETS)}"
        )
    return PRESETS[name]


def planned_analyses(truth: GroundTruth, preset: FemPreset, seed: int) -> list[AnalysisPlan]:
    """Every analysis of a dataset, in the order of its paths.

    Parameters
    ----------
    truth, preset : what is made
    seed : of the dataset, from which those of the random confinements follow
    """
    return [_plan(row, truth, preset, seed) for row in _ROWS]


def _plan(row: _Row, truth: GroundTruth, preset: FemPreset, seed: int) -> AnalysisPlan:
    meshes = preset.meshes[row.problem]
    confinement: float | dict[str, int | float] = row.pressure
    if row.curvature is not None:
        confinement = {
            "curvature": row.curvature,
            "seed": SEEDS_APART * seed + row.seed,
            "mean": row.pressure,
            "deviation": DEVIATION * row.pressure,
        }
    kind = "random" if row.curvature is not None else "constant"
    uniform = row.problem == "biaxial" and row.surface == "smooth"
    end_strain = preset.strain_scale * truth.end_strains[row.problem]
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


def embedded_of(
    plans: Sequence[AnalysisPlan], preset: FemPreset, modulus: Mapping[str, float]
) -> tuple[EmbeddedAnalysis, ...]:
    """The analyses in which models take the place of the ground truth.

    Parameters
    ----------
    plans : all of the dataset
    preset : how finely they are compared
    modulus : stiffest modulus of the ground truth at the start of each analysis, by name, Pa
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
