"""Training and loading of the baselines that are networks of any architecture."""

import abc
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
import xarray as xr
from torch import Tensor, nn

from granbench import __version__
from granbench.baselines.configuration import NetworkConfiguration
from granbench.baselines.training import Limits, Recipe, TrainingOutcome, train
from granbench.baselines.training.batches import BatchSource
from granbench.baselines.training.model_files import (
    DESCRIPTION_FILE,
    WEIGHTS_FILE,
    ModelDescription,
    load_weights,
    read_model,
    write_model,
)
from granbench.cells.baseline import TrainingRequest
from granbench.cells.contract import MaterialCell
from granbench.data.splits import select_split
from granbench.errors import ConfigurationError, ModelError
from granbench.files.folder_lock import locked_folder
from granbench.records import content_hashes, dataset_hash

ConfigurationT = TypeVar("ConfigurationT", bound=NetworkConfiguration)
NetworkT = TypeVar("NetworkT", bound=nn.Module)


@dataclass(frozen=True)
class NetworkBaseline(abc.ABC, Generic[ConfigurationT, NetworkT]):
    """An architecture with its training settings; see `granbench.cells.baseline.Baseline`.

    A subclass defines the network, its training items and its material cell.

    Parameters
    ----------
    name, title : see there
    settings : architecture and recipe by preset, the default first
    """

    name: str
    title: str
    settings: Mapping[str, tuple[ConfigurationT, Recipe]]
    floor = False
    classical_model = None

    @property
    def presets(self) -> tuple[str, ...]:
        """Names of the settings."""
        return tuple(self.settings)

    @abc.abstractmethod
    def check(self, records: xr.Dataset) -> None:
        """Raise ModelError if the records lack a variable that the network needs."""

    @abc.abstractmethod
    def fitted_to(self, configuration: ConfigurationT, records: xr.Dataset) -> ConfigurationT:
        """The configuration for these records; ConfigurationError if it does not fit them."""

    @abc.abstractmethod
    def configuration_of(self, settings: dict[str, Any]) -> ConfigurationT:
        """The configuration in a model file; see `NetworkConfiguration.of`."""

    @abc.abstractmethod
    def network(self, configuration: ConfigurationT) -> NetworkT:
        """The network, with random weights."""

    @abc.abstractmethod
    def scale(self, network: NetworkT, training: xr.Dataset) -> None:
        """Fit the scaling of inputs and outputs to the training split."""

    @abc.abstractmethod
    def source(self, network: NetworkT, split: xr.Dataset, device: torch.device) -> BatchSource:
        """The training items of a split, for `TrainableNetwork.loss`."""

    @abc.abstractmethod
    def cell(self, network: NetworkT) -> MaterialCell:
        """The trained network as a material cell."""

    def train(self, request: TrainingRequest) -> Path:
        """See `granbench.cells.baseline.Baseline.train`."""
        preset = request.preset or self.presets[0]
        if preset not in self.settings:
            raise ConfigurationError(
                f"unknown preset {preset!r} of {self.name!r}; use {', '.join(self.presets)}"
            )
        configuration, recipe = self.settings[preset]
        device = usable_device(request.device)
        records = request.records
        self.check(records)
        configuration = self.fitted_to(configuration, records)
        training = select_split(records, "train")
        network = self.seeded_network(configuration, request.seed)
        self.scale(network, training)
        network.to(device)
        if device.type == "cuda":
            # cuDNN would round to TF32, 10 bits: relative errors of 1e-3, larger than those of
            # these networks.
            torch.backends.cudnn.allow_tf32 = False
        validation = select_split(records, "validation")
        trained_on = identity_of(records)
        with locked_folder(request.out, ModelError):
            outcome = train(
                network,
                self.source(network, training, device),
                self.source(network, validation, device),
                recipe=recipe,
                limits=Limits(epochs=request.epochs, seconds=request.seconds),
                seed=request.seed,
                folder=request.out,
                fingerprint={
                    "baseline": self.name,
                    "configuration": configuration.as_dict(),
                    **trained_on,
                },
                on_epoch=request.on_epoch,
            )
            about = {
                **trained_on,
                "preset": preset,
                "seed": request.seed,
                "recipe": recipe.as_dict(),
            }
            about |= _result(outcome) | _environment(device)
            description = ModelDescription(
                baseline=self.name,
                configuration=configuration.as_dict(),
                parameters=sum(parameter.numel() for parameter in network.parameters()),
                training=about,
            )
            write_model(request.out, outcome.best_weights, description)
        return request.out

    def seeded_network(self, configuration: ConfigurationT, seed: int) -> NetworkT:
        """A network whose first weights depend on `seed` only (uniform, torch's own limits)."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return self.network(configuration)

    def load(self, folder: Path | None, records: xr.Dataset) -> MaterialCell:
        """See `granbench.cells.baseline.Baseline.load`."""
        if folder is None:
            raise ModelError(
                f"baseline {self.name!r} must be trained first; give the folder of a trained model"
            )
        self.check(records)
        description, weights = read_model(folder)
        if description.baseline != self.name:
            raise ModelError(f"{folder}: holds a {description.baseline!r}, not a {self.name!r}")
        configuration = self.configuration_of(description.configuration)
        self._check_size(configuration, weights, folder)
        network = self.network(configuration)
        load_weights(network, weights, folder)
        return self.cell(network)

    def _check_size(
        self, configuration: ConfigurationT, weights: Mapping[str, Tensor], folder: Path
    ) -> None:
        """Compare the declared architecture with the tensors before it is allocated.

        Raises
        ------
        ModelError
            If they differ.
        """
        largest = max((max(tensor.shape, default=1) for tensor in weights.values()), default=1)
        bounds = {"layers": len(weights)}
        for name, size in configuration.sizes().items():
            if size > bounds.get(name, largest):
                raise ModelError(
                    f"{folder}: {DESCRIPTION_FILE} has {name} {size}, which no tensor of "
                    f"{WEIGHTS_FILE} fits; copy both files again"
                )
        with torch.device("meta"):
            expected = self.network(configuration).state_dict()
        for name in sorted(expected.keys() | weights.keys()):
            shapes = [tuple(found[name].shape) for found in (expected, weights) if name in found]
            if len(shapes) < 2 or shapes[0] != shapes[1]:
                raise ModelError(
                    f"{folder / WEIGHTS_FILE}: does not fit the architecture in "
                    f"{DESCRIPTION_FILE} (tensor {name!r}); copy both files again"
                )


def usable_device(name: str) -> torch.device:
    """The torch device `name`.

    Raises
    ------
    ConfigurationError
        If torch does not know it or the machine has none.
    """
    try:
        device = torch.device(name)
        # The value must be readable: device `meta` computes shapes only.
        torch.zeros(1, device=device).item()
    except (RuntimeError, AssertionError, NotImplementedError, ImportError) as error:
        raise ConfigurationError(f"device {name!r} is not available; use 'cpu'") from error
    return device


def identity_of(records: xr.Dataset) -> dict[str, Any]:
    """Name, version and content hash of the training dataset."""
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
