"""Tasks by name: those of GranBench, those of other packages, and files of a user's own.

GranBench keeps one YAML file for each task and version. Another package adds tasks by an entry
point of the group `granbench.tasks`, whose value is a package with YAML files in it:

    [project.entry-points."granbench.tasks"]
    my-tasks = "my_package.tasks"
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from types import ModuleType
from typing import Any

import xarray as xr
import yaml
from pydantic import ValidationError

from granbench.benchmark.task import Task
from granbench.benchmark.task_check import (
    registered_dataset,
    require_models_and_splits,
    require_own_id,
    require_registered_dataset,
)
from granbench.data.registry import REGISTRY_FOLDER
from granbench.data.store import REGISTERED_NAME, dataset_file, local_file
from granbench.data.verification import task_file
from granbench.errors import DatasetError, GranbenchError, RegistryError, alternatives
from granbench.files.validation import first_fault
from granbench.records import open_records
from granbench.registration import Registry

TASK_FOLDER = REGISTRY_FOLDER / "tasks"
TASK_PACKAGES: Registry[ModuleType] = Registry("granbench.tasks", "package of tasks", ModuleType)
"""Packages with task files of other distributions."""
YAML = (".yaml", ".yml")
LARGEST_FILE = 1_000_000
"""Bytes of a task's file; a task with a hundred analyses has 50,000."""


def registered_tasks() -> list[Task]:
    """Every registered version of every task, by name, the newest version first.

    Raises
    ------
    RegistryError
        If a YAML file is damaged, two have the same name and version, or another package uses the
        name of a task of GranBench.
    """
    tasks, faults = readable_tasks()
    if faults:
        raise faults[0]
    return tasks


def readable_tasks() -> tuple[list[Task], list[GranbenchError]]:
    """The registered tasks that can be read, and why the others cannot.

    Returns
    -------
    tasks : every version, by name, the newest version first
    faults : one error for each file and each package of tasks that cannot be read
    """
    brought, faults = _plugin_files()
    tasks, more = _ordered((*_own_files(), *brought))
    return tasks, faults + more


def registered_task(name: str, version: str | None = None) -> Task:
    """A registered task; those of GranBench are found whatever other packages register.

    Parameters
    ----------
    name : its id
    version : None for the newest

    Raises
    ------
    RegistryError
        If no package registers it; the text names similar ones, and what could not be read.
    """
    known, faults = _ordered(_own_files())
    if name not in {task.id for task in known}:
        known, faults = readable_tasks()
    named = [task for task in known if task.id == name]
    if not named:
        names = list(dict.fromkeys(task.id for task in known))
        unread = "".join(f"; not read: {fault}" for fault in faults)
        raise RegistryError(f"unknown task {name!r}: {alternatives(name, names)}{unread}")
    for task in named:
        if version in (None, task.version):
            return task
    versions = ", ".join(task.version for task in named)
    raise RegistryError(f"task {name!r} has no version {version!r}; use one of {versions}")


def find_task(name_or_file: str) -> Task:
    """A task by its name or from a file.

    Parameters
    ----------
    name_or_file : name of a registered task for its newest version, or NAME@VERSION; path of a
        task's YAML file; or path of a netCDF file of records, which makes a task of the records
        alone unless they are those of a registered task of the same name

    Raises
    ------
    RegistryError
        If the name is unknown; if the YAML file is damaged, names a dataset, split or model that
        there is not, or has the id of a registered task and another content. The text names the
        file and the field.
    DatasetError
        If there is no such file, or it holds no records.
    """
    path = Path(name_or_file)
    if path.is_file():
        return _task_of_user(path) if path.suffix in YAML else _task_of_records(path)
    name, _, version = name_or_file.partition("@")
    # A folder of that name, as `granbench generate` leaves behind, does not hide the task.
    if path.is_dir() and name not in {task.id for task in readable_tasks()[0]}:
        raise DatasetError(f"{name_or_file}: is a folder; give a task's YAML file or a netCDF file")
    if not REGISTERED_NAME.fullmatch(name_or_file):
        raise DatasetError(
            f"{name_or_file}: there is no such file; give a task of `granbench task list`, a "
            "task's YAML file or a netCDF file of records"
        )
    return registered_task(name, version or None)


def read_task(path: Path) -> Task:
    """The task in a YAML file.

    Raises
    ------
    RegistryError
        If the file is damaged, or names a dataset, split or model that there is not; the text
        names the field. The tasks of GranBench itself are compared with their records by its tests.
    """
    task = _parsed(path)
    own = path.parent == TASK_FOLDER
    if task.dataset.file is not None:
        file = path.parent / task.dataset.file
        if not file.is_file():
            raise RegistryError(
                f"{path}: dataset.file: there is no {file}; put it beside the task's file"
            )
        dataset = task.dataset.model_copy(update={"file": str(file)})
        task = task.model_copy(update={"dataset": dataset})
    else:
        require_registered_dataset(task, path)
    if not own:
        require_models_and_splits(task, path)
    return task


