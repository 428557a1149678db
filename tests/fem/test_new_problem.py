"""Recipe: a boundary-value problem of your own is one file and one entry point."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

PROBLEM = '''
"""Oedometer: soil 0.1 m wide between smooth walls, 20 mm high, is compressed from above."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from granbench.fem import Problem, rectangle
from granbench.fem.loading import Loading, Prescribed

WIDTH, HEIGHT = 0.1, 0.02


@dataclass(frozen=True, kw_only=True)
class Oedometer(Problem):
    name: ClassVar[str] = "oedometer"
    title: ClassVar[str] = "Oedometer test"
    drive: ClassVar[str] = "displacement of the top platen"
    reaction: ClassVar[str] = "force of the top platen"
    length: ClassVar[str] = "height"
    meshes: ClassVar = {
        "coarse": partial(rectangle, WIDTH, HEIGHT, 4, 1),
        "medium": partial(rectangle, WIDTH, HEIGHT, 10, 2),
    }

    @property
    def drive_length(self):
        return HEIGHT

    def loading(self, mesh):
        held = (
            Prescribed("bottom", y=0.0),
            Prescribed("left", x=0.0),
            Prescribed("right", x=0.0),
            Prescribed("top", y=-1.0),
        )
        return Loading(held, self.drive_history())
'''

ENTRY_POINT = """
[granbench.problems]
oedometer = oedometer:Oedometer
"""

METADATA = "Metadata-Version: 2.1\nName: my-problems\nVersion: 1.0\n"


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """The folder of a package as pip leaves it: the module, and what the package registers."""
    (tmp_path / "oedometer.py").write_text(PROBLEM)
    registered = tmp_path / "my_problems-1.0.dist-info"
    registered.mkdir()
    (registered / "entry_points.txt").write_text(ENTRY_POINT)
    (registered / "METADATA").write_text(METADATA)
    return tmp_path


def granbench(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder, with the packages that are installed there."""
    return subprocess.run(
        [sys.executable, "-m", "granbench", *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_a_new_problem_runs_from_the_command_line(installed: Path) -> None:
    words = ["fem", "oedometer", "--cell", "j2", "--solver", "implicit", "--mesh", "coarse"]
    choices = ["--choose", "end_strain=0.01", "--outputs", "5", "--out", "oedometer.nc"]
    done = granbench(installed, *words, *choices)
    assert done.returncode == 0, done.stderr
    with xr.open_dataset(installed / "oedometer.nc") as found:
        assert found.attrs["problem"] == "oedometer" and found.attrs["completed"]
        # The cell is compressed at constant width: its volumetric strain is the driving strain, and
        # its mean stress that of the bulk modulus (1.25 MPa) whether it yields or not.
        assert float(found["volumetric_strain"][-1]) == pytest.approx(0.01)
        mean = found["stress"].sel(component=["xx", "yy"]).mean("component")
        assert mean[-1].values == pytest.approx(1.25e6 * 0.01)


def test_help_and_errors_name_the_new_problem(installed: Path) -> None:
    assert "oedometer" in granbench(installed, "fem", "--help").stdout
    refused = granbench(installed, "fem", "oedometr", "--cell", "j2", "--out", "a.nc")
    assert refused.returncode == 2 and "'oedometer'" in refused.stderr


@pytest.mark.parametrize(
    ("entry", "named"),
    [
        ("oedometer = oedometer:Missing", "my-problems"),  # nothing of this name in the module
        ("oedometer = oedometer:HEIGHT", "Problem"),  # not a problem
        ("consolidation = oedometer:Oedometer", "'oedometer'"),  # another name than the class's
        ("biaxial = oedometer:Oedometer", "more than once"),  # a name that is taken
    ],
)
def test_a_broken_registration_is_an_error_that_names_the_package(
    installed: Path, entry: str, named: str
) -> None:
    (file,) = installed.glob("*.dist-info/entry_points.txt")
    file.write_text(f"[granbench.problems]\n{entry}\n")
    name = entry.split()[0]
    refused = granbench(installed, "fem", name, "--cell", "j2", "--out", "a.nc")
    assert refused.returncode == 2 and named in refused.stderr, refused.stderr
