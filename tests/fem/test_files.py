"""Meshes and load paths from files give the same analysis as those made here, or a sentence."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from granbench.errors import ConfigurationError
from granbench.fem import ExplicitSettings, ImplicitSettings, find_problem, run
from granbench.fem.load_path_file import read_load_path
from granbench.fem.loading import LoadingHistory
from granbench.fem.mesh_file import read_mesh
from granbench.fem.time_step import output_steps
from granbench.models import MODELS

WIDTH, HEIGHT, COLUMNS, ROWS = 0.5, 1.0, 2, 4


def gmsh_like(
    file: Path,
    *,
    names: tuple[str, ...] = ("bottom", "right", "top", "left"),
    cells: str = "quad",
    moved: tuple[int, float] | None = None,
    scale: float = 1.0,
) -> Path:
    """The biaxial test's coarse mesh as Gmsh writes one: tagged edges and physical names."""
    x, y = np.linspace(0.0, WIDTH, COLUMNS + 1), np.linspace(0.0, HEIGHT, ROWS + 1)
    points = np.array([(a, b, 0.0) for b in y for a in x])
    if moved is not None:
        points[moved[0], 0] += moved[1]
    place = np.arange(len(points)).reshape(ROWS + 1, COLUMNS + 1)
    corners = [place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]]
    quads = np.stack([corner.ravel() for corner in corners], axis=1)
    edges = dict(
        zip(
            ("bottom", "right", "top", "left"),
            (place[0], place[:, -1], place[-1], place[:, 0]),
            strict=True,
        )
    )
    lines = [np.stack([row[:-1], row[1:]], axis=1) for row in edges.values()]
    tags = np.concatenate([np.full(len(line), tag) for tag, line in enumerate(lines, start=1)])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    body = quads if cells == "quad" else triangles
    field = {name: np.array([tag, 1]) for tag, name in enumerate(names, start=1)}
    field["soil"] = np.array([9, 2])
    known = np.isin(tags, range(1, len(names) + 1))
    mesh = meshio.Mesh(
        scale * points,
        [("line", np.concatenate(lines)[known]), (cells, body)],
        cell_data={
            "gmsh:physical": [tags[known], np.full(len(body), 9)],
            "gmsh:geometrical": [tags[known], np.full(len(body), 9)],
        },
        field_data=field,
    )
    mesh.write(file, file_format="gmsh22", binary=False)
    return file


@pytest.mark.parametrize("solver", ["implicit", "explicit"])
def test_a_mesh_from_a_file_is_analysed_like_the_same_one_made_here(
    tmp_path: Path, solver: str
) -> None:
    problem = find_problem("biaxial", end_strain=0.004, confinement=5e4)
    file = gmsh_like(tmp_path / "soil.msh")
    reactions = [
        run(problem, MODELS["j2"](), solver=solver, mesh=mesh).check()["reaction"].values
        for mesh in ("coarse", str(file))
    ]
    np.testing.assert_allclose(*reactions, rtol=1e-9)


@pytest.mark.parametrize(("cells", "element"), [("quad", "quad8"), ("triangle", "tri6")])
def test_cells_become_elements_with_nodes_on_their_edges(
    tmp_path: Path, cells: str, element: str
) -> None:
    mesh = read_mesh(gmsh_like(tmp_path / "soil.msh", cells=cells))
    assert mesh.element == element
    assert set(mesh.boundary_names) == {"left", "right", "bottom", "top"}
    assert mesh.nodes[mesh.nodes_on("top"), 1] == pytest.approx(HEIGHT)
    assert len(mesh.nodes_on("left")) == 2 * ROWS + 1


