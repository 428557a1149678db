"""`j2-fitted`, `ime-fitted`, `csuh-fitted`: classical models fitted to a dataset (Sec 7.6).

The baselines adjust the parameters of a classical model to the records, as an engineer would. The
parameters are found as by `granbench fit`, with derivatives of whole strain-driven paths, from
several starts scattered about a published set; the validation split chooses among the minima. Some
datasets were made with the published set: there the search starts near the truth, so that finding
it shows little.
"""

import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import xarray as xr

from granbench import __version__
from granbench.baselines.network_baseline import identity_of
from granbench.baselines.training.model_files import ModelDescription, read_model, write_model
from granbench.cells.baseline import EpochReport, TrainingRequest
from granbench.cells.contract import MaterialCell
from granbench.data.adapters import conditions_of, history_of
from granbench.data.splits import select_split
from granbench.errors import ConfigurationError, ModelError, Setting
from granbench.files.folder_lock import locked_folder
from granbench.fitting.least_squares import LeastSquares
from granbench.fitting.observations import strain_batch
from granbench.fitting.optimisation import Effort, adam, levenberg_marquardt
from granbench.fitting.parameter_space import ParameterSpace
from granbench.fitting.settings import FitSettings
from granbench.fitting.starts import possible_starts, searching_cell
from granbench.fitting.test_batch import TestBatch
from granbench.models import find_model
from granbench.models.parameter_file import write_parameters
from granbench.tensors import component_order

PARAMETERS_FILE = "parameters.json"


@dataclass(frozen=True)
class FittingRecipe:
    """Size of a fit: paths, starts and iterations.

    Parameters
    ----------
    paths : of the training and of the validation split, drawn by the seed
    starts : of the search
    spread : standard deviation of the starts about the published values, of unconstrained numbers
    effort : of the search
    """

    paths: int
    starts: int
    spread: float
    effort: Effort


@dataclass(frozen=True)
class FittedBaseline:
    """A classical model fitted to the training split; see `granbench.cells.baseline.Baseline`.

    Parameters
    ----------
    name, title : see there
    model : in the catalogue of classical models
    settings : recipe by preset, the default first
    floor : whether it is a reference line for networks rather than a ranked model
    """

    name: str
    title: str
    model: str
    settings: dict[str, FittingRecipe]
    floor: bool = True

    @property
    def presets(self) -> Sequence[str]:
        """Names of the recipes."""
        return tuple(self.settings)

    def train(self, request: TrainingRequest) -> Path:
        """See `granbench.cells.baseline.Baseline.train`; a finished fit is not made again.

        Raises
        ------
        ModelError
            If the model cannot start from the first state of the records.
        ConfigurationError
            If the preset is unknown, or the folder holds another model.
        """
        preset = request.preset or self.presets[0]
        if preset not in self.settings:
            raise ConfigurationError(
                f"unknown preset {preset!r} of {self.name!r}; use {', '.join(self.presets)}"
            )
        with locked_folder(request.out, ModelError):
            return self._fit(request, preset)

    def _fit(self, request: TrainingRequest, preset: str) -> Path:
        recipe, records = self.settings[preset], request.records
        about = {**identity_of(records), "preset": preset, "seed": request.seed}
        if self._finished(request.out, about):
            return request.out
        began = time.monotonic()
        order = component_order(records["component"].values)
        cell = find_model(self.model)(order=order)
        space = ParameterSpace.of(searching_cell(cell))
        training, validation = (
            LeastSquares(
                space, [drawn_batch(select_split(records, split), recipe.paths, request.seed)]
            )
            for split in ("train", "validation")
        )
        effort = recipe.effort.limited(request.epochs)
        search = FitSettings(
            starts=recipe.starts + 1, spread=recipe.spread, seed=request.seed, effort=effort
        )
        # Without the first start, the published set, with which some of the datasets were made.
        vectors = possible_starts(training, search)[1:]
        progress = _Reporter(request, effort, training.tests, began)
        vectors = adam(training, vectors, effort, progress)
        minimum = levenberg_marquardt(training, vectors, effort, progress, stop=progress.over)
        losses = (validation.residuals(minimum.vectors) ** 2).sum(dim=1) / validation.tests
        best = int(losses.argmin())
        values = {name: float(value) for name, value in space.values(minimum.vectors[best]).items()}
        about |= {
            "recipe": {
                "paths": recipe.paths,
                "starts": len(vectors),
                "spread": recipe.spread,
                "adam_iterations": effort.adam_iterations,
                "iterations": effort.iterations,
            },
            "epochs": progress.iteration,
            "best_epoch": effort.adam_iterations + int(minimum.iterations[best]),
            "best_validation_loss": float(losses[best]),
            "validation_losses": [float(loss) for loss in losses],
            "seconds": round(time.monotonic() - began, 3),
            "ended_by": "budget" if progress.over() else "convergence",
            "granbench": __version__,
            "torch": torch.__version__,
            "machine": platform.machine(),
        }
        write_parameters(cell.copy_with(values), request.out / PARAMETERS_FILE, about)
        description = ModelDescription(
            baseline=self.name,
            configuration={"model": self.model},
            parameters=len(values),
            training=about,
        )
        weights = {name: torch.tensor(value).double() for name, value in values.items()}
        return write_model(request.out, weights, description)

    def _finished(self, folder: Path, about: dict[str, Any]) -> bool:
        if not (folder / PARAMETERS_FILE).is_file():
            folder.mkdir(parents=True, exist_ok=True)
            return False
        try:
            found, _ = read_model(folder)
        except ModelError:
            return False
        if found.baseline == self.name and about.items() <= found.training.items():
            return True
        raise ConfigurationError(
            f"{folder} holds a model that was fitted with other settings; give another folder "
            "with ",
            Setting("out"),
            ", or remove this one",
        )

    def load(self, folder: Path | None, records: xr.Dataset) -> MaterialCell:
        """See `granbench.cells.baseline.Baseline.load`."""
        if folder is None:
            raise ModelError(
                f"baseline {self.name!r} must be fitted first; give the folder of a fitted model"
            )
        description, weights = read_model(folder)
        if description.baseline != self.name:
            raise ModelError(f"{folder}: holds a {description.baseline!r}, not a {self.name!r}")
        order = component_order(records["component"].values)
        if description.configuration != {"model": self.model}:
            raise ModelError(f"{folder}: its configuration is not that of {self.model!r}")
        if several := [name for name, value in weights.items() if value.numel() != 1]:
            raise ModelError(
                f"{folder}: parameter {several[0]!r} has {weights[several[0]].numel()} values, not "
                "one; fit the model again"
            )
        values = {name: float(value) for name, value in weights.items()}
        try:
            return find_model(self.model)(values, order=order)
        except ModelError as error:
            raise ModelError(f"{folder}: {error}") from error


