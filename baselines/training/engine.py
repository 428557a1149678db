"""The training engine: one loop for any network with a loss and any source of batches.

A run is kept in a folder and continues from there when it is started again. The order of the items
in epoch k is a function of (seed, k) alone and everything else that changes is saved, so a run that
was interrupted and continued ends bit for bit like one that was not (on the CPU, with the same
versions, machine type and number of threads).
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor, nn

from granbench.baselines.training.batches import Batch, BatchSource
from granbench.baselines.training.history import read_history, write_history
from granbench.baselines.training.progress import (
    TRAINING_FILE,
    TrainingProgress,
    restore_progress,
    save_progress,
)
from granbench.baselines.training.recipe import ADAM_BETAS, ADAM_EPSILON, Limits, Recipe
from granbench.baselines.training.tensor_files import unwritable
from granbench.cells.baseline import EpochReport
from granbench.errors import ModelError

SAVE_EVERY_SECONDS = 5.0
"""Interval between saves: a killed run loses at most this and the current epoch."""

VALIDATION_BATCH = 4096


class TrainableNetwork(Protocol):
    """A `torch.nn.Module` with a loss."""

    def loss(self, batch: Batch) -> Tensor:
        """Mean loss over the items of a batch, a scalar."""


@dataclass(frozen=True)
class TrainingOutcome:
    """Result of a training run.

    Parameters
    ----------
    progress : epochs, seconds, best epoch and its validation loss
    reason : `patience`, `epochs` or `budget`
    best_weights : state of the network at its best epoch, on the CPU
    """

    progress: TrainingProgress
    reason: str
    best_weights: Mapping[str, Tensor]


def train(
    network: nn.Module,
    training: BatchSource,
    validation: BatchSource,
    *,
    recipe: Recipe,
    limits: Limits,
    seed: int,
    folder: Path,
    fingerprint: Mapping[str, Any],
    on_epoch: Callable[[EpochReport], None] | None = None,
) -> TrainingOutcome:
    """Train until the validation loss stops falling or a limit is reached; continue a begun run.

    Parameters
    ----------
    network : a `TrainableNetwork`, on the device of the batches; its weights change
    training, validation : items of the two splits
    recipe : optimiser settings
    limits : epochs and seconds after which to stop
    seed : of the order of the items
    folder : of the run
    fingerprint : identity of the run, as data for JSON: see `save_progress`
    on_epoch : called after every epoch

    Raises
    ------
    ConfigurationError
        If the folder holds another run.
    ModelError
        If the loss is no longer finite, or the folder is damaged or cannot be written.
    """
    run = _Run(network, training, validation, recipe, limits, seed, folder, fingerprint)
    while (reason := run.end()) is None:
        report = run.epoch()
        if on_epoch is not None:
            on_epoch(report)
        if time.monotonic() - run.last_save > SAVE_EVERY_SECONDS:
            run.save()
    run.save()
    return TrainingOutcome(run.progress, reason, run.best)


class _Run:
    def __init__(
        self,
        network: nn.Module,
        training: BatchSource,
        validation: BatchSource,
        recipe: Recipe,
        limits: Limits,
        seed: int,
        folder: Path,
        fingerprint: Mapping[str, Any],
    ) -> None:
        self.network = network
        self.training = training
        self.validation = validation
        self.recipe = recipe
        self.limits = limits
        self.seed = seed
        self.folder = folder
        self.fingerprint = {**fingerprint, "seed": seed, "recipe": _lasting(recipe)}
        self.optimiser = torch.optim.Adam(
            network.parameters(),
            lr=recipe.learning_rate,
            betas=ADAM_BETAS,
            eps=ADAM_EPSILON,
            fused=True,
        )
        self.progress = TrainingProgress()
        self.history: list[EpochReport] = []
        self.best = _copy(network)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise unwritable(folder, error) from error
        if (folder / TRAINING_FILE).exists():
            self.progress, self.best = restore_progress(
                folder, network, self.optimiser, self.fingerprint
            )
            self.history = read_history(folder, until_epoch=self.progress.epoch)
        self.last_save = time.monotonic()

    def end(self) -> str | None:
        """Why the run is over; None if it is not."""
        progress = self.progress
        if progress.epoch - progress.best_epoch >= self.recipe.patience:
            return "patience"
        if progress.epoch >= (self.limits.epochs or self.recipe.epochs):
            return "epochs"
        if self.limits.seconds is not None and progress.seconds >= self.limits.seconds:
            return "budget"
        return None

    def epoch(self) -> EpochReport:
        """One pass over the training items, then the validation loss."""
        start = time.monotonic()
        progress = self.progress
        share = self.limits.progress(self.recipe, progress.epoch, progress.seconds)
        rate = self.recipe.rate(share)
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        training_loss = self._learn(self.training.shuffled(_generator(self.seed, progress.epoch)))
        validation_loss = self._validate()
        if not (math.isfinite(training_loss) and math.isfinite(validation_loss)):
            raise ModelError(
                f"the loss is no longer finite in epoch {progress.epoch + 1} (training "
                f"{training_loss}, validation {validation_loss}); lower the learning rate of the "
                "recipe"
            )
        progress.epoch += 1
        progress.seconds += time.monotonic() - start
        if validation_loss < progress.best_loss:
            progress.best_loss, progress.best_epoch = validation_loss, progress.epoch
            self.best = _copy(self.network)
        report = EpochReport(
            progress.epoch,
            progress.seconds,
            training_loss,
            validation_loss,
            progress.best_loss,
            rate,
            min(1.0, self.limits.progress(self.recipe, progress.epoch, progress.seconds)),
        )
        self.history.append(report)
        return report

    def _learn(self, order: Tensor) -> float:
        self.network.train()
        total = torch.zeros((), dtype=torch.float64)
        for batch in self.training.batches(order, self.recipe.batch_size):
            self.optimiser.zero_grad()
            loss = self.network.loss(batch)  # type: ignore[operator]
            loss.backward()
            if self.recipe.largest_gradient is not None:
                nn.utils.clip_grad_norm_(self.network.parameters(), self.recipe.largest_gradient)
            self.optimiser.step()
            # Summed on the device: reading the value would make a GPU wait in every step.
            total = total.to(loss.device) + loss.detach() * len(batch[0])
        return total.item() / len(order)

    @torch.no_grad()
    def _validate(self) -> float:
        self.network.eval()
        total = torch.zeros((), dtype=torch.float64)
        order = torch.arange(self.validation.item_count)
        for batch in self.validation.batches(order, VALIDATION_BATCH):
            loss = self.network.loss(batch)  # type: ignore[operator]
            total = total.to(loss.device) + loss * len(batch[0])
        return total.item() / len(order)

    def save(self) -> None:
        """Write the run; the table first, because the counters say how much of it is valid."""
        try:
            write_history(self.folder, self.history)
        except OSError as error:
            raise unwritable(self.folder, error) from error
        save_progress(
            self.folder, self.network, self.best, self.optimiser, self.progress, self.fingerprint
        )
        self.last_save = time.monotonic()


def _generator(seed: int, epoch: int) -> torch.Generator:
    """Random numbers of an epoch, a function of seed and epoch alone."""
    mixed = np.random.SeedSequence([seed, epoch]).generate_state(1, np.uint64)[0]
    return torch.Generator().manual_seed(int(mixed))


def _copy(network: nn.Module) -> dict[str, Tensor]:
    return {name: tensor.detach().cpu().clone() for name, tensor in network.state_dict().items()}


def _lasting(recipe: Recipe) -> dict[str, Any]:
    """Settings that a continued run has to share; it may run longer or be more patient."""
    return {
        name: setting
        for name, setting in recipe.as_dict().items()
        if name not in ("epochs", "patience")
    }
