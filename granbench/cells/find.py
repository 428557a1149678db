"""A candidate for evaluation: the cells that a user names on the command line, one a seed.

`find_cells` is the one way from a model's name to its cells.
"""

import importlib
import inspect
import random
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
import xarray as xr

from granbench.cells.baseline import DESCRIPTION_FILE, Baseline, baseline_names, find_baseline
from granbench.cells.check.attributes import require_attributes
from granbench.cells.contract import MaterialCell
from granbench.cells.user_code import user_code
from granbench.errors import ConfigurationError, ModelError, alternatives
from granbench.files.json_reading import read_json_object
from granbench.models import MODELS
from granbench.tensors import component_order

DEFAULT_SEEDS = (0, 1, 2)
FITTED_FILE = "parameters.json"
"""What `granbench fit` calls the parameters in its folder."""


@dataclass(frozen=True)
class FoundModel:
    """A model as it is evaluated.

    Parameters
    ----------
    name : what the leaderboard calls it unless another name is given
    cells : its material cell for each seed
    baseline : the registered baseline that it is, if it is one
    training_data : what it was trained on, as far as its files say
    training_seconds : how long each seed was trained, as far as its files say
    folders : where the trained model of each seed lies
    """

    name: str
    cells: Mapping[int, MaterialCell]
    baseline: Baseline | None = None
    training_data: str | None = None
    training_seconds: Mapping[int, float] = field(default_factory=dict)
    folders: Mapping[int, Path] = field(default_factory=dict)

    @property
    def trained(self) -> bool:
        """Whether it is more than a floor: anything but a baseline that needs no training."""
        return self.baseline is None or bool(self.baseline.presets)

    @property
    def floor(self) -> bool:
        """Whether it frames the table by default, as a fitted classical model does."""
        return not self.trained or getattr(self.baseline, "floor", False)

    @property
    def cell(self) -> MaterialCell:
        """Its cell for the first seed."""
        return next(iter(self.cells.values()))

    @property
    def parameters(self) -> int:
        """Number of trained or fitted parameters."""
        return self.cell.parameters_count()


def find_cells(
    model: str,
    records: xr.Dataset,
    *,
    folders: Sequence[Path] = (),
    seeds: Sequence[int] | None = None,
) -> FoundModel:
    """The cells of a model.

    Parameters
    ----------
    model : name of a baseline; folder of a trained one; name of a classical model, which then
        has its default parameters, or a parameter file (.json) of one; or
        ``package.module:factory``, where the factory takes any of `seed`, `model_dir` and
        `records` and returns a `MaterialCell`; whatever it draws at random follows from the seed
    records : the whole dataset of the task
    folders : trained models, one a seed
    seeds : one a folder, or those that a model without folders is evaluated for; by default
        what the folders record, else 0, 1, 2

    Raises
    ------
    ConfigurationError
        If seeds and folders do not fit each other.
    ModelError
        If there is no such model, or its files or its factory fail.
    """
    if ":" in model:
        return _manufactured(model, records, folders, seeds)
    if not folders and (Path(model) / DESCRIPTION_FILE).is_file():
        folders = [Path(model)]
        model = _architecture(folders[0])
    if model in MODELS or (Path(model).suffix == ".json" and Path(model).is_file()):
        if folders:
            raise ConfigurationError(f"{model} needs no training; leave out --model-dir")
        return _closed_form(model, records, seeds)
    if not folders and Path(model).exists():
        raise ModelError(_no_model_in(Path(model)))
    if not folders and model not in baseline_names():
        raise ModelError(unknown_model(model))
    return cells_of_baseline(model, records, folders=folders, seeds=seeds)


def _no_model_in(path: Path) -> str:
    """What to say of a file or folder that is no model: its own folders that are, if any."""
    within = sorted(file.parent for file in path.glob(f"*/{DESCRIPTION_FILE}"))
    if within:
        return (
            f"{path}: holds no {DESCRIPTION_FILE}, but its folders "
            f"{', '.join(folder.name for folder in within)} do; give one of them, as {within[0]}"
        )
    return f"{path}: holds no {DESCRIPTION_FILE}; give the folder that `granbench train` wrote"


def unknown_model(name: str) -> str:
    """What to say of a name that is no model's: one like it, or all that there are."""
    if Path(name).suffix == ".json":
        return f"there is no parameter file {name}; check the name"
    known = [*MODELS, *baseline_names()]
    return (
        f"unknown model {name!r}: {alternatives(name, known)}, parameter files, folders of "
        "trained models, and package.module:factory"
    )


