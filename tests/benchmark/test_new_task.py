"""A new task is one YAML file; and what holds for every registered task."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import xarray as xr
import yaml
from plug_in import granbench, install

from granbench.benchmark.axes.embedded.metrics import NAME as EMBEDDED
from granbench.benchmark.registry import axis_names
from granbench.benchmark.task import Task
from granbench.benchmark.task_context import context_of
from granbench.benchmark.task_registry import (
    TASK_FOLDER,
    find_task,
    read_task,
    readable_tasks,
    registered_tasks,
    task_records,
)
from granbench.benchmark.task_summary import shortages_of_task, split_sizes
from granbench.data.registry import entry
from granbench.data.splits import select_split, split_names
from granbench.errors import ConfigurationError, DatasetError, RegistryError
from granbench.fem import PROBLEMS
from granbench.fem.stated_problem import build_problem
from granbench.fem.statement import EMBEDDED_ANALYSES, EmbeddedAnalysis
from granbench.leaderboard.submission import read_submission
from granbench.models.ground_truth import ground_truth_cell
from granbench.models.j2 import J2

TOY = """\
id: toy
version: 1.0.0
summary: J2 in a small biaxial test, learnt from a few of the random paths of gp-j2.
dataset:
  name: gp-j2-mini
  version: 1.0.0
  content_sha256: 678b4e310738db459b279eff24f8787ed0857785667c3d983310d92b2e8b2792
splits:
  training: [train]
  validation: [validation]
  test: [test]
  ood: [ood-cyclic]
context: [stress, initial_mean_stress]
axes: [rollout, embedded]
analyses:
  - name: pressed
    problem: biaxial
    mesh: coarse
    choices: {ends: smooth, confinement: 0.0, end_strain: 0.002, speed: 0.02}
    solvers: [implicit]
    outputs: 4
    points: 8
    modulus: 2.1e+6
ground_truth:
  model: j2
  parameters: {bulk_modulus: 1.25e+6, shear_modulus: 833333.3333333334, yield_stress: 1.0e+5}
training_data:
  - {dataset: gp-j2-mini, version: 1.0.0, splits: [train, validation]}
