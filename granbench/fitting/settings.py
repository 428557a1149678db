"""Settings of a fit."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from granbench.errors import ConfigurationError, Setting
from granbench.fitting.optimisation import (
    Effort,
)

CONTROLS = ("auto", "strain", "mixed")


@dataclass(frozen=True)
class FitSettings:
    """Settings of a fit.

    Parameters
    ----------
    free : parameters that are fitted; all by default
    control : see `batches_of`
    points : to which each test is thinned
    weights : of the compared quantities by name; 1 by default
    starts : number of starts, the first from the values that the cell has
    spread : standard deviation of the others, of the unconstrained numbers
    seed : of the starts and the bootstrap
    effort : of the search
    bootstrap : samples; 0 for intervals from the curvature

    Raises
    ------
    ConfigurationError
        If a setting is unknown or out of range.
    """

    free: tuple[str, ...] | None = None
    control: str = "auto"
    points: int = 60
    weights: Mapping[str, float] = field(default_factory=dict)
    starts: int = 8
    spread: float = 0.5
    seed: int = 0
    effort: Effort = field(default_factory=Effort)
    bootstrap: int = 0

    def __post_init__(self) -> None:
        """Raise ConfigurationError for settings that are unknown or out of range."""
        if self.control not in CONTROLS:
            raise ConfigurationError(
                Setting("control", self.control), f" is unknown; use {', '.join(CONTROLS)}"
            )
        least = {"points": 5, "starts": 1, "seed": 0, "bootstrap": 0}
        for name, bound in least.items():
            if getattr(self, name) < bound:
                raise ConfigurationError(
                    f"{name} = {getattr(self, name)} is too few; give {bound} or more"
                )
        if self.bootstrap in range(1, 20):
            raise ConfigurationError(
                f"bootstrap = {self.bootstrap} samples give no 95 % interval; take 20 or more"
            )
        if not 0.0 <= self.spread < float("inf"):
            raise ConfigurationError(f"spread = {self.spread:g} must not be negative")
