"""The one way from a model's name to its cells."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import xarray as xr

from granbench.cells.baseline import (
    BASELINES,
    DESCRIPTION_FILE,
    Baseline,
    find_baseline,
)
from granbench.cells.contract import MaterialCell
from granbench.cells.factory import cell_from_factory, imported_factory
from granbench.cells.found_model import FoundModel
from granbench.cells.trained_folder import (
    TrainedFolder,
    baseline_of_folder,
    is_trained_folder,
    seeds_of_folders,
)
from granbench.data.verification import task_file
from granbench.errors import ConfigurationError, ModelError, alternatives
from granbench.models import MODELS, find_model
from granbench.models.parameter_file import cell_from_file
from granbench.records import open_records
from granbench.tensors import component_order

DEFAULT_SEEDS = (0, 1, 2)
DEFAULT_RECORDS = "dem-triaxial-mini"
"""It comes with the package, so that a model that needs no records is found anywhere."""
DEFAULT_ORDER = "plane"

FITTED_FILE = "parameters.json"
"""Name of the parameter file in the folder of every fit."""


class UntrainedBaselineError(ModelError):
    """A baseline was named that has to be trained before it has a cell.

    Attributes
    ----------
    name : of the baseline
    """

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(
            f"baseline {name!r} has to be trained first; train it, and give the folder of the "
            "trained model"
        )


def find_cells(
    name: str,
    records: xr.Dataset | str = DEFAULT_RECORDS,
    *,
    order: str | None = None,
    parameter_set: str | None = None,
    parameter_file: Path | None = None,
    folders: Sequence[Path] = (),
    seeds: Sequence[int] | None = None,
) -> FoundModel:
    """The cells of a model.

    Parameters
    ----------
    name : of a classical model, or a parameter file (.json) of one; of a baseline; the folder of
        a trained one; or ``package.module:factory``, where the factory takes any of `seed`,
        `model_dir` and `records` and returns a `MaterialCell`; whatever it draws at random follows
        from the seed
    records : the whole dataset of the task, or its name or file, which is opened only where the
        model needs it
    order : component order of a classical model; by default that of the records where they are
        given as a dataset, else `plane`
    parameter_set, parameter_file : of a classical model that is named; one of them, or none for
        its default parameters
    folders : trained models, one a seed
    seeds : one a folder, or those that a model without folders is evaluated for; by default
        what the folders record, else 0, 1, 2

    Raises
    ------
    ConfigurationError
        If seeds and folders do not fit each other, or parameters are given twice, or to a model
        that takes none.
    ModelError
        If there is no such model, or its parameters, files or factory fail.
    """
    if ":" not in name and not folders and is_trained_folder(Path(name)):
        name, folders = baseline_of_folder(Path(name)), [Path(name)]
    file = Path(name)
    is_classical = name in MODELS or (file.suffix == ".json" and file.is_file())
    if not (":" in name or is_classical or folders):
        if file.exists():  # before a baseline of the same name
            raise ModelError(_no_model_in(file))
        if name not in BASELINES:
            raise ModelError(_unknown_model(name))
    _check_parameters(name, parameter_set, parameter_file)
    if ":" in name:
        with _opened(records) as dataset:
            return _from_factory(name, dataset, folders, seeds)
    if is_classical:
        if folders:
            raise ConfigurationError(f"{name} needs no training; leave out its folders")
        own_order = _order_of(records) if order is None else order
        return _classical(name, own_order, parameter_set, parameter_file, seeds)
    with _opened(records) as dataset:
        return cells_of_baseline(name, dataset, folders=folders, seeds=seeds)


def cells_of_baseline(
    name: str,
    records: xr.Dataset,
    *,
    folders: Sequence[Path] = (),
    seeds: Sequence[int] | None = None,
) -> FoundModel:
    """The cells of a registered baseline, even where a folder or file has its name.

    Parameters
    ----------
    name : of the baseline
    records, folders, seeds : as for `find_cells`

    Raises
    ------
    ConfigurationError, ModelError
        As `find_cells`.
    """
    baseline = find_baseline(name)
    if folders:
        return _trained(baseline, records, folders, seeds)
    if baseline.presets:
        raise UntrainedBaselineError(baseline.name)
    cell = baseline.load(None, records)
    return FoundModel(name, dict.fromkeys(seeds or DEFAULT_SEEDS, cell), baseline)


def _from_factory(
    name: str, records: xr.Dataset, folders: Sequence[Path], seeds: Sequence[int] | None
) -> FoundModel:
    """What a user's own factory makes, for each folder or each seed."""
    places: Sequence[Path | None] = folders or [None] * len(seeds or DEFAULT_SEEDS)
    if folders:
        labels = seeds_of_folders([TrainedFolder.read(folder) for folder in folders], seeds)
    else:
        labels = tuple(seeds or DEFAULT_SEEDS)
    factory = imported_factory(name)
    cells = {
        seed: cell_from_factory(factory, name, seed=seed, model_dir=folder, records=records)
        for seed, folder in zip(labels, places, strict=True)
    }
    return FoundModel(next(iter(cells.values())).name, cells)