def test_errors_of_a_mesh_file_name_the_file(tmp_path: Path) -> None:
    broken = tmp_path / "broken.msh"
    broken.write_text("$MeshFormat\nnothing\n")
    with pytest.raises(ConfigurationError, match=r"broken\.msh: .*\$MeshFormat"):
        read_mesh(broken)
    with pytest.raises(ConfigurationError, match=r"none\.msh"):
        read_mesh(tmp_path / "none.msh")
    inverted = gmsh_like(tmp_path / "inverted.msh", moved=(4, 0.6))
    with pytest.raises(ConfigurationError, match=r"inverted\.msh: element \d+ .* is inverted"):
        read_mesh(inverted)
    partly = gmsh_like(tmp_path / "partly.msh", names=("bottom", "right", "upper", "left"))
    with pytest.raises(ConfigurationError, match=r"partly\.msh, for biaxial: .*'top'"):
        find_problem("biaxial").mesh(str(partly))
    swapped = gmsh_like(tmp_path / "swapped.msh", names=("top", "right", "bottom", "left"))
    with pytest.raises(ConfigurationError, match=r"boundary '(top|bottom)'"):
        find_problem("biaxial").mesh(str(swapped))
    millimetres = gmsh_like(tmp_path / "millimetres.msh", scale=1e3)
    with pytest.raises(ConfigurationError, match="0 to 500 m .* 0 to 0.5 m"):
        find_problem("biaxial").mesh(str(millimetres))
    solid = tmp_path / "solid.vtk"
    meshio.Mesh(np.eye(4, 3), [("tetra", np.array([[0, 1, 2, 3]]))]).write(solid)
    with pytest.raises(ConfigurationError, match=r"solid\.vtk: has three-dimensional elements"):
        read_mesh(solid)


