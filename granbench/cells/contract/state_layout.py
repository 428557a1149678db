"""Named slices of the state that a cell carries from step to step."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from granbench.errors import ModelError


@dataclass(frozen=True)
class StateLayout:
    """Named slices of a state tensor (point, n_state)."""

    slices: Mapping[str, slice]
    size: int

    @classmethod
    def of(cls, **widths: int) -> "StateLayout":
        """Layout with the given names and widths, in that order."""
        slices, start = {}, 0
        for name, width in widths.items():
            slices[name] = slice(start, start + width)
            start += width
        return cls(slices, start)

    def __getitem__(self, name: str) -> slice:
        return self.slices[name]

    def __contains__(self, name: str) -> bool:
        return name in self.slices

    def pack(self, **parts: Tensor) -> Tensor:
        """One state from its named parts, (point, n_state), stored component-major.

        Component-major storage keeps each component contiguous over the points, which is
        several times faster at many points; the shape a caller sees stays (point, n_state).
        """
        missing = set(self.slices) ^ set(parts)
        if missing:
            raise ModelError(f"state parts {sorted(missing)} do not fit the layout")
        rows = [part.T if part.ndim == 2 else part.unsqueeze(0) for part in parts.values()]
        order = {name: row for name, row in zip(parts, rows, strict=True)}
        return torch.cat([order[name] for name in self.slices]).T