def _trained(
    baseline: Baseline, records: xr.Dataset, folders: Sequence[Path], seeds: Sequence[int] | None
) -> FoundModel:
    """A baseline that was trained into folders, one a seed."""
    if not baseline.presets:
        raise ConfigurationError(
            f"baseline {baseline.name!r} needs no training; leave out its folders"
        )
    trained = [TrainedFolder.read(folder) for folder in folders]
    by_seed = dict(zip(seeds_of_folders(trained, seeds), trained, strict=True))
    content = records.attrs.get("content_sha256")
    data = [text for folder in trained if (text := folder.training_data(content)) is not None]
    return FoundModel(
        baseline.name,
        {seed: baseline.load(folder.path, records) for seed, folder in by_seed.items()},
        baseline,
        training_data="; ".join(dict.fromkeys(data)) or None,
        training_seconds={
            seed: folder.seconds
            for seed, folder in by_seed.items()
            if folder.seconds is not None
        },
        folders={seed: folder.path for seed, folder in by_seed.items()},
    )  # fmt: skip


def _classical(
    name: str,
    order: str,
    parameter_set: str | None,
    parameter_file: Path | None,
    seeds: Sequence[int] | None,
) -> FoundModel:
    """A classical model: one cell for all seeds, of which only the noise depends on them."""
    if name not in MODELS:
        parameter_file = Path(name)
    file = parameter_file

    def make(order: str) -> MaterialCell:
        if file is None:
            return find_model(name)(parameter_set=parameter_set, order=order)
        return cell_from_file(file, order)

    cell = make(order)
    if file is None:
        label, training_data = name, "none: published parameters"
    else:
        if name in MODELS and cell.name != name:
            raise ModelError(
                f"{file}: holds parameters of {cell.name!r}, not of {name!r}; name the model that "
                "they belong to"
            )
        # All fits call their parameter file alike: their folders tell them apart.
        fitted = file.name == FITTED_FILE
        label = f"{cell.name}-{file.resolve().parent.name}" if fitted else file.stem
        training_data = None
    return FoundModel(
        label,
        dict.fromkeys(seeds or DEFAULT_SEEDS, cell),
        training_data=training_data,
        make=make,
        dimension=find_model(cell.name).dimension,
    )


def _check_parameters(name: str, parameter_set: str | None, parameter_file: Path | None) -> None:
    given = {"parameter_set": parameter_set, "parameter_file": parameter_file}
    named = [argument for argument, value in given.items() if value is not None]
    if len(named) > 1:
        raise ConfigurationError(f"{' and '.join(named)} both give parameters; leave one out")
    if named and name not in MODELS:
        raise ConfigurationError(
            f"{named[0]} gives the parameters of a classical model ({', '.join(MODELS)}), but "
            f"{name!r} is not the name of one; leave it out"
        )


def _order_of(records: xr.Dataset | str) -> str:
    if isinstance(records, str):
        return DEFAULT_ORDER
    return component_order(records["component"].values)


@contextmanager
def _opened(records: xr.Dataset | str) -> Iterator[xr.Dataset]:
    if isinstance(records, str):
        with open_records(task_file(records)) as dataset:
            yield dataset
    else:
        yield records


def _no_model_in(path: Path) -> str:
    """The error for a file or folder that is not a model: its own folders that are, if any."""
    within = sorted(file.parent for file in path.glob(f"*/{DESCRIPTION_FILE}"))
    if within:
        return (
            f"{path}: holds no {DESCRIPTION_FILE}, but its folders "
            f"{', '.join(folder.name for folder in within)} do; give one of them, as {within[0]}"
        )
    return f"{path}: holds no {DESCRIPTION_FILE}; give the folder of a trained model"


def _unknown_model(name: str) -> str:
    """The error for a name that no model has: one like it, or all that there are."""
    if Path(name).suffix == ".json":
        return f"there is no parameter file {name}; check the name"
    known = [*MODELS, *BASELINES]
    return (
        f"unknown model {name!r}: {alternatives(name, known)}, parameter files, folders of "
        "trained models, and package.module:factory"
    )
