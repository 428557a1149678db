"""Reference models: what each offers, and how they are found by name.

A package registers a model under the entry-point group `granbench.baselines`; this module
holds no list of them. `granbench.cells.find` finds every kind of model that a user may name.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import xarray as xr

from granbench.cells.contract import MaterialCell
from granbench.errors import ModelError
from granbench.registration import Registry

DESCRIPTION_FILE = "model.json"
"""File in the folder of every trained model; its key `baseline` names the architecture."""


@dataclass(frozen=True)
class EpochReport:
    """The results of one epoch of a training run.

    Parameters
    ----------
    epoch : number of epochs done
    seconds : of training so far, over all sessions of the run
    training_loss : mean over the epoch's batches, whose weights change from one to the next
    validation_loss : of the weights at the end of the epoch
    best_loss : lowest validation loss so far
    learning_rate : of this epoch
    progress : share of the run that is over, in [0, 1]
    """

    epoch: int
    seconds: float
    training_loss: float
    validation_loss: float
    best_loss: float
    learning_rate: float
    progress: float


@dataclass(frozen=True)
class TrainingRequest:
    """What to train on, the folder of the run, and when it ends.

    Parameters
    ----------
    records : the whole dataset; the baseline chooses the training and validation splits from it
    out : folder of the run; a run that was begun there is continued
    seed : of the first weights and of the order of the training items
    preset : a name in `Baseline.presets`; the first of them where None
    epochs : how many at most, in place of the preset's
    seconds : of training over all sessions; None for no limit
    device : of torch, such as `cpu` or `cuda`
    on_epoch : called after every epoch
    """

    records: xr.Dataset
    out: Path
    seed: int = 0
    preset: str | None = None
    epochs: int | None = None
    seconds: float | None = None
    device: str = "cpu"
    on_epoch: Callable[[EpochReport], None] | None = None


@runtime_checkable
class Baseline(Protocol):
    """A reference model: how to train it, and how to get its cell.

    Attributes
    ----------
    name : under which it is registered
    title : for people
    presets : names of its training settings, the default first; empty where nothing is trained
    floor : whether it is a reference line in the tables of the board rather than a ranked model
    classical_model : name of the model whose parameters it fits; None for any other baseline
    """

    @property
    def name(self) -> str:
        """See `Baseline`."""

    @property
    def title(self) -> str:
        """See `Baseline`."""

    @property
    def presets(self) -> Sequence[str]:
        """See `Baseline`."""

    @property
    def floor(self) -> bool:
        """See `Baseline`."""

    @property
    def classical_model(self) -> str | None:
        """See `Baseline`."""

    def train(self, request: TrainingRequest) -> Path:
        """Train, or continue, and return the model's folder.

        Raises
        ------
        ModelError
            If there is nothing to train, or the run fails.
        ConfigurationError
            If the request does not fit the model or the folder.
        """

    def load(self, folder: Path | None, records: xr.Dataset) -> MaterialCell:
        """The cell of a trained model, or of one that needs no training (`folder` None).

        Parameters
        ----------
        folder : what `train` returned
        records : the whole dataset of the task, from whose training split constants are fitted

        Raises
        ------
        ModelError
            If the model's files are missing or damaged, or the dataset lacks what it needs.
        """


BASELINES: Registry[Baseline] = Registry(
    "granbench.baselines", "baseline", Baseline, names_agree=True, error=ModelError
)
"""Every registered reference model."""


def find_baseline(name: str) -> Baseline:
    """The registered reference model `name`.

    Raises
    ------
    ModelError
        If there is none of this name, or the package that registers it is broken.
    """
    return BASELINES.find(name)
