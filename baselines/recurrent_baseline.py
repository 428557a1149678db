"""Training and loading of the recurrent baselines."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
import xarray as xr

from granbench import __version__
from granbench.baseline import TrainingRequest
from granbench.baselines.recurrent_cell import RecurrentCell
from granbench.baselines.recurrent_network import RecurrentConfiguration, RecurrentNetwork
from granbench.baselines.recurrent_records import check_records, fit_scaling, window_source
from granbench.baselines.training import Limits, Recipe, TrainingOutcome, train
from granbench.baselines.training.history import draw_history
from granbench.baselines.training.model_files import (
    ModelDescription,
    load_weights,
    read_model,
    write_model,
)
from granbench.data.splits import select_split
from granbench.errors import ConfigurationError, ModelError
from granbench.records import content_hashes, dataset_hash

REFERENCE_RECIPE = Recipe(learning_rate=3e-3, schedule="cosine", epochs=30, patience=30)
"""Of both networks, so that they are compared fairly. On `dem-triaxial` 1.0.0 the validation loss
of the mLSTM is the same (3.1e-4) after 20, 30 or 200 epochs, of which later ones only lower the
training loss; a falling rate must not be cut short, hence the patience."""


@dataclass(frozen=True)
class RecurrentBaseline:
    """An architecture with its training settings; see `granbench.baseline.Baseline`.

    Parameters
    ----------
    name, title : see there
    settings : architecture and recipe by preset, the default first
    """

    name: str
    title: str
    settings: Mapping[str, tuple[RecurrentConfiguration, Recipe]]

    @property
    def presets(self) -> tuple[str, ...]:
        """Names of the settings."""
        return tuple(self.settings)

    def train(self, request: TrainingRequest) -> Path:
        """See `granbench.baseline.Baseline.train`."""
        preset = request.preset or self.presets[0]
        if preset not in self.settings:
            raise ConfigurationError(
                f"unknown preset {preset!r} of {self.name!r}; use {', '.join(self.presets)}"
            )
        configuration, recipe = self.settings[preset]
        device = usable_device(request.device)
        records = request.records
        _check_length(records, configuration)
        training = select_split(records, "train")
        network = seeded_network(configuration, request.seed)
        fit_scaling(network.scaling, training, configuration.change_lag)
        network.to(device)
        if device.type == "cuda":
            # cuDNN's LSTM would round to TF32, 10 bits: relative errors of 1e-3 where this
            # network reaches less.
            torch.backends.cudnn.allow_tf32 = False
        validation = select_split(records, "validation")
        sources = [
            window_source(split, network.scaling, configuration.window, device)
            for split in (training, validation)
        ]
        limits = Limits(epochs=request.epochs, seconds=request.seconds)
        trained_on = _identity(records)
        outcome = train(
            network,
            *sources,
            recipe=recipe,
            limits=limits,
            seed=request.seed,
            folder=request.out,
            fingerprint={
                "baseline": self.name,
                "configuration": configuration.as_dict(),
                **trained_on,
            },
            on_epoch=request.on_epoch,
        )
        about = {**trained_on, "preset": preset, "seed": request.seed, "recipe": recipe.as_dict()}
        about |= _result(outcome) | _environment(device)
        description = ModelDescription(
            baseline=self.name,
            configuration=configuration.as_dict(),
            parameters=network.parameters_count(),
            training=about,
        )
        write_model(request.out, outcome.best_weights, description)
        draw_history(request.out, f"{self.name}, seed {request.seed}")
        return request.out

    def load(self, folder: Path | None, records: xr.Dataset) -> RecurrentCell:
        """See `granbench.baseline.Baseline.load`."""
        if folder is None:
            raise ModelError(
                f"baseline {self.name!r} has to be trained first: run `granbench train "
                f"{self.name} --out DIR` and give DIR"
            )
        check_records(records)
        description, weights = read_model(folder)
        if description.baseline != self.name:
            raise ModelError(f"{folder}: holds a {description.baseline!r}, not a {self.name!r}")
        network = RecurrentNetwork(RecurrentConfiguration.of(description.configuration))
        load_weights(network, weights, folder)
        return RecurrentCell(network, self.name)


def seeded_network(configuration: RecurrentConfiguration, seed: int) -> RecurrentNetwork:
    """A network whose first weights depend on `seed` only (uniform, torch's own limits)."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return RecurrentNetwork(configuration)


def usable_device(name: str) -> torch.device:
    """The torch device `name`.

    Raises
    ------
    ConfigurationError
        If torch does not know it or the machine has none.
    """
    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        raise ConfigurationError(f"device {name!r} cannot be used here; try cpu") from error
    return device


def _check_length(records: xr.Dataset, configuration: RecurrentConfiguration) -> None:
    check_records(records)
    if records.sizes["step"] <= configuration.window:
        raise ConfigurationError(
            f"{records.attrs.get('dataset', 'the dataset')}: its paths have "
            f"{records.sizes['step'] - 1} steps, but training windows have "
            f"{configuration.window}; use a dataset with longer paths"
        )


def _identity(records: xr.Dataset) -> dict[str, Any]:
    content = records.attrs.get("content_sha256") or dataset_hash(content_hashes(records))
    return {
        "dataset": str(records.attrs.get("dataset", "")),
        "dataset_version": str(records.attrs.get("version", "")),
        "dataset_content_sha256": str(content),
    }


def _result(outcome: TrainingOutcome) -> dict[str, Any]:
    progress = outcome.progress
    return {
        "epochs": progress.epoch,
        "seconds": round(progress.seconds, 3),
        "best_epoch": progress.best_epoch,
        "best_validation_loss": progress.best_loss,
        "ended_by": outcome.reason,
    }


def _environment(device: torch.device) -> dict[str, Any]:
    return {
        "granbench": __version__,
        "torch": torch.__version__,
        "device": str(device),
        "threads": torch.get_num_threads(),
        "machine": platform.machine(),
    }
