"""Settings of the implicit solver."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch

from granbench.cells.contract import MaterialCell
from granbench.errors import ConfigurationError
from granbench.fem.time_step import require_whole

SCHEME_NAMES = ("newton", "restart", "initial-stiffness")
"""Iteration schemes, which are described in `granbench.fem.iteration`."""

TOLERANCE = 1e-6
SINGLE_TOLERANCE = 1e-4
"""A network's stress is the sum of larger numbers in single precision, which at a first small load
step shows at 1e-5 of it."""

MOST_STEPS = 1_000_000
"""Largest number of load steps."""


@dataclass(frozen=True)
class ImplicitSettings:
    """Settings of an implicit analysis.

    Parameters
    ----------
    steps : number of load steps
    scheme : a key of `SCHEME_NAMES`
    tolerance : of the forces out of balance, relative to the largest nodal forces so far (their
        Euclidean norms); by default `TOLERANCE`, for a cell in single precision `SINGLE_TOLERANCE`
    displacement_tolerance : of the scheme `restart`, which stops by it instead
    iterations : most in a piece of a load step; by default those of the scheme
    cuts : how often a load step may be halved
    stiffness : ((xx, yy, xy) x 3), Pa; matrix of the scheme `initial-stiffness`, by default the
        cell's tangent at the start. Moving a shear strain moves both its entries in the tensor.
    density : kg/m3, of the weight

    Raises
    ------
    ConfigurationError
        If a number is out of range or the scheme unknown.
    """

    steps: int = 100
    scheme: str = "newton"
    tolerance: float | None = None
    displacement_tolerance: float = 1e-4
    iterations: int | None = None
    cuts: int = 8
    stiffness: tuple[tuple[float, ...], ...] | None = None
    density: float = 2650.0

    def __post_init__(self) -> None:
        if self.scheme not in SCHEME_NAMES:
            raise ConfigurationError(
                f"unknown scheme {self.scheme!r}; there are {', '.join(SCHEME_NAMES)}"
            )
        require_whole(self, "steps", "iterations", "cuts")
        for name in ("steps", "tolerance", "displacement_tolerance", "density", "iterations"):
            value = getattr(self, name)
            if value is not None and not (0.0 < value < math.inf):
                raise ConfigurationError(f"{name} is {value:g}; give one above 0")
        if self.steps > MOST_STEPS:
            raise ConfigurationError(
                f"steps is {self.steps}, more load steps than {MOST_STEPS:,}; give fewer"
            )
        if self.cuts < 0:
            raise ConfigurationError(f"cuts is {self.cuts}; give 0 or more")
        if self.stiffness is not None and np.shape(self.stiffness) != (3, 3):
            raise ConfigurationError(
                f"a stiffness has the shape {np.shape(self.stiffness)}; it must be (3, 3)"
            )

    def suited_to(self, cell: MaterialCell) -> ImplicitSettings:
        """The settings with the tolerance that they have by default for a cell, if none is set."""
        if self.tolerance is not None:
            return self
        single = torch.finfo(cell.dtype).eps > torch.finfo(torch.float64).eps
        return replace(self, tolerance=SINGLE_TOLERANCE if single else TOLERANCE)
