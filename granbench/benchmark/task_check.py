"""The check of a task file against the models, datasets and tasks that are registered."""

from collections.abc import Iterable
from pathlib import Path

from granbench.benchmark.task import Task
from granbench.benchmark.task_parts import TruthModel
from granbench.data.registry import RegistryEntry, entries
from granbench.data.splits import split_names
from granbench.data.store import local_file
from granbench.errors import GranbenchError, ModelError, RegistryError
from granbench.records import open_records
from granbench.tensors import component_order


def registered_dataset(name: str, version: str) -> RegistryEntry | None:
    """The registered dataset of that name and version; None where there is none."""
    return next(
        (known for known in entries() if (known.id, known.version) == (name, version)), None
    )


def require_registered_dataset(task: Task, path: Path) -> RegistryEntry:
    """The registered dataset that a task names.

    Raises
    ------
    RegistryError
        If there is none, or its content hash is another one.
    """
    dataset = task.dataset
    entry = _require_entry(dataset.name, dataset.version, path, "dataset")
    if entry.content_sha256 != dataset.content_sha256:
        raise RegistryError(
            f"{path}: dataset.content_sha256 is {dataset.content_sha256[:12]}..., but that of "
            f"{entry.id} {entry.version} is {entry.content_sha256}; correct the task"
        )
    return entry


def require_models_and_splits(task: Task, path: Path) -> None:
    """Compare a task with the models, and with the datasets that are on this machine.

    A netCDF file beside the task is compared when it is opened, see
    `granbench.benchmark.task_registry.task_records`.

    Raises
    ------
    RegistryError
        If the ground truth is not a model with its parameters, a dataset to train on is unknown,
        or a dataset does not have what the task lists.
    """
    order = "plane"  # every model is defined there
    entry = registered_dataset(task.dataset.name, task.dataset.version)
    if task.dataset.file is None and entry is not None and (file := local_file(entry)):
        with open_records(file) as records:
            order = component_order(records["component"].values)
            try:
                task.view(records)
            except GranbenchError as error:
                raise RegistryError(f"{path}: {error}") from error
    if task.ground_truth is not None:
        _require_model(task.ground_truth, order, path)
    for at, data in enumerate(task.training_data):
        if (data.dataset, data.version) != (task.dataset.name, task.dataset.version):
            entry = _require_entry(data.dataset, data.version, path, f"training_data.{at}")
            _require_splits(entry, data.splits, path, f"training_data.{at}")


def require_own_id(task: Task, path: Path, registered: Iterable[Task]) -> None:
    """Refuse a task file that has the id of a registered task and another content.

    Parameters
    ----------
    task, path : the task and its file
    registered : tasks of that registry

    Raises
    ------
    RegistryError
        If its scores would be taken for those of the registered task.
    """
    same_id = [known for known in registered if known.id == task.id]
    here = task.dataset.model_copy(update={"file": None})
    if same_id and task.model_copy(update={"dataset": here}) not in same_id:
        raise RegistryError(
            f"{path}: id: {task.id!r} is the id of a registered task with another content; give "
            "this task another id"
        )


def _require_entry(name: str, version: str, path: Path, field: str) -> RegistryEntry:
    entry = registered_dataset(name, version)
    if entry is not None:
        return entry
    remedy = "use a dataset of `granbench data list`"
    if field == "dataset":
        remedy += ", or give the netCDF file beside the task as dataset.file"
        key = "dataset.name"
    else:
        key = f"{field}.dataset"
    if versions := ", ".join(known.version for known in entries() if known.id == name):
        raise RegistryError(
            f"{path}: {field}.version: {name} has versions {versions}, not {version!r}; {remedy}"
        )
    raise RegistryError(f"{path}: {key}: {name!r} is not registered; {remedy}")


def _require_model(truth: TruthModel, order: str, path: Path) -> None:
    # Imported here, because the tasks of GranBench are read without torch.
    from granbench.models.parameter_file import parse_parameters

    try:
        parse_parameters(truth.as_attribute(), "content").cell(order)
    except ModelError as error:
        raise RegistryError(f"{path}: ground_truth: {error}") from error


def _require_splits(entry: RegistryEntry, splits: Iterable[str], path: Path, field: str) -> None:
    file = local_file(entry)
    if file is None:
        return
    with open_records(file) as records:
        known = split_names(records)
    for name in splits:
        if name not in known:
            raise RegistryError(
                f"{path}: {field}.splits: {entry.id} {entry.version} has no split {name!r}; use "
                f"one of {', '.join(known)}"
            )