def cells_of_baseline(
    name: str,
    records: xr.Dataset,
    *,
    folders: Sequence[Path] = (),
    seeds: Sequence[int] | None = None,
) -> FoundModel:
    """The cells of a registered baseline, whatever lies where the command is run.

    Parameters
    ----------
    name : of a baseline, nothing else
    records, folders, seeds : as for `find_cells`

    Raises
    ------
    ConfigurationError, ModelError
        As `find_cells`.
    """
    if folders:
        return _trained(name, records, folders, seeds)
    return _untrained(name, records, seeds)


def _manufactured(
    model: str, records: xr.Dataset, folders: Sequence[Path], seeds: Sequence[int] | None
) -> FoundModel:
    """What a user's own factory makes, for each folder or each seed."""
    places: Sequence[Path | None] = folders or [None] * len(seeds or DEFAULT_SEEDS)
    labels = _labels(folders, seeds) if folders else tuple(seeds or DEFAULT_SEEDS)
    factory = _factory(model)
    cells = {
        seed: _made(factory, model, seed=seed, model_dir=folder, records=records)
        for seed, folder in zip(labels, places, strict=True)
    }
    return FoundModel(next(iter(cells.values())).name, cells)


def _trained(
    name: str, records: xr.Dataset, folders: Sequence[Path], seeds: Sequence[int] | None
) -> FoundModel:
    """A baseline that was trained into folders, one a seed."""
    baseline = find_baseline(name)
    if not baseline.presets:
        raise ConfigurationError(f"baseline {name!r} needs no training; leave out --model-dir")
    labels = _labels(folders, seeds)
    cells = {
        seed: baseline.load(folder, records) for seed, folder in zip(labels, folders, strict=True)
    }
    times = {
        seed: float(seconds)
        for seed, folder in zip(labels, folders, strict=True)
        if isinstance(seconds := _training(folder).get("seconds"), int | float)
    }
    places = dict(zip(labels, folders, strict=True))
    return FoundModel(name, cells, baseline, _training_data(folders, records), times, places)


def _closed_form(model: str, records: xr.Dataset, seeds: Sequence[int] | None) -> FoundModel:
    """A classical model: one cell for all seeds, which are of the noise."""
    order = component_order(tuple(map(str, records["component"].values)))
    labels = seeds or DEFAULT_SEEDS
    if model in MODELS:
        cell = MODELS[model](order=order)
        return FoundModel(
            model, dict.fromkeys(labels, cell), training_data="none: published parameters"
        )
    from granbench.models.parameter_file import cell_from_file

    file = Path(model)
    cell = cell_from_file(file, order)
    # `granbench fit` calls all of its files alike: its folders tell them apart.
    fitted = file.name == FITTED_FILE
    name = f"{cell.name}-{file.resolve().parent.name}" if fitted else file.stem
    return FoundModel(name, dict.fromkeys(labels, cell))


def _untrained(name: str, records: xr.Dataset, seeds: Sequence[int] | None) -> FoundModel:
    """A baseline that needs no training: one cell for all seeds, which are of the noise."""
    baseline = find_baseline(name)
    if baseline.presets:
        raise ModelError(
            f"baseline {baseline.name!r} has to be trained first: run `granbench train "
            f"{baseline.name} --out DIR` and give DIR"
        )
    cell = baseline.load(None, records)
    return FoundModel(name, dict.fromkeys(seeds or DEFAULT_SEEDS, cell), baseline)


def _architecture(folder: Path) -> str:
    """Name of the baseline that a trained model's folder holds; ModelError if it is damaged."""
    path, remedy = folder / DESCRIPTION_FILE, "train the model again or copy the file anew"
    name = read_json_object(path, ModelError, remedy=remedy).get("baseline")
    if not isinstance(name, str):
        raise ModelError(f"{path}: is damaged ('baseline' must be text); {remedy}")
    return name


def _labels(folders: Sequence[Path], seeds: Sequence[int] | None) -> tuple[int, ...]:
    if seeds is None:
        recorded = [_training(folder).get("seed") for folder in folders]
        known = [seed for seed in recorded if isinstance(seed, int)]
        seeds = known if len(known) == len(folders) else range(len(folders))
    if len(seeds) != len(folders):
        raise ConfigurationError(
            f"--seeds names {len(seeds)} seeds for {len(folders)} --model-dir; give one for each"
        )
    if len(set(seeds)) < len(seeds):
        raise ConfigurationError(
            f"seeds {', '.join(map(str, seeds))} are not all different; give models of "
            "different seeds"
        )
    return tuple(seeds)


def _description(folder: Path) -> dict[str, Any]:
    try:
        return read_json_object(folder / DESCRIPTION_FILE, ModelError, remedy="")
    except ModelError:
        return {}


