"""A candidate for evaluation: the cells that a user names on the command line, one a seed."""

import importlib
import inspect
import json
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from granbench.baseline import DESCRIPTION_FILE, Baseline, architecture, find_baseline, load_cell
from granbench.cell import MaterialCell
from granbench.errors import ConfigurationError, GranbenchError, ModelError

DEFAULT_SEEDS = (0, 1, 2)


@dataclass(frozen=True)
class Candidate:
    """A model as it is evaluated.

    Parameters
    ----------
    name : what the leaderboard calls it unless told otherwise
    cells : its material cell for each seed
    baseline : the registered baseline that it is, if it is one
    training_data : what it was trained on, as far as its files say
    """

    name: str
    cells: Mapping[int, MaterialCell]
    baseline: Baseline | None = None
    training_data: str | None = None

    @property
    def trained(self) -> bool:
        """Whether it is more than a floor: anything but a baseline that needs no training."""
        return self.baseline is None or bool(self.baseline.presets)

    @property
    def parameters(self) -> int:
        """Number of trained or fitted parameters."""
        return next(iter(self.cells.values())).parameters_count()


def find_candidate(
    model: str,
    records: xr.Dataset,
    *,
    folders: Sequence[Path] = (),
    seeds: Sequence[int] | None = None,
) -> Candidate:
    """The cells of a model.

    Parameters
    ----------
    model : name of a baseline; folder of a trained one; or ``package.module:factory``, where
        the factory takes any of `seed`, `model_dir` and `records` and returns a `MaterialCell`
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
        places: Sequence[Path | None] = folders or [None] * len(seeds or DEFAULT_SEEDS)
        labels = _labels(folders, seeds) if folders else tuple(seeds or DEFAULT_SEEDS)
        factory = _factory(model)
        cells = {
            seed: _made(factory, model, seed=seed, model_dir=folder, records=records)
            for seed, folder in zip(labels, places, strict=True)
        }
        return Candidate(next(iter(cells.values())).name, cells)
    if not folders and (Path(model) / DESCRIPTION_FILE).is_file():
        folders = [Path(model)]
        model = architecture(folders[0])
    if not folders:
        cell = load_cell(model, records)
        return Candidate(
            model, dict.fromkeys(seeds or DEFAULT_SEEDS, cell), baseline=find_baseline(model)
        )
    baseline = find_baseline(model)
    if not baseline.presets:
        raise ConfigurationError(f"baseline {model!r} needs no training; leave out --model-dir")
    labels = _labels(folders, seeds)
    cells = {
        seed: baseline.load(folder, records) for seed, folder in zip(labels, folders, strict=True)
    }
    return Candidate(model, cells, baseline, _training_data(folders, records))


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
        content = json.loads((folder / DESCRIPTION_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


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
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        raise ModelError(
            f"there is no module {error.name!r} for model {model!r}; run the command where it "
            "can be imported"
        ) from error
    except Exception as error:
        raise _failure(f"module {module_name!r} cannot be imported", error) from error
    factory = getattr(module, attribute, None)
    if not callable(factory):
        raise ModelError(
            f"module {module_name!r} has no function {attribute!r}; give package.module:function"
        )
    return factory


def _made(factory: Callable[..., Any], model: str, **offered: Any) -> MaterialCell:
    try:
        parameters = inspect.signature(factory).parameters
        wanted = {name: value for name, value in offered.items() if name in parameters}
        cell = factory(**wanted)
    except GranbenchError:
        raise
    except Exception as error:
        raise _failure(f"{model} failed", error) from error
    if not isinstance(cell, MaterialCell):
        raise ModelError(
            f"{model} returned a {type(cell).__name__}, not a MaterialCell; wrap a torch module "
            "in granbench.cell.ModuleCell"
        )
    return cell


def _failure(what: str, error: Exception) -> ModelError:
    place = traceback.extract_tb(error.__traceback__)[-1]
    return ModelError(
        f"{what} with {type(error).__name__} ({error}) at {Path(place.filename).name} line "
        f"{place.lineno}; mend it"
    )
