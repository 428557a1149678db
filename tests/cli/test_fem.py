"""`granbench fem`: from a problem's and a model's name to a file, or one sentence."""

import json
import signal
import sys

import meshio
import numpy as np
import pytest
import xarray as xr

from granbench.cli import main
from granbench.fem import ExplicitSettings, find_problem, run
from granbench.models import MODELS

MODULE = """
import os, signal
import torch
from granbench.cells.contract import ModuleCell

class Hooke(torch.nn.Module):
    def forward(self, dstrain, stress):
        volume = dstrain[:, :2].sum(dim=1, keepdim=True) * torch.tensor([1.0, 1.0, 0.0])
        return stress + 2e6 * volume + 4e6 * dstrain

class Breaks(Hooke):
    calls = 0
    def forward(self, dstrain, stress):
        stress = super().forward(dstrain, stress)
        return torch.where(stress[:, 1:2] > 4e4, torch.nan, stress)

class Signals(Hooke):
    number, calls = signal.SIGINT, 0
    def forward(self, dstrain, stress):
        self.calls += 1
        if self.calls == 200:
            signal.raise_signal(self.number)
        return super().forward(dstrain, stress)

class Uncalled(Hooke):
    def __init__(self):
        raise AssertionError("made although it cannot be used")

class Raises(Hooke):
    def forward(self, dstrain, stress):
        stress = super().forward(dstrain, stress)
        if (stress > 4e4).any():
            raise ValueError('boom')
        return stress

class Nothing(Hooke):
    def forward(self, dstrain, stress):
        return torch.full_like(stress, torch.nan)

class Pressed(Hooke):
    def forward(self, dstrain, stress):
        stress = torch.where(stress == 1e5, 1.5e5, stress)
        return super().forward(dstrain, stress)

class Swells(Hooke):
    def forward(self, dstrain, stress):
        stiffness = [[1e4, -1e6, 0.0], [-1e6, 2e8, 0.0], [0.0, 0.0, 1e4]]
        return stress + dstrain @ torch.tensor(stiffness, dtype=dstrain.dtype)

class Terminates(Signals):
    number = signal.SIGTERM

def of(module, order="plane"):
    return lambda: ModuleCell(module(), name=module.__name__.lower(), order=order)

hooke, breaks, signals, terminates = map(of, (Hooke, Breaks, Signals, Terminates))
solid = of(Hooke, "full")
uncalled, raises, nothing, pressed = map(of, (Uncalled, Raises, Nothing, Pressed))
swells = of(Swells)
"""


