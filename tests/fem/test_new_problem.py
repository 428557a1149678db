"""Recipe: a boundary-value problem of your own is one file and one entry point."""

from pathlib import Path

import pytest
import xarray as xr
from plug_in import granbench, install, refused

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

ENTRY_POINT = "oedometer = oedometer:Oedometer"


def installed(folder: Path, entry: str = ENTRY_POINT) -> Path:
    """The folder of the package with the problem."""
    install(folder, {"oedometer.py": PROBLEM}, "granbench.problems", entry)
    return folder


def test_a_new_problem_runs_from_the_command_line(tmp_path: Path) -> None:
    words = ["fem", "oedometer", "--cell", "j2", "--solver", "implicit", "--mesh", "coarse"]
    choices = ["--choose", "end_strain=0.01", "--outputs", "5", "--out", "oedometer.nc"]
    granbench(installed(tmp_path), *words, *choices)
    with xr.open_dataset(tmp_path / "oedometer.nc") as found:
        assert found.attrs["problem"] == "oedometer" and found.attrs["completed"]
        # The cell is compressed at constant width: its volumetric strain is the driving strain, and
        # its mean stress that of the bulk modulus (1.25 MPa) whether it yields or not.
        assert float(found["volumetric_strain"][-1]) == pytest.approx(0.01)
        mean = found["stress"].sel(component=["xx", "yy"]).mean("component")
        assert mean[-1].values == pytest.approx(1.25e6 * 0.01)


def test_help_and_errors_name_the_new_problem(tmp_path: Path) -> None:
    assert "oedometer" in granbench(installed(tmp_path), "fem", "--help")
    misspelt = refused(tmp_path, "fem", "oedometr", "--cell", "j2", "--out", "a.nc")
    assert "'oedometer'" in misspelt


@pytest.mark.parametrize(
    ("entry", "named"),
    [
        ("oedometer = oedometer:Missing", "my-package"),  # nothing of this name in the module
        ("oedometer = oedometer:HEIGHT", "Problem"),  # not a problem
        ("consolidation = oedometer:Oedometer", "'oedometer'"),  # another name than the class's
    ],
)
def test_a_broken_registration_is_an_error_that_names_the_package(
    tmp_path: Path, entry: str, named: str
) -> None:
    name = entry.split()[0]
    error = refused(installed(tmp_path, entry), "fem", name, "--cell", "j2", "--out", "a.nc")
    assert named in error
