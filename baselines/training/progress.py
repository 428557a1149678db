"""The state of a training run between epochs, and the file from which a run continues."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from granbench.baselines.training.tensor_files import digest_of, read_tensors, write_tensors
from granbench.errors import ConfigurationError, ModelError, Setting

TRAINING_FILE = "training.safetensors"


@dataclass
class TrainingProgress:
    """Counters of a training run.

    Parameters
    ----------
    epoch : epochs done
    seconds : of training, over all sessions
    best_epoch : the one with the lowest validation loss, 0 before the first
    best_loss : that loss
    """

    epoch: int = 0
    seconds: float = 0.0
    best_epoch: int = 0
    best_loss: float = float("inf")


def save_progress(
    folder: Path,
    network: nn.Module,
    best: Mapping[str, Tensor],
    optimiser: torch.optim.Adam,
    progress: TrainingProgress,
    fingerprint: Mapping[str, Any],
) -> None:
    """Write weights, best weights, moments of Adam and counters as one file, atomically.

    Parameters
    ----------
    fingerprint : identity of the run (data, seed, architecture, recipe), as data for JSON; a run
        with another fingerprint does not continue from the file

    Raises
    ------
    ModelError
        If the folder cannot be written or is full.
    """
    tensors = {f"network.{name}": tensor for name, tensor in network.state_dict().items()}
    tensors |= {f"best.{name}": tensor for name, tensor in best.items()}
    for name, parameter in network.named_parameters():
        for moment, tensor in optimiser.state[parameter].items():
            tensors[f"adam.{moment}.{name}"] = tensor
    description = {"progress": asdict(progress), "fingerprint": dict(fingerprint)}
    sealed = description | {"sha256": digest_of(tensors, description)}
    write_tensors(folder / TRAINING_FILE, tensors, sealed)


def restore_progress(
    folder: Path,
    network: nn.Module,
    optimiser: torch.optim.Adam,
    fingerprint: Mapping[str, Any],
) -> tuple[TrainingProgress, dict[str, Tensor]]:
    """Restore a saved run into network and optimiser.

    Returns
    -------
    The counters and the best weights so far.

    Raises
    ------
    ModelError
        If the file is damaged.
    ConfigurationError
        If the folder holds another run.
    """
    path = folder / TRAINING_FILE
    tensors, description = read_tensors(path)
    try:
        sealed = description.pop("sha256")
        recorded, progress = description["fingerprint"], TrainingProgress(**description["progress"])
    except (AttributeError, KeyError, TypeError) as error:
        raise ModelError(
            f"{path}: does not hold a training run of this version; remove the file and train "
            "again from the start"
        ) from error
    if sealed != digest_of(tensors, description):
        raise ModelError(
            f"{path}: is damaged, its content does not match its SHA-256; remove the file and "
            "train again from the start, or restore it from a backup"
        )
    if differing := sorted(
        name
        for name in set(recorded) | set(fingerprint)
        if recorded.get(name) != fingerprint.get(name)
    ):
        raise ConfigurationError(
            f"{folder} holds a run with another {', '.join(differing)}; give another folder with ",
            Setting("out"),
            ", or remove this one",
        )
    parts: dict[str, dict[str, Tensor]] = {"network": {}, "best": {}, "adam": {}}
    for name, tensor in tensors.items():
        kind, _, rest = name.partition(".")
        parts.setdefault(kind, {})[rest] = tensor
    try:
        network.load_state_dict(parts["network"])
        _restore_moments(optimiser, network, parts["adam"])
    except (RuntimeError, KeyError) as error:
        raise ModelError(
            f"{path}: does not fit the network; remove the folder {folder} and train again"
        ) from error
    return progress, parts["best"]


def _restore_moments(
    optimiser: torch.optim.Adam, network: nn.Module, moments: Mapping[str, Tensor]
) -> None:
    for name, parameter in network.named_parameters():
        optimiser.state[parameter] = {
            # The step counter of fused Adam is a float32 tensor on the device of its parameter.
            moment: moments[f"{moment}.{name}"].to(parameter.device)
            for moment in ("step", "exp_avg", "exp_avg_sq")
        }