def _training(folder: Path) -> dict[str, Any]:
    training = _description(folder).get("training", {})
    return training if isinstance(training, dict) else {}


def _training_data(folders: Sequence[Path], records: xr.Dataset) -> str | None:
    found = []
    for folder in folders:
        about = _training(folder)
        if "dataset" in about:
            preset = f", preset {about['preset']}" if about.get("preset") else ""
            content = str(about.get("dataset_content_sha256", ""))
            same = content == records.attrs.get("content_sha256")
            other = "" if same else f", content {content[:12] or 'unknown'}"
            text = f"{about['dataset']} {about.get('dataset_version', '')}".strip()
            found.append(f"{text}, split train, checkpoint chosen on validation{preset}{other}")
    return "; ".join(dict.fromkeys(found)) or None


def _factory(model: str) -> Callable[..., Any]:
    module_name, _, attribute = model.partition(":")
    if "" not in sys.path:
        sys.path.insert(0, "")  # a user's own module lies where the command is run
    with user_code(f"module {module_name!r} cannot be imported"):
        try:
            module = importlib.import_module(module_name)
        except ModuleNotFoundError as error:
            if not _names_no_module(module_name, error.name):
                raise  # it is there, but something that it imports is not
            raise ModelError(
                f"there is no module {error.name!r} for model {model!r}; {_way_to(module_name)}"
            ) from error
    factory = getattr(module, attribute, None)
    if isinstance(factory, MaterialCell | torch.nn.Module):
        raise ModelError(
            f"{model} is {_article(factory)} itself; give a function without arguments that "
            f"{'returns it' if isinstance(factory, MaterialCell) else WRAPPING}"
        )
    if not callable(factory):
        functions = [name for name, value in vars(module).items() if inspect.isfunction(value)]
        raise ModelError(
            f"module {module_name!r} has no function {attribute!r}: "
            f"{alternatives(attribute, functions)}; give package.module:function"
        )
    return factory


def _names_no_module(wanted: str, missing: str | None) -> bool:
    """Whether what is missing is the module itself, or a package that it should lie in."""
    return missing is None or wanted == missing or wanted.startswith(f"{missing}.")


def _way_to(module_name: str) -> str:
    path = Path(module_name)
    if path.suffix == ".py" or len(path.parts) > 1:
        return f"give a module as Python imports it: {'.'.join(path.with_suffix('').parts)}"
    return "run the command where it can be imported"


def _made(factory: Callable[..., Any], model: str, **offered: Any) -> MaterialCell:
    with user_code(f"{model} failed"):
        parameters = _parameters(factory)
        lacking = [
            name
            for name, parameter in parameters.items()
            if parameter.default is parameter.empty
            and parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
            and (name not in offered or parameter.kind is parameter.POSITIONAL_ONLY)
        ]
        if lacking:
            raise ModelError(
                f"{model} wants the argument {lacking[0]!r}, but a model is made with "
                f"{', '.join(offered)} alone, by keyword; give {lacking[0]!r} a default value"
            )
        wanted = {name: value for name, value in offered.items() if name in parameters}
        with _drawn_from(int(offered["seed"])):
            cell = factory(**wanted)
    if not isinstance(cell, MaterialCell):
        raise ModelError(f"{model} returned {_article(cell)}; {_remedy(cell)}")
    with user_code(f"{model} failed"):
        require_attributes(cell)
    return cell


def _parameters(factory: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    try:
        return inspect.signature(factory).parameters
    except ValueError:  # of some functions that are not written in Python
        return {}


@contextmanager
def _drawn_from(seed: int) -> Iterator[None]:
    """Random numbers of torch, NumPy and Python that follow from the seed, for new weights."""
    before = random.getstate(), np.random.get_state()  # noqa: NPY002, a user's code may draw so
    with torch.random.fork_rng(devices=[]):
        try:
            torch.manual_seed(seed % 2**63)
            np.random.seed(seed % 2**32)  # noqa: NPY002
            random.seed(seed)
            yield
        finally:
            random.setstate(before[0])
            np.random.set_state(before[1])  # noqa: NPY002


WRAPPING = "returns granbench.cells.ModuleCell(module, name=...)"


def _article(found: object) -> str:
    if found is None:
        return "nothing"
    if isinstance(found, type):
        return f"the class {found.__name__}"
    return f"an object of type {type(found).__name__}"


def _remedy(found: object) -> str:
    """What to do with something that is not a cell."""
    if found is None:
        return "end it with `return` and the cell"
    if isinstance(found, type):
        return f"return an instance, as {found.__name__}()"
    return (
        "return a MaterialCell; wrap a torch module in granbench.cells.ModuleCell(module, name=...)"
    )
