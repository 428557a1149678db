"""Training settings: optimiser, learning-rate schedule and stopping."""

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

from granbench.errors import ConfigurationError

ADAM_BETAS = (0.9, 0.999)
ADAM_EPSILON = 1e-8
"""Table 2.4."""

SCHEDULES = ("constant", "cosine", "one-cycle")

WARM_UP = 0.3
"""Share of a one-cycle run in which the rate rises, from `learning_rate` / `FIRST_DIVISOR`."""
FIRST_DIVISOR = 25.0


@dataclass(frozen=True)
class Recipe:
    """Settings of one training run; the defaults are those of Table 2.4.

    Parameters
    ----------
    batch_size : items per step of the optimiser
    learning_rate : of Adam, where the schedule begins
    schedule : `constant`; `cosine`, from `learning_rate` to `final_rate` over the run; or
        `one-cycle`, which rises to `learning_rate` first (Smith & Topin 2019) and falls as cosine
    final_rate : learning rate where a cosine or one-cycle schedule ends
    largest_gradient : norm to which larger gradients are clipped; None for no clipping
    epochs : passes over the training items, at most
    patience : epochs without a lower validation loss after which the run ends

    Raises
    ------
    ConfigurationError
        If a setting is out of range.
    """

    batch_size: int = 256
    learning_rate: float = 1e-3
    schedule: Literal["constant", "cosine", "one-cycle"] = "constant"
    final_rate: float = 1e-6
    largest_gradient: float | None = None
    epochs: int = 20_000
    patience: int = 1000

    def __post_init__(self) -> None:
        for name in ("batch_size", "epochs", "patience"):
            if getattr(self, name) < 1:
                raise ConfigurationError(f"{name} is {getattr(self, name)}; it must be at least 1")
        for name in ("learning_rate", "final_rate"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ConfigurationError(f"{name} is {getattr(self, name)}; it must be positive")
        if self.largest_gradient is not None and not self.largest_gradient > 0.0:
            raise ConfigurationError(
                f"largest_gradient is {self.largest_gradient}; it must be positive"
            )
        if self.schedule not in SCHEDULES:
            raise ConfigurationError(
                f"unknown schedule {self.schedule!r}; use {' or '.join(SCHEDULES)}"
            )

    def rate(self, progress: float) -> float:
        """Learning rate at the completed share `progress` in [0, 1] of the run."""
        if self.schedule == "constant":
            return self.learning_rate
        if self.schedule == "cosine":
            return _eased(self.learning_rate, self.final_rate, progress)
        if progress < WARM_UP:
            first = self.learning_rate / FIRST_DIVISOR
            return _eased(first, self.learning_rate, progress / WARM_UP)
        return _eased(self.learning_rate, self.final_rate, (progress - WARM_UP) / (1.0 - WARM_UP))

    def as_dict(self) -> dict[str, Any]:
        """Settings by name, for a file."""
        return asdict(self)


def _eased(begin: float, end: float, share: float) -> float:
    """Half a cosine from `begin` to `end`."""
    cosine = 0.5 * (1.0 + math.cos(math.pi * min(share, 1.0)))
    return end + (begin - end) * cosine


@dataclass(frozen=True)
class Limits:
    """Limits of one call of the engine, in addition to the patience of the recipe.

    Parameters
    ----------
    epochs : in place of the recipe's; counted over all sessions of the run
    seconds : of training, over all sessions of the run; None for no limit
    """

    epochs: int | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        if self.epochs is not None and self.epochs < 1:
            raise ConfigurationError(f"epochs is {self.epochs}; it must be at least 1")
        if self.seconds is not None and not 0.0 < self.seconds < math.inf:
            raise ConfigurationError(
                f"the training budget is {self.seconds} s; it must be positive"
            )

    def progress(self, recipe: Recipe, epoch: int, seconds: float) -> float:
        """Completed share of the run after `epoch` epochs and `seconds` of training.

        With a time limit the share follows the limit that is nearer, so that a schedule is
        completed on a slow machine too; such a run depends on the speed of the machine. Without a
        time limit the share depends on the epoch alone.
        """
        share = epoch / (self.epochs or recipe.epochs)
        if self.seconds is not None:
            share = max(share, seconds / self.seconds)
        return share
