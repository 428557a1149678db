"""Objects that other packages register by entry points."""

import sys
from pathlib import Path

import pytest
from plug_in import install, python

from granbench.cells.find import find_cells
from granbench.errors import ModelError, SubmissionError
from granbench.leaderboard.model_files import require_data_only
from granbench.models import MODELS
from granbench.models.j2 import J2

SOURCE = """
from granbench.models.j2 import J2

class Clay(J2):
    name = "plug-in-clay"
"""


@pytest.fixture
def plug_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Installs a package with entry points of the group `granbench.models`."""

    def install_models(package: str = "my-models", **points: str) -> None:
        entries = [f"{name} = {value}" for name, value in points.items()]
        folder = tmp_path / package
        install(folder, {"my_models.py": SOURCE}, "granbench.models", *entries, package=package)
        monkeypatch.syspath_prepend(folder)

    yield install_models
    sys.modules.pop("my_models", None)


def test_a_model_of_another_package_is_found_by_its_name(plug_in) -> None:
    before = list(MODELS)
    plug_in(**{"plug-in-clay": "my_models:Clay"})
    assert list(MODELS) == sorted([*before, "plug-in-clay"])
    found = find_cells("plug-in-clay", order="principal", seeds=(0,))
    assert found.name == found.cell.name == "plug-in-clay"
    assert found.cell.order == "principal"
    assert not MODELS.own("plug-in-clay")
    with pytest.raises(SubmissionError, match="plug-in-clay"):
        require_data_only(found)  # a rerun of a submission runs GranBench's own code alone


def test_the_package_of_a_name_is_known_after_a_change_of_folder(tmp_path: Path) -> None:
    """A package may be found by a relative path, as metadata in the folder of a checkout is."""
    entry = "plug-in-clay = my_models:Clay"
    install(tmp_path, {"my_models.py": SOURCE}, "granbench.models", entry, package="my-models")
    python(
        tmp_path,
        "import os, sys; sys.path[:] = ['', *(p for p in sys.path if p not in ('', os.getcwd()))]\n"
        "from granbench.models import MODELS\n"
        "assert 'plug-in-clay' in MODELS\n"
        "os.chdir('/')\n"
        "assert MODELS.package('plug-in-clay') == 'my-models'\n",
    )


def test_a_model_of_granbench_has_priority_over_another_of_its_name(plug_in) -> None:
    plug_in(j2="my_models:Clay")
    assert MODELS["j2"] is J2
    assert MODELS.own("j2")


def test_a_package_that_cannot_be_loaded_is_named(plug_in) -> None:
    plug_in(broken="my_models:Nothing", absent="no_such_module:Clay")
    for name in ("broken", "absent"):
        with pytest.raises(ModelError, match=f"'{name}'.*my-models"):
            find_cells(name)
    assert find_cells("j2").name == "j2"  # no other model is disturbed


def test_the_exception_of_a_package_that_cannot_be_loaded_is_shown_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {"broken_models.py": "raise ValueError('one\\nline  and another')"}
    install(tmp_path, files, "granbench.models", "broken = broken_models:Clay")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModelError, match="one line and another") as raised:
        MODELS["broken"]
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("value", ["my_models:J2", "my_models:SOURCE", "my_models"])
def test_an_object_that_does_not_belong_in_the_group_is_refused(plug_in, value: str) -> None:
    plug_in(clay=value)
    with pytest.raises(ModelError, match="'clay'.*my-models"):
        MODELS["clay"]


def test_two_packages_that_register_one_name_are_refused(plug_in) -> None:
    plug_in("my-models", clay="my_models:Clay")
    plug_in("other-models", clay="my_models:J2")
    with pytest.raises(ModelError, match="'clay'.*my-models and other-models"):
        find_cells("clay")


def test_an_unregistered_name_is_an_error() -> None:
    assert "no-such-model" not in MODELS
    with pytest.raises(KeyError):
        MODELS["no-such-model"]