"""
"""The whole of a task: `granbench evaluate j2 --task toy.yaml` needs nothing else."""


def check_toy_submission(folder: Path) -> None:
    """J2 is the ground truth: it follows the analysis exactly and the paths up to rounding."""
    submission = read_submission(folder / "submission.json")
    assert (submission.task, submission.dataset.name) == ("toy", "gp-j2-mini")
    scored = [score for score in submission.scores if score.status == "scored"]
    assert {score.axis for score in scored} == {"rollout", "embedded"}
    assert {score.split for score in scored} == {"test", "ood-cyclic", "all"}
    errors = {score.value for score in scored if score.metric == "reaction_error"}
    assert errors == {0.0}
    # An axis that the task does not have is not missing.
    assert not [score for score in submission.scores if score.status == "not_run"]


def test_a_task_is_one_yaml_file(tmp_path: Path) -> None:
    (tmp_path / "toy.yaml").write_text(TOY)
    words = ("--keep", "model", "--out", "submission.json")
    granbench(tmp_path, "evaluate", "j2", "--task", "toy.yaml", *words)
    check_toy_submission(tmp_path)
    said = granbench(
        tmp_path, "submission", "validate", "submission.json", "--task", "toy.yaml", "--json"
    )
    assert json.loads(said)["badge"] == "rerun"


def test_another_package_brings_a_task(tmp_path: Path) -> None:
    """The package `toy_tasks` with toy.yaml, installed with an entry point `granbench.tasks`."""
    files = {"toy_tasks/__init__.py": "", "toy_tasks/toy.yaml": TOY}
    install(tmp_path, files, "granbench.tasks", "toy-tasks = toy_tasks")
    listed = json.loads(granbench(tmp_path, "task", "list", "--json"))
    assert "toy" in {task["id"] for task in listed}
    words = ("--keep", "model", "--out", "submission.json")
    granbench(tmp_path, "evaluate", "j2", "--task", "toy", *words)
    check_toy_submission(tmp_path)
    said = granbench(tmp_path, "submission", "validate", "submission.json", "--json")
    assert json.loads(said)["task"] == "toy"


def test_a_broken_package_of_tasks_is_named_and_disturbs_no_task_of_granbench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {"broken_tasks.py": ""}
    install(tmp_path, files, "granbench.tasks", "mine = broken_tasks")
    monkeypatch.syspath_prepend(tmp_path)
    assert find_task("gp-j2-mini").id == "gp-j2-mini"
    with pytest.raises(RegistryError, match="broken_tasks"):
        find_task("toy")
    tasks, faults = readable_tasks()
    assert {"gp-j2", "gp-j2-mini"} <= {task.id for task in tasks}
    (fault,) = faults
    assert "broken_tasks" in str(fault)
    sys.modules.pop("broken_tasks", None)


def test_a_package_cannot_take_the_name_of_a_task_of_granbench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = TOY.replace("id: toy", "id: gp-j2-mini").replace("version: 1.0.0", "version: 2.0.0", 1)
    files = {"other_tasks/__init__.py": "", "other_tasks/toy.yaml": text}
    install(tmp_path, files, "granbench.tasks", "mine = other_tasks")
    monkeypatch.syspath_prepend(tmp_path)
    assert find_task("gp-j2-mini").version == "1.0.0"
    with pytest.raises(RegistryError, match=r"toy\.yaml: id"):
        registered_tasks()
    sys.modules.pop("other_tasks", None)


def changed(change: Callable[[dict], object], folder: Path) -> Path:
    fields = yaml.safe_load(TOY)
    change(fields)
    file = folder / "toy.yaml"
    file.write_text(yaml.safe_dump(fields))
    return file


SPOILED: dict[str, tuple[Callable[[dict], object], str]] = {
    "unknown field": (lambda task: task.update(colour="red"), "colour"),
    "missing field": (lambda task: task.pop("context"), "context"),
    "unknown axis": (lambda task: task["axes"].append("sideways"), "axes.*sideways"),
    "axis without analyses": (lambda task: task.pop("analyses"), "analyses"),
    "analyses without a truth": (lambda task: task.pop("ground_truth"), "ground_truth"),
    "no confinement": (lambda task: task["analyses"][0]["choices"].pop("confinement"),
                       r"analyses\.0.*confinement"),
    "analyses of one name": (lambda task: task["analyses"].append(task["analyses"][0]),
                             "analyses.*pressed"),
    "other outputs": (lambda task: task["analyses"].append(
        task["analyses"][0] | {"name": "other", "outputs": 2}), "analyses.*outputs"),
    "dataset that is not registered": (lambda task: task["dataset"].update(name="gp-j3"),
                                       r"dataset\.name.*gp-j3"),
    "version that is not registered": (lambda task: task["dataset"].update(version="9.9.9"),
                                       r"dataset\.version.*9\.9\.9"),
    "another content hash": (lambda task: task["dataset"].update(content_sha256="0" * 64),
                             r"dataset\.content_sha256"),
    "a file that is not there": (lambda task: task["dataset"].update(file="a.nc"),
                                 r"dataset\.file.*a\.nc"),
    "split listed twice": (lambda task: task["splits"]["ood"].append("train"), "splits.*train"),
    "nothing to score": (lambda task: task["splits"].update(test=[], ood=[]), "splits.*test"),
    "a model that there is not": (lambda task: task["ground_truth"].update(model="j3"),
                                  "ground_truth.*j3"),
    "another model's parameters": (lambda task: task["ground_truth"].update(model="ime"),
                                   "ground_truth.*ime"),
    "a misspelt parameter": (lambda task: task["ground_truth"]["parameters"].update(
        yield_strss=task["ground_truth"]["parameters"].pop("yield_stress")),
                             "ground_truth.*yield_strss"),
    "a parameter out of range": (lambda task: task["ground_truth"]["parameters"].update(
        yield_stress=-1.0), "ground_truth.*yield_stress"),
    "training on a dataset that is not registered": (
        lambda task: task["training_data"][0].update(dataset="gp-j3"),
        r"training_data\.0\.dataset.*gp-j3"),
    "training on a version that is not registered": (
        lambda task: task["training_data"][0].update(version="9.9.9"),
        r"training_data\.0\.version.*9\.9\.9"),
    "training on a split that is not there": (
        lambda task: task["training_data"][0]["splits"].append("foo"), "training_data.*foo"),
    "training on a split that another dataset lacks": (
        lambda task: task["training_data"].append(
            {"dataset": "dem-triaxial-mini", "version": "1.0.0", "splits": ["foo"]}),
        r"training_data\.1\.splits.*foo"),
    "training on a scored split": (
        lambda task: task["training_data"][0]["splits"].append("test"), r"training_data\.0.*test"),
    "the id of a registered task": (lambda task: task.update(id="gp-j2-mini"), "id.*gp-j2-mini"),
    "a version of two numbers": (lambda task: task.update(version="1.0"),
                                 r"version.*three numbers"),
    "a version that is a number": (lambda task: task.update(version=1.0),
                                   r"version.*three numbers"),
    "no axes": (lambda task: task.update(axes=[]), "axes.*empty"),
    "no training split": (lambda task: task["splits"].update(training=[]),
                          r"splits\.training.*empty"),
    "no solver": (lambda task: task["analyses"][0].update(solvers=[]),
                  r"analyses\.0\.solvers.*empty"),
    "one name in place of a list": (lambda task: task.update(axes="rollout"), "axes.*list"),
    "a summary of two lines": (lambda task: task.update(summary="a\nb"), "summary.*line"),
    "no name": (lambda task: task.update(id="My Task"), "id"),
    "not a mapping": (lambda task: task.clear(), "id"),
}  # fmt: skip


@pytest.mark.parametrize("case", SPOILED)
def test_a_damaged_task_names_the_file_and_the_field(case: str, tmp_path: Path) -> None:
    change, field = SPOILED[case]
    file = changed(change, tmp_path)
    with pytest.raises(RegistryError, match=rf"toy\.yaml.*{field}"):
        find_task(str(file))


def test_a_registered_task_can_be_read_from_a_copy_of_its_file(tmp_path: Path) -> None:
    copy = tmp_path / "copy.yaml"
    copy.write_text((TASK_FOLDER / "gp-j2-mini-1.0.0.yaml").read_text())
    assert find_task(str(copy)) == find_task("gp-j2-mini")


def test_the_ground_truth_may_be_a_published_set(tmp_path: Path) -> None:
    """A set needs no parameters; the attribute that is made of it describes a model."""
    truth = {"model": "j2", "parameter_set": next(iter(J2.parameter_sets))}
    task = find_task(str(changed(lambda task: task.update(ground_truth=truth), tmp_path)))
    with task_records(task) as records:
        cell = ground_truth_cell(task.view(records))
    assert cell is not None and cell.values() == J2().values()


def test_a_task_may_have_no_test_split_but_splits_out_of_distribution(tmp_path: Path) -> None:
    task = find_task(str(changed(lambda task: task["splits"].update(test=[]), tmp_path)))
    assert task.splits.scored == ("ood-cyclic",)


def test_a_missing_validation_split_is_named(tmp_path: Path) -> None:
    task = find_task(str(changed(lambda task: task["splits"].update(validation=[]), tmp_path)))
    with (
        task_records(task) as records,
        pytest.raises(DatasetError, match=r"splits\.validation"),
        task.naming_missing_splits(),
    ):
        select_split(task.trainable(records), "validation")


def test_a_fault_has_one_remedy_and_no_words_of_a_parser(tmp_path: Path) -> None:
    file = changed(lambda task: task.update(embedded_analyses=[]), tmp_path)
    with pytest.raises(RegistryError, match="embedded_analyses") as unknown:
        find_task(str(file))
    assert str(unknown.value).count(";") == 1
    file.write_text("id: [toy\nversion: 1.0.0\n")
    with pytest.raises(RegistryError, match=r"toy\.yaml.*line 2") as broken:
        find_task(str(file))
    assert "unicode" not in str(broken.value)


def test_what_is_no_yaml_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "toy.yaml"
    for text in ("a: [", "[" * 5000, "\x00", "- 1", "''"):
        file.write_text(text)
        with pytest.raises(RegistryError, match=r"toy\.yaml"):
            find_task(str(file))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda task: task["splits"]["ood"].append("ood-wall"), "splits.*ood-wall"),
        (lambda task: task["context"].append("grading_index"), "context.*grading_index"),
        (lambda task: task["context"].remove("stress"), "context.*stress"),
    ],
)
def test_a_task_that_its_records_do_not_fit_is_refused(change, field: str, tmp_path: Path) -> None:
    file = changed(change, tmp_path)
    with pytest.raises(RegistryError, match=rf"toy\.yaml: .*{field}"):
        find_task(str(file))


def test_records_that_are_not_at_hand_are_compared_when_they_are_opened() -> None:
    task = find_task("gp-j2-mini")
    splits = task.splits.model_copy(update={"ood": ("ood-wall",)})
    with pytest.raises(DatasetError, match=r"splits.*ood-wall"):
        task_records(task.model_copy(update={"splits": splits}))


def test_an_unknown_name_is_refused_with_similar_ones() -> None:
    with pytest.raises(RegistryError, match="gp-j2-mini"):
        find_task("gp-j2-minni")
    with pytest.raises(RegistryError, match=r"9\.9\.9.*1\.0\.0"):
        find_task("gp-j2@9.9.9")
    with pytest.raises(DatasetError, match=r"nowhere\.nc"):
        find_task("nowhere.nc")
    assert find_task("gp-j2@1.0.0") == find_task("gp-j2")


def test_an_axis_that_the_task_lacks_is_refused() -> None:
    task = find_task("gp-j2-mini")
    assert task.chosen_axes(["cost", "rollout"]) == ("rollout", "cost")
    with pytest.raises(ConfigurationError, match="'embedded'.*rollout"):
        task.chosen_axes([EMBEDDED])


def test_training_sees_only_what_the_task_allows(tmp_path: Path) -> None:
    """Here one of the random kinds of paths is for training and the usual test split is unused."""

    def other_splits(task: dict) -> None:
        task["splits"] = {"training": ["train", "ood-cyclic"], "test": ["ood-rougher"]}
        task["training_data"][0]["splits"] = ["train", "ood-cyclic"]

    task = find_task(str(changed(other_splits, tmp_path)))
    with task_records(task) as records:
        trainable, scored = task.trainable(records), task.scored(records)
        view = task.view(records)
        both = sum(select_split(records, name).sizes["path"] for name in ("train", "ood-cyclic"))
        assert split_names(trainable) == ("train",) and trainable.sizes["path"] == both
        assert split_names(scored) == ("test",)
        assert split_names(view) == ("train", "test")
        rougher = select_split(records, "ood-rougher")
        assert list(scored["path_id"].values) == list(rougher["path_id"].values)
        elsewhere = [task.training_data[0].model_copy(update={"dataset": "gp-dp"})]
        with pytest.raises(DatasetError, match="training_data.*train"):
            task.model_copy(update={"training_data": elsewhere}).trainable(records)


def test_two_tasks_of_one_name_and_version_are_refused(tmp_path: Path, monkeypatch) -> None:
    for name in ("one", "other"):
        (tmp_path / f"{name}.yaml").write_text(TOY)
    monkeypatch.setattr("granbench.benchmark.task_registry.TASK_FOLDER", tmp_path)
    with pytest.raises(RegistryError, match=r"other\.yaml.*one\.yaml"):
        registered_tasks()


TASKS = {f"{task.id}@{task.version}": task for task in registered_tasks()}


@pytest.fixture(params=TASKS)
def task(request: pytest.FixtureRequest) -> Task:
    return TASKS[request.param]


@pytest.fixture
def records(task: Task):
    with task_records(task) as opened:
        yield opened


def test_file_names_are_those_of_the_tasks() -> None:
    for file in TASK_FOLDER.iterdir():
        task = read_task(file)
        assert file.name == f"{task.id}-{task.version}.yaml"


def test_the_dataset_of_a_task_is_registered(task: Task) -> None:
    registered = entry(f"{task.dataset.name}@{task.dataset.version}")
    assert registered.content_sha256 == task.dataset.content_sha256


def test_the_splits_of_a_task_partition_its_file(task: Task, records: xr.Dataset) -> None:
    listed = list(task.splits.roles())
    assert sorted(listed) == sorted(split_names(records))
    assert task.view(records)["split"].identical(records["split"])
    scored = task.scored(records)["split"].values.astype(str)
    assert set(scored) == set(task.splits.scored)


def test_axes_are_registered_and_the_context_is_what_records_give(
    task: Task, records: xr.Dataset
) -> None:
    assert set(task.axes) <= set(axis_names()) and len(set(task.axes)) == len(task.axes)
    assert task.context == context_of(records)


def test_analyses_name_registered_problems_and_meshes(task: Task) -> None:
    for analysis in task.analyses:
        problem = build_problem(analysis)
        assert type(problem) is PROBLEMS[analysis.problem]
        assert analysis.mesh in problem.meshes


def test_the_ground_truth_is_that_of_the_file(task: Task, records: xr.Dataset) -> None:
    ours, theirs = ground_truth_cell(task.view(records)), ground_truth_cell(records)
    assert (ours is None) == (theirs is None)
    if ours is not None and theirs is not None:
        assert (ours.name, ours.values()) == (theirs.name, theirs.values())


def test_released_files_propose_the_analyses_of_their_tasks(
    task: Task, records: xr.Dataset
) -> None:
    """Nothing reads the attribute; a later version of a task may have other analyses."""
    if EMBEDDED_ANALYSES in records.attrs:
        listed = json.loads(records.attrs[EMBEDDED_ANALYSES])
        assert task.analyses == tuple(map(EmbeddedAnalysis.model_validate, listed))


def test_a_file_of_records_is_the_task_of_its_name(task: Task, records: xr.Dataset) -> None:
    alone = Task.of_records(records)
    assert alone.splits.roles() == task.splits.roles()
    assert alone.ground_truth == task.ground_truth
    assert not alone.analyses and alone.training_data == task.training_data


def test_few_specimens_are_said(task: Task, records: xr.Dataset) -> None:
    notes = " ".join(shortages_of_task(task, split_sizes(task, records)))
    few = {"fem-ime": ("ood-wall", "ood-footing"), "fem-csuh": ("ood-wall", "ood-footing"),
           "dem-triaxial-mini": ("ood-psd",)}.get(task.id, ())  # fmt: skip
    assert all(split in notes for split in few) and bool(notes) == bool(few)
