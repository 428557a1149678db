"""A new axis is one folder, here of one module, and one entry point."""

import json
from pathlib import Path

import pytest
from plug_in import granbench, install, refused, scores

AXIS = '''
"""Does the stress stay where it is while nothing happens?"""

import numpy as np
import xarray as xr

from granbench.benchmark.axis import Axis, Group, Part, Stored
from granbench.benchmark.bootstrap import Resampling
from granbench.benchmark.metric import WORST, Metric, Statistic
from granbench.benchmark.scorecard import ALL

DRIFT = Statistic("drift", lambda drift: drift)
ABOUT = "change of stress over ten increments of zero, in training standard deviations"


class Toy(Axis):
    """Ten increments of zero from the start of every path."""

    name = "toy"
    title = "Rest"
    parts = (Part(name="toy", axis="toy", title="Rest"),)
    own_metrics = (
        Metric(name="drift_mean", axis="toy", title="Drift", definition=ABOUT, statistic=DRIFT),
        Metric(name="drift_worst", axis="toy", title="Drift, worst path", definition=ABOUT,
               statistic=DRIFT, aggregation=WORST),
    )
    layout = {"toy_drift": Stored(("seed", "path", "component"), "Pa", "drift of the stress")}

    def predict(self, run):
        import torch  # scoring needs no torch, so only a prediction imports it

        from granbench.data.adapters import conditions_of

        def drift(cell):
            start = conditions_of(run.records, dtype=cell.dtype)
            state = cell.initial_state(start)
            for _ in range(10):
                stress, state = cell.step(torch.zeros_like(start.stress), state)
            change = (stress - start.stress).numpy()
            return xr.Dataset({"toy_drift": (("path", "component"), change)})

        return run.for_each_cell("toy", drift)

    def was_run(self, predictions, part):
        return "toy_drift" in predictions

    def sample(self, scored, part):
        drift = np.abs(scored.predictions["toy_drift"].values / scored.normalisation.std["stress"])
        return drift.max(axis=-1)  # (seed, path)

    def places(self, scored, split):
        rows = np.flatnonzero(scored.records["split"].values == split)
        if len(rows):
            resampling = Resampling.by_specimen(scored.records["specimen"].values[rows])
            yield self.parts[0], Group(split, ALL, len(rows), rows, resampling)


TOY = Toy()
'''
ENTRY_POINT = "toy = toy_axis:TOY"


def test_an_axis_of_another_package_is_scored_shown_and_validated(tmp_path: Path) -> None:
    install(tmp_path, {"toy_axis.py": AXIS}, "granbench.axes", ENTRY_POINT)
    file = tmp_path / "toy.json"
    words = ("evaluate", "persistence", "--task", "dem-triaxial-mini", "--axis", "toy")
    table = granbench(tmp_path, *words, "--out", "toy.json")
    # In the scorecard,
    found = scores(file, axis="toy", split="test")
    assert [score["metric"] for score in found] == ["drift_mean", "drift_worst"]
    assert [score["value"] for score in found] == [0.0, 0.0]
    assert {score["status"] for score in scores(file, axis="rollout")} == {"not_run"}
    # in the terminal,
    assert "Rest of persistence on dem-triaxial-mini, split test" in " ".join(table.split())
    assert "Drift, worst path" in table
    # where the predictions are scored again,
    checked = json.loads(granbench(tmp_path, "submission", "validate", "toy.json", "--json"))
    assert checked["valid"] and checked["badge"] == "rescored"
    # and on the board.
    (tmp_path / "board").mkdir()
    granbench(
        tmp_path, "leaderboard", "build", "--out", "site", "--board", "board", "--with", "toy.json"
    )
    page = (tmp_path / "site" / "dem-triaxial-mini-1.0.0.html").read_text()
    assert "<h2>Rest</h2>" in page and ">Drift, worst path</button>" in page
    assert "<dt>Drift</dt><dd>change of stress over ten increments of zero" in page


def test_a_task_does_not_ask_for_an_axis_of_another_package(tmp_path: Path) -> None:
    """Without `--axis` the axes of the task are run, so that submissions stay comparable."""
    install(tmp_path, {"toy_axis.py": AXIS}, "granbench.axes", ENTRY_POINT)
    words = ("evaluate", "persistence", "--task", "dem-triaxial-mini")
    shown = granbench(tmp_path, *words, "--out", "all.json")
    for title in ("Rest", "Embedded"):
        assert title not in shown
    (toy, *_) = scores(tmp_path / "all.json", axis="toy")
    assert toy["status"] == "not_applicable"


