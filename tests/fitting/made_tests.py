"""Laboratory tests computed with a model, so that a fit has a known truth."""

import numpy as np
import torch

from granbench.cells.contract import Conditions
from granbench.element_test.run import run_test
from granbench.laboratory import LaboratoryTest
from granbench.models import ClassicalCell, find_model
from granbench.paths.mixed_control import MixedControl

TRUE_J2 = {"bulk_modulus": 3.1e6, "shear_modulus": 1.3e6, "yield_stress": 6.3e4}


def j2(**values: float) -> ClassicalCell:
    """J2 in principal components, with the published values or others."""
    return find_model("j2")(values, order="principal")


def loading_and_unloading(steps: int = 13, reach: float = 0.04) -> np.ndarray:
    """Axial strain that goes up to a strain and halfway back, (step,)."""
    up = np.linspace(0.0, reach, 2 * steps // 3 + 1)
    down = np.linspace(reach, 0.5 * reach, steps - len(up) + 1)
    return np.concatenate([up, down[1:]])


def drained(
    cell: ClassicalCell,
    axial: np.ndarray,
    *,
    pressure: float = 1e5,
    void_ratio: float | None = None,
    name: str = "drained",
) -> LaboratoryTest:
    """The response of a cell in a drained triaxial test."""
    strain = np.zeros((len(axial), 3))
    strain[:, 0] = axial
    stress = np.full_like(strain, pressure)
    control = MixedControl.of_components("principal", ("22", "33"), strain, stress)
    start = torch.full((1, 3), pressure, dtype=torch.float64)
    scalars = {"initial_mean_stress": start[:, 0]}
    if void_ratio is not None:
        scalars["initial_void_ratio"] = torch.full((1,), void_ratio, dtype=torch.float64)
    done = run_test(cell, control, Conditions(start, scalars))
    assert not done.failures
    ratio = None
    if void_ratio is not None:
        ratio = (1.0 + void_ratio) * np.exp(-done.strain[0].sum(axis=1)) - 1.0
    return LaboratoryTest(
        name, "made by the model", "triaxial-drained", done.strain[0], done.stress[0], ratio
    )


def strained(cell: ClassicalCell, strain: np.ndarray, *, pressure: float = 1e5) -> LaboratoryTest:
    """The response of a cell to principal strains (step, 3)."""
    start = Conditions(torch.full((1, 3), pressure, dtype=torch.float64))
    with torch.no_grad():
        stress = cell.rollout(torch.from_numpy(strain)[None], start).stress[0].numpy()
    return LaboratoryTest("strained", "made by the model", "strain", strain, stress)
