"""The protocols whose predictions are compared with recorded paths."""

from dataclasses import dataclass

import numpy as np

from granbench.benchmark.axis import Part

WINDOW_STEPS = 20
"""Predicted steps of a window (Sec 2.2.3)."""

SINGLE_STEP, WINDOW, ROLLOUT, NOISE = "single-step", "window", "rollout", "noise"
"""Names of the axes."""


@dataclass(frozen=True, kw_only=True)
class ProtocolSpec(Part):
    """How predictions of one protocol are made, and so which steps count.

    Parameters
    ----------
    restart : steps after which the true record is given again; None for never
    noise : amplitude xi of Eq 5.13
    """

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


def _noise(amplitude: float, shown: str) -> ProtocolSpec:
    return ProtocolSpec(
        name=f"{NOISE}-{amplitude}",
        axis=NOISE,
        title=f"Rollout, noise ξ\u00a0=\u00a0{shown}",
        noise=amplitude,
        seeded=True,
    )


PROTOCOLS: dict[str, ProtocolSpec] = {
    spec.name: spec
    for spec in (
        ProtocolSpec(name=SINGLE_STEP, axis=SINGLE_STEP, title="Single step", restart=1),
        ProtocolSpec(
            name=WINDOW,
            axis=WINDOW,
            title=f"Windows of\u00a0{WINDOW_STEPS}",
            restart=WINDOW_STEPS,
        ),
        ProtocolSpec(name=ROLLOUT, axis=ROLLOUT, title="Whole-path rollout"),
        _noise(0.2, "0.2"),
        _noise(0.5, "0.5"),
        _noise(1.0, "1"),
    )
}

NOISE_PROTOCOLS: tuple[str, ...] = tuple(
    spec.name for spec in PROTOCOLS.values() if spec.axis == NOISE
)
AXES: tuple[str, ...] = tuple(dict.fromkeys(spec.axis for spec in PROTOCOLS.values()))
