"""The servo that finds the free strain rates of a stress-controlled test.

Each chunk ends with its average stress. An estimate of the isotropic elastic stiffness converts the
error of the controlled stresses to a strain, and a fraction of this strain is added in the next
chunk. An integral part adapts to the steady rate (dilatancy) that the path needs.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SHEAR_OVER_BULK = 0.6


@dataclass(frozen=True)
class ServoGains:
    """Gains and limits of the servo law.

    Parameters
    ----------
    proportional : fraction of the elastic strain error that is corrected in one chunk
    integral : fraction of it that is added to the steady rate
    integral_limit, rate_limit : bounds of the steady and of the total rate, as multiples of the
        driving rate; a dense packing at b = 1 needs a minor strain rate of more than 3
    """

    proportional: float = 0.375
    integral: float = 0.1
    integral_limit: float = 5.0
    rate_limit: float = 6.0


@dataclass
class StressServo:
    """Proportional-integral control of some combinations of stresses by as many strain rates.

    Parameters
    ----------
    free_directions : (3, control), principal strain rates for a unit of each free rate
    controlled_stresses : (control, 3), rows with the coefficients of the controlled combinations
    gains : of the control
    """

    free_directions: Floats
    controlled_stresses: Floats
    gains: ServoGains = field(default_factory=ServoGains)

    def __post_init__(self) -> None:
        self._steady = np.zeros(self.free_directions.shape[1])

    def rates(
        self,
        error: Floats,
        change: Floats,
        bulk_modulus: float,
        duration: float,
        driving_rate: float,
    ) -> Floats:
        """Return the free rates for the next chunk, and adapt the steady rates.

        Parameters
        ----------
        error : (control,), target minus measured combinations, Pa
        change : (control,), change of the targets in the next chunk, Pa; fully fed forward
        bulk_modulus : present tangent bulk modulus K, Pa; G = 0.6 K
        duration : of a chunk, s
        driving_rate : magnitude of the prescribed rate, 1/s

        Returns
        -------
        rates : (control,), 1/s
        """
        stiffness = isotropic_stiffness(bulk_modulus, SHEAR_OVER_BULK * bulk_modulus)
        jacobian = self.controlled_stresses @ stiffness @ self.free_directions
        rate, ahead = np.linalg.solve(jacobian, np.stack([error, change], axis=1)).T / duration
        gains = self.gains
        bound = gains.integral_limit * driving_rate
        self._steady = np.clip(self._steady + gains.integral * rate, -bound, bound)
        bound = gains.rate_limit * driving_rate
        return np.clip(self._steady + gains.proportional * rate + ahead, -bound, bound)

    def rescale(self, factor: float) -> None:
        """Multiply the steady rates by a factor, such as -1 where the driving rate is reversed."""
        self._steady = self._steady * factor


def isotropic_stiffness(bulk_modulus: float, shear_modulus: float) -> Floats:
    """Return the elastic matrix (3, 3) between principal strain and stress, Pa."""
    return np.full((3, 3), bulk_modulus - 2 / 3 * shear_modulus) + 2 * shear_modulus * np.eye(3)