def task_records(task: Task) -> xr.Dataset:
    """The whole dataset of a task, opened lazily; fetched or made if it is not on this machine.

    `Task.view` gives the splits of the task.

    Raises
    ------
    GranbenchError
        If the dataset cannot be had, or is not the one that the task names.
    """
    file = task.dataset.file
    name = f"{task.dataset.name}@{task.dataset.version}"
    path = dataset_file(name) if file is None else task_file(file)
    records = open_records(path)
    try:
        task.view(records)  # refuses other records than the task names
    except GranbenchError:
        records.close()
        raise
    return records


@contextmanager
def records_at_hand(task: Task) -> Iterator[xr.Dataset | None]:
    """The whole dataset of a task if it is on this machine, else None; nothing is fetched."""
    entry = registered_dataset(task.dataset.name, task.dataset.version)
    if task.dataset.file is None and (entry is None or local_file(entry) is None):
        yield None
        return
    with task_records(task) as records:
        yield records


def _parsed(path: Path) -> Task:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise RegistryError(
                f"{path}: has more than {LARGEST_FILE:,} bytes; give the YAML file of a task"
            )
        fields: Any = yaml.safe_load(path.read_text(encoding="utf-8"))
        task = Task.model_validate(fields)
    except ValidationError as error:
        raise RegistryError(f"{path}: {first_fault(error)}") from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = "" if mark is None else f" in line {mark.line + 1}, column {mark.column + 1}"
        raise RegistryError(
            f"{path}: is not YAML{where} ({error.problem}); correct the file"
        ) from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).replace('in "<unicode string>", ', "at ").split())[:200]
        raise RegistryError(f"{path}: is not YAML ({reason}); correct the file") from error
    except OSError as error:
        raise RegistryError(
            f"{path}: cannot be read ({error.strerror or error}); check the file"
        ) from error
    if not REGISTERED_NAME.fullmatch(task.id) or "@" in task.id:
        raise RegistryError(
            f"{path}: id: {task.id!r} may hold small letters, digits and dashes only"
        )
    return task


def _task_of_user(path: Path) -> Task:
    task = read_task(path)
    if path.resolve().parent != TASK_FOLDER.resolve():
        require_own_id(task, path, readable_tasks()[0])
    return task


def _task_of_records(path: Path) -> Task:
    with open_records(task_file(str(path))) as records:
        alone = Task.of_records(records, str(path))
    for task in readable_tasks()[0]:
        here = task.dataset.model_copy(update={"file": str(path)})
        if task.id == alone.id and here == alone.dataset:
            return task.model_copy(update={"dataset": here})
    return alone


def _ordered(paths: Iterable[Path]) -> tuple[list[Task], list[GranbenchError]]:
    """The tasks of YAML files, by name, the newest version first, and why others are left out."""
    found: dict[tuple[str, str], tuple[Task, Path]] = {}
    faults: list[GranbenchError] = []
    for path in paths:
        try:
            task = read_task(path)
            _require_free_name(task, path, found)
        except GranbenchError as error:
            faults.append(error)
        else:
            found[task.id, task.version] = (task, path)
    newest_first = sorted((task for task, _ in found.values()), key=_release, reverse=True)
    return sorted(newest_first, key=lambda task: task.id), faults


def _require_free_name(
    task: Task, path: Path, found: Mapping[tuple[str, str], tuple[Task, Path]]
) -> None:
    own = {known.id for known, file in found.values() if file.parent == TASK_FOLDER}
    if path.parent != TASK_FOLDER and task.id in own:
        raise RegistryError(
            f"{path}: id: {task.id!r} is the name of a task of GranBench; give it another id"
        )
    if (task.id, task.version) in found:
        _, other = found[task.id, task.version]
        raise RegistryError(
            f"{path}: task {task.id} {task.version} is registered already, by {other}; give it "
            "another id or version"
        )


def _own_files() -> list[Path]:
    return sorted(TASK_FOLDER.glob("*.yaml"))


def _plugin_files() -> tuple[list[Path], list[GranbenchError]]:
    """The task files of other packages, and why some packages have none that can be read."""
    found: list[Path] = []
    faults: list[GranbenchError] = []
    for name in TASK_PACKAGES:
        try:
            package = TASK_PACKAGES[name]
            items = list(files(package).iterdir())
        except GranbenchError as error:
            faults.append(error)
        except (OSError, TypeError, ValueError) as error:
            fault = RegistryError(
                f"package of tasks {name!r}: {package.__name__} is not a package with YAML "
                f"files ({error}); correct or uninstall it"
            )
            faults.append(fault)
        else:
            found += sorted(Path(str(item)) for item in items if item.name.endswith(YAML))
    return found, faults


def _release(task: Task) -> tuple[int, ...]:
    return tuple(int(part) for part in task.version.split("."))