@pytest.fixture
def fem(capsys, monkeypatch, tmp_path):
    """Run `granbench fem` in a folder of its own; gives exit code, output and error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "own", raising=False)
    (tmp_path / "own.py").write_text(MODULE)

    def run(*words):
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main(["fem", *map(str, words)])
        captured = capsys.readouterr()
        return left.value.code, captured.out, captured.err

    return run


def refused(result, *parts):
    code, out, err = result
    assert (code, out) == (2, ""), err
    assert err.startswith("error: ") and err.count("\n") == 1, err
    for part in parts:
        assert part in err, err


COARSE = ("--mesh", "coarse", "--choose", "end_strain=0.01")


def test_file_holds_what_python_computes(fem):
    words = ("--cell", "ime", "--out", "a.nc", "--outputs", 10, "--choose", "ends=smooth")
    code, out, err = fem("biaxial", *words, *COARSE)
    assert code == 0 and out.startswith("a.nc: biaxial with ime, explicit, 32 Gauss points"), err
    problem = find_problem("biaxial", ends="smooth", end_strain=0.01)
    settings = ExplicitSettings(outputs=10)
    expected = run(problem, MODELS["ime"](), solver=settings, mesh="coarse").check()
    with xr.open_dataset("a.nc") as found:
        assert found.sizes["step"] == 11
        np.testing.assert_array_equal(found["reaction"], expected["reaction"])
        assert json.loads(found.attrs["choices"])["ends"] == "smooth"
        names = {"reaction", "volumetric_strain", "maximum_acceleration", "cell_seconds", "stress"}
        assert names <= set(found.data_vars)


def test_iterations_of_the_implicit_solver_are_in_the_json(fem):
    words = ("--cell", "own:hooke", "--solver", "implicit", "--outputs", 4, "--out", "a.nc")
    code, out, err = fem("strip-footing", *words, "--json", *COARSE)
    assert code == 0, err
    found = json.loads(out)
    assert (found["problem"], found["cell"]) == ("strip-footing", "hooke")
    assert found["output_steps"] == 4
    assert found["iterations"] >= 1
    assert found["reaction"] == found["largest_reaction"] > 0.0
    assert found["choices"]["end_strain"] == 0.01
    assert found["out"] == "a.nc"


@pytest.mark.parametrize("problem", ["dog-bone", "retaining-wall"])
def test_series_for_paraview_and_picture(fem, tmp_path, problem):
    words = ("--cell", "ime", "--out", "a.nc", "--vtu", "series", "--plot", "a.png")
    settings = ("--solver", "implicit", "--outputs", 2, "--mesh", "coarse")
    code, _, err = fem(problem, *words, *settings, "--choose", "end_strain=0.002")
    assert code == 0, err
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    index = (tmp_path / "series" / f"{problem}.pvd").read_text()
    assert index.count("<DataSet ") == 3
    last = meshio.read(tmp_path / "series" / f"{problem}-0002.vtu")
    with xr.open_dataset("a.nc") as found:
        moved = found["displacement"].values[-1]
        np.testing.assert_allclose(last.point_data["displacement"][:, :2], moved)
        np.testing.assert_allclose(last.points[:, :2], found["node_position"])
        means = found["stress"].values[-1, :, 1].reshape(found.sizes["element"], -1)
        by_volume = found["point_volume"].values.reshape(means.shape)
        expected = (means * by_volume).sum(axis=1) / by_volume.sum(axis=1)
        np.testing.assert_allclose(last.cell_data["stress_yy"][0], expected)
    assert "plastic_strain_xx" in last.cell_data


def test_point_without_stress_is_named_and_the_output_before_it_kept(fem):
    result = fem("biaxial", "--cell", "own:breaks", "--out", "a.nc", "--mesh", "coarse")
    refused(
        result, "breaks gives no finite stress at Gauss point", "in step", "where the strain",
        "a.nc holds the output up to driving strain 0.00",
    )  # fmt: skip
    with xr.open_dataset("a.nc") as found:
        assert found.attrs["completed"] == 0
        assert found.attrs["failed_step"] > 0
        assert 1 < found.sizes["step"] < 101
        assert np.isfinite(found["stress"]).all()


def test_module_that_raises_is_named_by_its_line_and_the_output_before_it_kept(fem):
    line = MODULE.splitlines().index("            raise ValueError('boom')") + 1
    for solver in ("explicit", "implicit"):
        words = ("--cell", "own:raises", "--solver", solver, "--out", f"{solver}.nc")
        refused(
            fem("biaxial", *words, "--mesh", "coarse"),
            f"with ValueError (boom) at own.py line {line}; fix the model",
            f"{solver}.nc holds the output up to driving strain 0.00",
        )
        with xr.open_dataset(f"{solver}.nc") as found:
            assert found.attrs["completed"] == 0
            assert 1 < found.sizes["step"] < 101


def test_model_that_fails_at_once_leaves_the_start(fem, tmp_path):
    words = ("--cell", "own:nothing", "--out", "a.nc", "--plot", "a.png", "--mesh", "coarse")
    refused(
        fem("biaxial", *words), "at zero strain",
        "a.nc holds only the start",
    )  # fmt: skip
    with xr.open_dataset("a.nc") as found:
        assert (found.sizes["step"], found.attrs["failed_step"]) == (1, 0)
    assert not (tmp_path / "a.png").exists()


def test_run_that_ended_early_has_its_series_and_picture(fem, tmp_path):
    words = ("--out", "a.nc", "--vtu", "series", "--plot", "a.png", "--mesh", "coarse")
    for cell, code in (("own:breaks", 2), ("own:signals", 130)):
        assert fem("biaxial", "--cell", cell, *words)[0] == code
        (tmp_path / "a.png").unlink()
        index = tmp_path / "series" / "biaxial.pvd"
        with xr.open_dataset("a.nc") as found:
            assert index.read_text().count("<DataSet ") == found.sizes["step"] < 101
        index.unlink()


def test_elements_that_turn_over_are_reported(fem):
    # A wall half a body's length into it: the soil folds at the foot of the wall.
    words = ("--cell", "own:hooke", "--solver", "implicit", "--out", "a.nc", "--outputs", 4)
    words = ("retaining-wall", *words, "--mesh", "coarse", "--choose", "end_strain=0.5")
    code, out, err = fem(*words)
    assert code == 0, err
    with xr.open_dataset("a.nc") as found:
        turned = found["turned_elements"].values
        first = int(np.flatnonzero(turned)[0])
        strain = float(found["driving_strain"][first])
    assert first > 0 and turned[0] == 0
    (note,) = [line for line in out.splitlines() if "turned over" in line]
    assert note.startswith(
        f"note: elements have turned over, {turned[first]} by output step {first}"
    )
    assert f"at driving strain {strain:.4g}" in note
    found = json.loads(fem(*words, "--json")[1])
    assert (found["first_turned_step"], found["turned_elements"]) == (first, turned.max())
    assert note.removeprefix("note: ") in found["warnings"]


def test_imbalance_at_the_start_is_reported(fem):
    words = ("biaxial", "--cell", "own:pressed", "--out", "a.nc", "--outputs", 2, *COARSE)
    code, out, _ = fem(*words, "--choose", "confinement=1e5")
    assert code == 0
    assert "note: the analysis starts out of balance: at zero strain, pressed" in out
    found = json.loads(fem(*words, "--choose", "confinement=1e5", "--json")[1])
    assert found["initial_imbalance"] == pytest.approx(0.5)
    assert len(found["warnings"]) == 1
    balanced = json.loads(fem(*words, "--choose", "confinement=2e5", "--json")[1])
    assert (balanced["initial_imbalance"], balanced["warnings"]) == (0.0, [])


@pytest.mark.parametrize(("cell", "code"), [("own:signals", 130), ("own:terminates", 143)])
def test_interrupted_run_keeps_its_output_so_far(fem, cell, code):
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    left, out, err = fem("biaxial", "--cell", cell, "--out", "a.nc", "--mesh", "coarse")
    assert (left, out) == (code, ""), err
    assert err.startswith("a.nc holds the output up to driving strain")
    said = {130: "interrupted", 143: "terminated"}[code]
    assert err.splitlines()[1:] == [
        f"{said}; run the same command again to start from the beginning"
    ]
    with xr.open_dataset("a.nc") as found:
        assert found.attrs["completed"] == 0
        assert 1 < found.sizes["step"] < 101
    assert before == (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM))


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("biaxal", "--cell", "j2"), ["unknown problem 'biaxal': did you mean 'biaxial'?"]),
        (("biaxial", "--cell", "j3"), ["unknown model 'j3'"]),
        (("biaxial", "--cell", "j2", "--mesh", "fin"), ["no mesh 'fin': did you mean 'fine'?"]),
        (("biaxial", "--cell", "j2", "--mesh", "soil.msh"), ["soil.msh: there is no such file"]),
        (("biaxial", "--cell", "j2", "--choose", "load_path=a.csv"), ["a.csv: cannot be read"]),
        (("biaxial", "--cell", "j2", "--solver", "exact"), ["there are explicit and implicit"]),
        (("biaxial", "--cell", "own:solid"), ["has 6 full components", "needs xx, yy, xy"]),
        (("biaxial", "--cell", "j2", "--time-step", "0.1"), ["is unstable", "one below"]),
        (("biaxial", "--cell", "j2", "--scheme", "newton"), ["--scheme"]),
        (
            ("biaxial", "--cell", "j2", "--solver", "implicit", "--time-step", "1e-4"),
            ["--time-step", "implicit"],
        ),
        (("biaxial", "--cell", "j2", "--outputs", "0"), ["--outputs 0: give 1 or more"]),
        (("biaxial", "--cell", "j2", "--damping", "-1"), ["damping is -1; give 0 to"]),
        (("biaxial", "--cell", "j2", "--choose", "cyclic"), ["'cyclic' is not a choice"]),
        (("biaxial", "--cell", "j2", "--choose", "cycles=many"), ["choose monotonic or cyclic"]),
        (("biaxial", "--cell", "j2", "--choose", "speed=fast"), ["speed=fast: give a number"]),
        (("biaxial", "--cell", "j2", "--choose", "wall=rough"), ["no choice 'wall'"]),
        (
            ("biaxial", "--cell", "j2", "--choose", "end_strain=10"),
            ["end_strain=10: is this 10 %?", "0.2 for 20 %"],
        ),
        (
            ("biaxial", "--cell", "j2", "--choose", "confinement=100"),
            ["confinement=100: is this 100 kPa", "confinement=100kPa"],
        ),
        (("biaxial", "--cell", "j2", "--choose", "end_strain=5"), ["end_strain=5: is this 5 %?"]),
        (("biaxial", "--cell", "j2", "--choose", "speed=100"), ["speed is 100 m/s", "in m/s"]),
        (
            ("biaxial", "--cell", "j2", "--choose", "confinement=random:1e300:1"),
            ["v_c = 1e+300", "at most 100"],
        ),
        (
            ("biaxial", "--cell", "j2", "--choose", "confinement=random:x"),
            ["give a pressure in Pa, or random:V_C:SEED"],
        ),
        (("retaining-wall", "--cell", "j2", "--choose", "weight=5"), ["weight=5"]),
        (("biaxial", "--cell", "csuh", "--choose", "confinement=0"), ["p0 above zero"]),
        (("biaxial", "--cell", "csuh", "--e0", "3"), ["void ratio of 3.0000", "loosest"]),
        (("biaxial", "--cell", "j2", "--ocr", "3"), ["--ocr is given, but j2 does not use it"]),
        (
            ("biaxial", "--cell", "j2", "--start", "grading_index=1"),
            ["--start grading_index is given, but j2 does not use it; leave it out"],
        ),
        (
            ("biaxial", "--cell", "j2", "--choose", "ends=smooth", "--choose", "ends=rough"),
            ["ends is given twice"],
        ),
        (("biaxial", "--cell", "persistence"), ["has no stiffness at the start", "modulus"]),
    ],
)  # fmt: skip
def test_user_errors_are_one_sentence(fem, words, parts, tmp_path):
    refused(fem(*words, "--out", "a.nc"), *parts)
    assert not (tmp_path / "a.nc").exists()


def test_load_path_of_a_file_is_one_load_step_a_row_at_least(fem, tmp_path):
    (tmp_path / "path.csv").write_text("time,displacement\n0,0\n1,2e-3\n2,1e-3\n3,3e-3\n")
    words = ("biaxial", "--cell", "own:hooke", "--solver", "implicit", "--mesh", "coarse",
             "--outputs", 1, "--choose", "load_path=path.csv", "--out", "a.nc")  # fmt: skip
    code, _, err = fem(*words)
    assert code == 0, err
    with xr.open_dataset("a.nc") as found:
        assert found["driving_displacement"].values == pytest.approx([0.0, 2e-3, 1e-3, 3e-3])
        # Hooke's law: the reaction follows the displacement, forth and back.
        reaction = found["reaction"].values / found["reaction"].values[1]
        assert reaction == pytest.approx([0.0, 1.0, 0.5, 1.5])
    refused(fem(*words, "--choose", "cycles=cyclic"), "load_path", "cycles")
    (tmp_path / "path.csv").write_text("time,displacement\n0,0\n2,2e-3\n1,1e-3\n")
    refused(fem(*words), "path.csv", "entry 2 is at 1 s after 2 s")
    (tmp_path / "path.csv").write_text("time [s],displacement [m]\n0,0\n1,2\n2,1\n3,3\n")
    refused(fem(*words), "as far as 3 m", "as displacement [mm]")


def test_volumetric_strains_that_no_soil_has_are_reported(fem):
    words = ("biaxial", "--cell", "own:swells", "--out", "a.nc", "--outputs", 4, "--plot", "a.png")
    words = (*words, "--solver", "implicit", "--choose", "ends=smooth", *COARSE)
    code, out, err = fem(*words)
    assert code == 0, err
    with xr.open_dataset("a.nc") as found:
        strain = found["strain"].values
        largest = np.abs(strain[..., 0] + strain[..., 1]).max(axis=1)
    first = int(np.flatnonzero(largest > 0.5)[0])
    (said,) = [line for line in out.splitlines() if "not credible" in line]
    assert said.startswith("note: the volumetric strain") and f"output step {first}" in said
    found = json.loads(fem(*words, "--json")[1])
    assert found["first_implausible_step"] == first
    assert (
        json.loads(fem(*words[:2], "own:hooke", *words[3:], "--json")[1])["first_implausible_step"]
        is None
    )


def test_notes_on_a_mesh_reach_the_user(fem, tmp_path):
    nodes = np.array([(x, y) for y in (0.0, 0.5, 1.0) for x in (0.0, 0.25, 0.5)])
    cells = np.array([(a, a + 1, a + 4, a + 3) for a in (0, 1, 3, 4)])
    meshio.Mesh(np.c_[nodes, np.zeros(9)], [("quad", cells)]).write(tmp_path / "soil.vtk")
    words = ("biaxial", "--cell", "own:hooke", "--mesh", "soil.vtk", "--solver", "implicit")
    words = (*words, "--outputs", 1, "--out", "a.nc", "--choose", "end_strain=0.01")
    code, out, err = fem(*words)
    assert code == 0, err
    assert "16 Gauss points of quad8 elements" in out
    assert "note: mesh soil.vtk: it names no boundary of the problem" in out


def test_a_file_that_is_read_is_not_written(fem, tmp_path):
    (tmp_path / "a.nc").write_text("time,displacement\n0,0\n1,2e-3\n")
    words = ("biaxial", "--cell", "own:uncalled", "--out", "a.nc", "--choose", "load_path=a.nc")
    refused(fem(*words), "--out a.nc", "load_path", "another file")
    assert (tmp_path / "a.nc").read_text().startswith("time")


def test_targets_are_refused_before_anything_is_computed(fem, tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.nc").mkdir()
    hooke = ("biaxial", "--cell", "own:hooke")
    refused(fem(*hooke, "--out", "a.csv"), "--out a.csv", "--out a.csv")
    refused(fem(*hooke, "--out", "folder.nc"), "is a folder")
    refused(fem(*hooke, "--out", "a.nc", "--vtu", "file"), "--vtu file is a file; give a folder")
    refused(fem(*hooke, "--out", "a.nc", "--plot", "a.gif"), "a.gif", ".png, .pdf or .svg")
    for option, target in (("--out", "a.nc"), ("--vtu", "series"), ("--plot", "a.png")):
        words = {"--out": "a.nc", option: f"file/{target}"}
        result = fem(
            "biaxial", "--cell", "own:uncalled", *(w for pair in words.items() for w in pair)
        )
        refused(result, f"{option} file/{target}", "cannot be written", "choose a folder")
    assert not (tmp_path / "a.nc").exists()


def test_quiet_run_prints_nothing(fem):
    words = ("--cell", "own:hooke", "--out", "a.nc", "--outputs", 2, "--quiet")
    assert fem("perforated-plate", *words, *COARSE) == (0, "", "")


def test_folder_of_a_trained_network_is_a_model(fem):
    with pytest.raises(SystemExit) as left:
        main(
            ["train", "gru", "--task", "gp-j2-mini", "--epochs", "1", "--out", "trained", "--quiet"]
        )
    assert left.value.code == 0
    words = ("--cell", "trained", "--out", "a.nc", "--outputs", 5)
    code, out, err = fem("biaxial", *words, *COARSE)
    assert code == 0 and "biaxial with gru, explicit" in out, err


def test_parameter_file_is_a_model(fem, tmp_path):
    from granbench.models.parameter_file import write_parameters

    softer = MODELS["ime"]({"young_modulus": 10e6})
    write_parameters(softer, tmp_path / "soft.json")
    words = ("--outputs", 2, "--json", *COARSE)
    reactions = [
        json.loads(fem("biaxial", "--cell", cell, "--out", "a.nc", *words)[1])["reaction"]
        for cell in ("ime", "soft.json")
    ]
    assert reactions[1] < 0.9 * reactions[0]
