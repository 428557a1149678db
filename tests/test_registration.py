"""Objects that other packages register by entry points."""

import sys
from pathlib import Path

import pytest

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

    def install(**points: str) -> None:
        (tmp_path / "my_models.py").write_text(SOURCE)
        metadata = tmp_path / "my_models-1.0.dist-info"
        metadata.mkdir()
        (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: my-models\nVersion: 1.0\n")
        lines = [f"{name} = {value}" for name, value in points.items()]
        (metadata / "entry_points.txt").write_text("\n".join(["[granbench.models]", *lines, ""]))
        monkeypatch.syspath_prepend(tmp_path)

    yield install
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


def test_a_model_of_granbench_has_priority_over_another_of_its_name(plug_in) -> None:
    plug_in(j2="my_models:Clay")
    assert MODELS["j2"] is J2
    assert MODELS.own("j2")


def test_a_package_that_cannot_be_loaded_is_named(plug_in) -> None:
    plug_in(broken="my_models:Nothing", absent="no_such_module:Clay")
    for name in ("broken", "absent"):
        with pytest.raises(ModelError, match=f"'{name}'.*my-models"):
            find_cells(name)


def test_an_unregistered_name_is_an_error() -> None:
    assert "no-such-model" not in MODELS
    with pytest.raises(KeyError):
        MODELS["no-such-model"]