def drawn_batch(split: xr.Dataset, count: int, seed: int) -> TestBatch:
    """Paths of a split, drawn by the seed, as strain-driven tests of a fit."""
    paths = split.sizes["path"]
    drawn = np.random.default_rng(seed).permutation(paths)[:count]
    chosen = split.isel(path=np.sort(drawn))
    history = history_of(chosen)
    return strain_batch(
        component_order(chosen["component"].values),
        [str(name) for name in chosen["path_id"].values],
        history.strain.numpy(),
        history.stress.numpy(),
        conditions_of(chosen),
    )


class _Reporter:
    """Counts iterations, reports them, and knows when the time limit is reached."""

    def __init__(self, request: TrainingRequest, effort: Effort, paths: int, began: float) -> None:
        self.iteration = 0
        self._tell: Callable[[EpochReport], None] | None = request.on_epoch
        self._seconds = request.seconds
        self._total = effort.adam_iterations + effort.iterations
        self._paths = paths
        self._began = began
        self._lowest = float("inf")

    def __call__(self, stage: str, iteration: int, cost: float) -> None:
        """One iteration is done; `cost` is the lowest sum of squares."""
        self.iteration += 1
        self._lowest = min(self._lowest, cost / self._paths)
        if self._tell is None:
            return
        seconds = time.monotonic() - self._began
        share = self.iteration / self._total
        unknown = float("nan")  # the validation split is asked once, at the end
        self._tell(
            EpochReport(
                self.iteration, seconds, self._lowest, unknown, unknown, unknown, min(1.0, share)
            )
        )

    def over(self) -> bool:
        """Whether the time for the fit has run out."""
        return self._seconds is not None and time.monotonic() - self._began >= self._seconds


REFERENCE = FittingRecipe(
    paths=24, starts=4, spread=0.5, effort=Effort(adam_iterations=5, iterations=40)
)

J2_FITTED = FittedBaseline(
    "j2-fitted",
    "J2, perfectly plastic, fitted to the training split",
    "j2",
    {"reference": REFERENCE},
)
IME_FITTED = FittedBaseline(
    "ime-fitted", "IME, fitted to the training split", "ime", {"reference": REFERENCE}
)
# A substepped model is slow, and not differentiable in closed form: few paths have to do.
FRUGAL = FittingRecipe(
    paths=8, starts=3, spread=0.5, effort=Effort(adam_iterations=3, iterations=25)
)
CSUH_FITTED = FittedBaseline(
    "csuh-fitted", "CSUH, fitted to the training split", "csuh", {"reference": FRUGAL}
)
