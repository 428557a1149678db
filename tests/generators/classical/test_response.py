"""The response of a model along strain paths: start, records, tangents."""

import numpy as np
import pytest
import torch

from granbench.generators.classical.response import isotropic_start, response
from granbench.generators.rounding import recorded
from granbench.models import MODELS
from granbench.models.j2 import J2
from granbench.paths.drawn import on_strain_grid
from granbench.paths.gaussian import GaussianStrain

PRESSURE = 1e5


@pytest.fixture
def strain() -> torch.Tensor:
    drawn = GaussianStrain().draw(np.random.default_rng(0), 6, 30)
    return torch.from_numpy(on_strain_grid(drawn.strain))


@pytest.mark.parametrize("name", MODELS)
def test_start_is_isotropic_and_rounded_as_a_record(name: str) -> None:
    cell = MODELS[name]()
    start = isotropic_start(cell, PRESSURE, 3)
    assert start.stress.tolist() == [[PRESSURE, PRESSURE, 0.0]] * 3
    assert start.require("initial_mean_stress").tolist() == [PRESSURE] * 3
    for internal in cell.internals:
        value = start.require(internal)
        np.testing.assert_array_equal(recorded(internal, value), value)
    state = cell.initial_state(start)
    torch.testing.assert_close(state[:, :3], start.stress, rtol=0.0, atol=0.0)


def test_records_are_a_rollout_of_the_cell(strain: torch.Tensor) -> None:
    cell = J2()
    start = isotropic_start(cell, 0.0, len(strain))
    run = response(cell, strain, start)
    assert run.tangent is None
    with torch.no_grad():
        assert torch.equal(run.stress, cell.rollout(strain, start).stress)
    torch.testing.assert_close(run.mean_stress, run.stress[..., :2].mean(-1))


def test_tangents_are_those_of_the_step_that_ends_there(strain: torch.Tensor) -> None:
    """Compared with central differences of the step, and at step 0 with the elastic stiffness."""
    cell = J2()
    run = response(cell, strain, isotropic_start(cell, 0.0, len(strain)), tangents=True)
    bulk, shear = cell.values()["bulk_modulus"], cell.values()["shear_modulus"]
    elastic = [[bulk + shear, bulk - shear, 0.0], [bulk - shear, bulk + shear, 0.0],
               [0.0, 0.0, 2.0 * shear]]  # fmt: skip
    np.testing.assert_allclose(run.tangent[0, 0], elastic, rtol=1e-12, atol=1e-6)
    step, size = 17, 1e-7
    before, increment = run.stress[:, step - 1], strain[:, step] - strain[:, step - 1]
    for column in range(3):
        nudge = torch.zeros(3, dtype=torch.float64)
        nudge[column] = size
        with torch.no_grad():
            forward, _ = cell.step(increment + nudge, before)
            backward, _ = cell.step(increment - nudge, before)
        difference = (forward - backward) / (2.0 * size)
        # Second-order error 1e-14 x d3 sigma and rounding 1e5 x 1e-16/1e-7, both below 1 kPa.
        np.testing.assert_allclose(run.tangent[:, step, :, column], difference, atol=1e3)