def test_a_submission_is_valid_with_and_refused_without_the_package_of_an_axis(
    tmp_path: Path,
) -> None:
    bare, extended = tmp_path / "bare", tmp_path / "extended"
    bare.mkdir()
    install(extended, {"toy_axis.py": AXIS}, "granbench.axes", ENTRY_POINT)
    words = ("evaluate", "persistence", "--task", "dem-triaxial-mini", "--axis", "single-step")
    granbench(bare, *words, "--quiet", "--out", "bare.json")
    granbench(extended, *words, "--axis", "toy", "--quiet", "--out", "run.json")
    granbench(extended, *words, "--quiet", "--out", "not_run.json")
    # A submission that was made before the axis was installed lacks its scores;
    said = granbench(extended, "submission", "validate", bare / "bare.json", "--json")
    assert json.loads(said)["valid"]
    # one that has them cannot be checked where the axis is not installed.
    for file, missing in (("run.json", "variable 'toy_drift'"), ("not_run.json", "axis 'toy'")):
        error = " ".join(refused(bare, "submission", "validate", extended / file).split())
        assert missing in error and "install the package" in error


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (('Part(name="toy"', 'Part(name="rollout"'), ("part 'rollout'", "along-paths")),
        (('axis="toy", title="Rest"),)', 'axis="cost", title="Rest"),)'), ("'toy'", "axis 'cost'")),
        (('{"toy_drift": Stored(', '{"stress": Stored('), ("variable 'stress'", "along-paths")),
        (("    layout =", '    labels = {"noise": ["a"]}\n    layout ='),
         ("coordinate 'noise'", "along-paths")),
    ],
    ids=["part", "axis of a part", "variable", "coordinate"],
)  # fmt: skip
def test_an_axis_that_uses_a_name_of_another_is_refused(tmp_path: Path, change, named) -> None:
    install(tmp_path, {"toy_axis.py": AXIS.replace(*change)}, "granbench.axes", ENTRY_POINT)
    words_of_command = ("evaluate", "persistence", "--task", "dem-triaxial-mini", "--axis", "toy")
    error = " ".join(refused(tmp_path, *words_of_command, "--out", "toy.json").split())
    for words in ("axis 'toy'", *named):
        assert words in error


TOY = ("--task", "dem-triaxial-mini", "--axis", "toy", "--quiet", "--out", "toy.json")


@pytest.mark.parametrize(
    "line",
    [
        "        import torch",
        "            state = cell.initial_state(start)",
        "        drift = np.abs(scored",
        "        rows = np.flatnonzero(",
    ],
    ids=["predict", "measurement of a cell", "sample", "places"],
)
def test_an_exception_in_an_axis_names_its_package_and_line(tmp_path: Path, line: str) -> None:
    indent = " " * (len(line) - len(line.lstrip()))
    broken = AXIS.replace(line, f"{indent}1 / 0\n{line}", 1)
    install(tmp_path, {"toy_axis.py": broken}, "granbench.axes", ENTRY_POINT)
    error = " ".join(refused(tmp_path, "evaluate", "persistence", *TOY).split())
    number = broken.splitlines().index(f"{indent}1 / 0") + 1
    for words in ("axis 'toy'", "my-package", "ZeroDivisionError", f"toy_axis.py line {number}"):
        assert words in error
    assert "model" not in error


def test_an_exception_in_a_cell_names_the_cell_and_not_the_axis(tmp_path: Path) -> None:
    cell = """
from granbench.baselines.persistence import PersistenceCell


class Broken(PersistenceCell):
    name = "broken"

    def initial_state(self, start):
        if len(start.stress) > 10:  # more than are checked
            raise KeyError("fabric")
        return super().initial_state(start)


def cell():
    return Broken()
"""
    files = {"toy_axis.py": AXIS, "broken.py": cell}
    install(tmp_path, files, "granbench.axes", ENTRY_POINT)
    error = " ".join(refused(tmp_path, "evaluate", "broken:cell", *TOY).split())
    assert "cell 'broken'" in error and "broken.py line 10" in error
    assert "my-package" not in error
