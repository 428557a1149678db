"""Families of random strain paths in the plane, drawn many at a time."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import BaseModel, ConfigDict

from granbench.errors import ConfigurationError
from granbench.paths.programme import Floats
from granbench.records.rounding import on_grid
from granbench.tensors import contraction_weights, frobenius_norm

STRAIN_GRID = 2.0**-20
"""Recorded strains are multiples of this, about a microstrain, and so are other numbers without
unit that go with them. Up to 16, single precision holds them exactly, and their increments too:
a record that is read in float32 gives a model the very increments that made it. A finer
grid would say more of the random numbers than of the material."""


@dataclass(frozen=True)
class DrawnPaths:
    """Strain paths and what was drawn for each.

    Parameters
    ----------
    strain : (path, step, 3), components xx, yy, xy, cumulative, compression positive; zero at
        step 0
    parameters : by dataset name, each (path,)
    """

    strain: Floats
    parameters: Mapping[str, Floats]


class PathFamily(BaseModel, abc.ABC):
    """Ranges that a family of strain paths is drawn from.

    The first paths of a longer draw are those of a shorter one.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    loading_family: ClassVar[str]

    @abc.abstractmethod
    def draw(self, rng: np.random.Generator, count: int, steps: int) -> DrawnPaths:
        """Draw paths.

        Parameters
        ----------
        rng : it is spawned from, not drawn from
        count : number of paths
        steps : increments of a path, equally spaced in pseudo-time [0, 1]
        """


def on_strain_grid(strain: Floats) -> Floats:
    """Strains (...) rounded to multiples of `STRAIN_GRID`, as float32 can hold them."""
    return on_grid(strain, STRAIN_GRID).astype(np.float64)


def require_range(family: PathFamily, field: str, low: float, high: float = np.inf) -> None:
    """Raise ConfigurationError unless the family's field is a rising range within bounds."""
    first, last = getattr(family, field)
    if not low <= first <= last <= high:
        raise ConfigurationError(
            f"{type(family).__name__}.{field} = {getattr(family, field)!r} must be two rising "
            f"numbers from {low:g} to {high:g}"
        )


def uniform(rng: np.random.Generator, count: int, *ranges: tuple[float, float]) -> Floats:
    """Independent uniform numbers (range, path), those of a path drawn together."""
    low, high = np.array(ranges, dtype=float).T
    return rng.uniform(low, high, (count, len(ranges))).T


def directions(rng: np.random.Generator, count: int) -> Floats:
    """Strain directions (path, 3) of unit Frobenius norm, uniform over all of them."""
    # A shear component counts twice in the norm; in (xx, yy, sqrt 2 xy) it is Euclidean.
    direction = rng.standard_normal((count, 3)) / np.sqrt(contraction_weights("plane"))
    return direction / frobenius_norm(direction, "plane")[:, None]
