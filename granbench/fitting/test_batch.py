"""Tests that run together in a fit: what drives the model, and the measured values to compare."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from granbench.cells.contract import Conditions
from granbench.paths.mixed_control import MixedControl

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class TestBatch:
    """Tests of one kind of control; shorter ones repeat their last point, with weight zero.

    Parameters
    ----------
    names : of the tests
    kind : of control: `strain`, `mixed`, or `oedometer`, in which the axial stress drives
    control : what is prescribed, (test, step, ...)
    conditions : what is known at step 0, of every test
    quantities : what is compared
    stress_map, strain_map : (quantity, component); a quantity is
        ``stress_map @ stress + strain_map @ strain``
    observed : (test, step, quantity), measured; zero where it was not
    scale : (test, quantity), range that errors are divided by
    weight : (test, step, quantity); zero at step 0, where nothing is predicted, at repeated
        points and where nothing was measured
    """

    names: tuple[str, ...]
    kind: str
    control: MixedControl
    conditions: Conditions
    quantities: tuple[str, ...]
    stress_map: Tensor
    strain_map: Tensor
    observed: Tensor
    scale: Tensor
    weight: Tensor

    __test__ = False  # pytest would take it for tests of its own

    @property
    def size(self) -> int:
        """Number of tests."""
        return len(self.names)

    @property
    def residual_weight(self) -> Tensor:
        """Factors (test, step, quantity) from differences to residuals.

        The squares of a test's weights sum to one, so a fit's sum of squares is the sum over
        tests of their squared errors, however many points each has.
        """
        total = (self.weight**2).sum(dim=(1, 2), keepdim=True)
        return self.weight / total.sqrt() / self.scale[:, None]

    def quantity(self, stress: Tensor, strain: Tensor) -> Tensor:
        """The compared quantities, (..., quantity), of stress and strain (..., component)."""
        return stress @ self.stress_map.T + strain @ self.strain_map.T

    def repeated(self, times: int) -> "tuple[MixedControl, Conditions]":
        """Control and conditions of `times` copies of the batch, copy by copy."""

        def again(array: Floats) -> Floats:
            return np.tile(array, (times, *(1,) * (array.ndim - 1)))

        control, known = self.control, self.conditions
        copies = MixedControl(
            control.order,
            again(control.driven),
            again(control.free),
            again(control.held),
            again(control.targets),
        )
        scalars = {name: value.repeat(times) for name, value in known.scalars.items()}
        return copies, Conditions(known.stress.repeat(times, 1), scalars)