def test_a_load_path_from_a_file_drives_the_problem(tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text("time,displacement\n0,0\n0.04,0.004\n0.05,0.003\n0.07,0.005\n")
    problem = find_problem("biaxial", load_path=read_load_path(file))
    found = run(problem, MODELS["j2"](), solver="implicit", mesh="coarse").check()
    moved = found["driving_displacement"].values
    assert {0.0, 0.004, 0.003, 0.005} <= set(np.round(moved, 12))
    assert moved[-1] == 0.005
    turning = np.flatnonzero(np.diff(np.sign(np.diff(moved))))
    assert moved[turning + 1] == pytest.approx([0.004, 0.003])


PATHS = {
    "round": ((0.0, 0.04, 0.05, 0.07), (0.0, 0.004, 0.003, 0.005)),
    "odd": ((0.0, 0.0137, 0.0211, 0.0437), (0.0, 0.00211, 0.00173, 0.00399)),
    "with a rest": ((0.0, 0.02, 0.03, 0.0417, 0.06), (0.0, 0.004, 0.004, 0.001, 0.003)),
}


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("outputs", [1, 3, 10])
def test_every_turning_point_is_an_output_step_of_both_solvers(path: str, outputs: int) -> None:
    drive = LoadingHistory(*PATHS[path])
    turns = [drive.values[drive.times.index(time)] for time in drive.turning_times]
    assert len(turns) >= 2
    problem = find_problem("biaxial", load_path=drive)
    settings = (ExplicitSettings(outputs=outputs), ImplicitSettings(steps=outputs))
    for solver in settings:
        found = run(problem, MODELS["j2"](), solver=solver, mesh="coarse").check()
        moved = found["driving_displacement"].values
        steps = found["time_steps"].sum() if "time_steps" in found else np.inf
        # Within half a time step where the turning points have no common measure.
        fastest = np.abs(np.diff(drive.values) / np.diff(drive.times)).max()
        close = 0.51 * fastest * drive.end / float(steps) + 1e-12
        for value in turns:
            assert np.abs(moved - value).min() <= close
        assert moved[-1] == pytest.approx(drive.values[-1])


@pytest.mark.parametrize("cycles", ["monotonic", "cyclic", "cyclic-8-4", "cyclic-7-5"])
@pytest.mark.parametrize("outputs", [7, 90, 100, 180])
def test_cyclic_loadings_turn_at_output_steps(cycles: str, outputs: int) -> None:
    drive = find_problem("strip-footing", cycles=cycles).drive_history()
    steps = output_steps(drive, 1.37e-5, ExplicitSettings(outputs=outputs))
    times = steps / steps[-1] * drive.end
    assert drive.end / steps[-1] <= 1.37e-5
    assert len(steps) > outputs
    for turn in drive.turning_times:
        assert np.abs(times - turn).min() < 1e-9 * drive.end


def test_stated_outputs_are_not_changed() -> None:
    """Datasets state their outputs; where all turning points are among them nothing changes."""
    for cycles, outputs in (("cyclic-8-4", 90), ("cyclic-8-4", 180), ("cyclic", 180)):
        drive = find_problem("biaxial", cycles=cycles).drive_history()
        chosen, stated = (
            output_steps(drive, 1e-4, ExplicitSettings(outputs=outputs, turning_points=turning))
            for turning in (True, False)
        )
        np.testing.assert_array_equal(chosen, stated)
        assert len(set(np.diff(chosen))) == 1


def test_time_steps_between_outputs_are_recorded() -> None:
    problem = find_problem("biaxial", cycles="cyclic-8-4", end_strain=0.005)
    found = run(problem, MODELS["j2"](), solver=ExplicitSettings(outputs=7), mesh="coarse").check()
    taken = found["time_steps"].values
    assert taken[0] == 0 and (taken[1:] > 0).all()
    elapsed = found["time"].values / found["time"].values[-1]
    np.testing.assert_allclose(taken.cumsum() / taken.sum(), elapsed, rtol=1e-9)
    assert np.abs(found["energy_error"]).max() < 1e-10


@pytest.mark.parametrize(
    "text",
    [
        "time [min],displacement [mm]\n0,0\n0.5,5\n",
        "time\tdisplacement\ns\tcm\n0\t0\n30\t0,5\n",
        "# time displacement\n0 0\n30 5.0D-03\n",
        "Date;time;displacement [m]\n01.02.2023;0;0\n01.02.2023;30;0,005\n",
    ],
)
def test_load_paths_may_state_their_units(tmp_path: Path, text: str) -> None:
    file = tmp_path / "path.csv"
    file.write_text(text)
    history = read_load_path(file)
    assert history.times == (0.0, 30.0) and history.values == pytest.approx((0.0, 5e-3))


def test_a_load_path_beyond_the_body_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text("time,displacement [m]\n0,0\n1,1.5\n")
    with pytest.raises(ConfigurationError, match=r"1.5 m.*millimetres"):
        find_problem("biaxial", load_path=read_load_path(file))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("time,displacement\n0,0\n1,50\n", "line 3: .* 50 m.*millimetres"),
        ("time,displacement [kPa]\n0,0\n1,50\n", "displacement .*'kPa'"),
        ("time,displacement\n0,0\n2,1e-3\n1,2e-3\n", "entry 2 .* 1 s"),
        ("time,displacement\n0.5,0\n2,1e-3\n", "0.5 s"),
        ("time,displacement\n0,0\n2,0\n", "begins at a displacement of 0 m"),
        ("time,displacement\n0,1e-3\n2,2e-3\n", "begins at a displacement of 0.001 m"),
        ("time,velocity\n0,0\n2,1\n", "time, velocity"),
        (
            "time,displacement\n0,0\n2,\n3,1\n",
            r"line 3: displacement is empty",
        ),
        ("", "is empty"),
        ("time,displacement\n", "0 times and 0 values"),
    ],
)
def test_an_impossible_load_path_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    file = tmp_path / "path.csv"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=sentence) as refusal:
        read_load_path(file)
    assert "path.csv" in str(refusal.value)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (ExplicitSettings(), r"1e\+08"),
        (ImplicitSettings(steps=5), None),
    ],
)
def test_a_loading_of_years_is_refused_where_it_takes_time_steps(
    tmp_path: Path, settings: ExplicitSettings | ImplicitSettings, sentence: str | None
) -> None:
    file = tmp_path / "path.csv"
    file.write_text("time,displacement\n0,0\n1e9,0.001\n")
    problem = find_problem("biaxial", load_path=read_load_path(file))
    if sentence is None:
        run(problem, MODELS["j2"](), solver=settings, mesh="coarse").check()
        return
    with pytest.raises(ConfigurationError, match=sentence):
        run(problem, MODELS["j2"](), solver=settings, mesh="coarse")


def test_load_steps_beyond_counting_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="1,000,000"):
        ImplicitSettings(steps=10_000_000_000)
