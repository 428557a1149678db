"""The axes of the benchmark and the protocols by which predictions are made."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from granbench.errors import ConfigurationError

WINDOW_STEPS = 20
"""Predicted steps of a window (Sec 2.2.3)."""


@dataclass(frozen=True)
class ProtocolSpec:
    """How predictions of one protocol are made, and so which steps count.

    Parameters
    ----------
    name : label in the files
    axis : the benchmark axis that it belongs to
    title : for people
    restart : steps after which the true record is given again; None for never
    noise : amplitude xi of Eq 5.13
    """

    name: str
    axis: str
    title: str
    restart: int | None = None
    noise: float = 0.0

    @property
    def first_predicted_step(self) -> int:
        """Steps before this one are context and are never counted."""
        return 1

    def horizon(self, steps: int) -> np.ndarray:
        """Steps since truth was last given, (step,), int; 0 at the context step."""
        step = np.arange(steps)
        if self.restart is None:
            return step
        return np.where(step == 0, 0, (step - 1) % self.restart + 1)


PROTOCOLS: dict[str, ProtocolSpec] = {
    spec.name: spec
    for spec in (
        ProtocolSpec("single-step", "single-step", "Single step", restart=1),
        ProtocolSpec("window", "window", f"Windows of\u00a0{WINDOW_STEPS}", restart=WINDOW_STEPS),
        ProtocolSpec("rollout", "rollout", "Whole-path rollout"),
        ProtocolSpec("noise-0.2", "noise", "Rollout, noise ξ\u00a0=\u00a00.2", noise=0.2),
        ProtocolSpec("noise-0.5", "noise", "Rollout, noise ξ\u00a0=\u00a00.5", noise=0.5),
        ProtocolSpec("noise-1.0", "noise", "Rollout, noise ξ\u00a0=\u00a01", noise=1.0),
    )
}
"""The protocols whose predictions are compared with records."""

NOISE_PROTOCOLS: tuple[str, ...] = tuple(
    spec.name for spec in PROTOCOLS.values() if spec.axis == "noise"
)
EMBEDDED, PHYSICS, COST = "embedded", "physics", "cost"
AXES: tuple[str, ...] = (
    *dict.fromkeys(spec.axis for spec in PROTOCOLS.values()), EMBEDDED, PHYSICS, COST,
)  # fmt: skip
"""What a model can be evaluated on, in the order in which it is."""


def chosen_axes(names: Iterable[str]) -> tuple[str, ...]:
    """The named axes, each once, in the order of `AXES`.

    Raises
    ------
    ConfigurationError
        If one is unknown, or there is none.
    """
    wanted = set(names)
    if unknown := sorted(wanted - set(AXES)):
        raise ConfigurationError(f"unknown axis {unknown[0]!r}; use {', '.join(AXES)}")
    if not wanted:
        raise ConfigurationError(f"there is no axis to evaluate; use {', '.join(AXES)}")
    return tuple(axis for axis in AXES if axis in wanted)


def protocols_of(axes: Iterable[str]) -> tuple[ProtocolSpec, ...]:
    """The protocols of some axes, in the order of `PROTOCOLS`; the axes after noise have none.

    Raises
    ------
    ConfigurationError
        If an axis is unknown.
    """
    wanted = chosen_axes(axes)
    return tuple(spec for spec in PROTOCOLS.values() if spec.axis in wanted)
