"""Admissible paths: only the volume change is reduced, and not more than needed."""

import numpy as np
import pytest
import torch

from granbench.errors import ModelError
from granbench.generators.classical.admissible import (
    FACTORS,
    HIGHEST_PRESSURE,
    LOWEST_PRESSURE,
    admissible_factors,
    scaled_volume,
)
from granbench.generators.classical.response import isotropic_start, response
from granbench.models.drucker_prager import DruckerPrager
from granbench.models.j2 import J2
from granbench.paths.drawn import STRAIN_GRID, on_strain_grid
from granbench.paths.gaussian import GaussianStrain
from granbench.tensors import volumetric_strain

PRESSURE = 1e5


@pytest.fixture
def strain() -> np.ndarray:
    return GaussianStrain().draw(np.random.default_rng(0), 40, 60).strain


def test_only_the_volume_change_is_scaled(strain: np.ndarray) -> None:
    factor = np.linspace(0.0, 1.0, len(strain))
    scaled = scaled_volume(strain, factor)
    grid = {"rtol": 0.0, "atol": 2.0 * STRAIN_GRID}
    np.testing.assert_allclose(
        volumetric_strain(scaled, "plane"),
        factor[:, None] * volumetric_strain(strain, "plane"),
        **grid,
    )
    for before, after in (
        (strain[..., 2], scaled[..., 2]),
        (_difference(strain), _difference(scaled)),
    ):
        np.testing.assert_allclose(after, before, **grid)
    np.testing.assert_array_equal(scaled[-1], on_strain_grid(strain[-1]))


def _difference(strain: np.ndarray) -> np.ndarray:
    return strain[..., 0] - strain[..., 1]


def test_the_factor_is_the_largest_that_keeps_the_pressure(strain: np.ndarray) -> None:
    """In J2 plasticity p = p0 + K eps_v, so that the factor has a closed form."""
    cell = J2()
    dilation = -volumetric_strain(strain, "plane").min(axis=1)
    limit = (1.0 - LOWEST_PRESSURE) * PRESSURE / cell.values()["bulk_modulus"]
    allowed = np.array(FACTORS) * dilation[:, None] <= limit
    expected = np.array(FACTORS)[allowed.argmax(axis=1)]
    assert 0.2 < (expected < 1.0).mean() < 0.9  # both cases occur
    np.testing.assert_array_equal(admissible_factors(cell, strain, PRESSURE), expected)


def test_scaled_paths_keep_a_frictional_model_in_compression(strain: np.ndarray) -> None:
    cell = DruckerPrager()
    start = isotropic_start(cell, PRESSURE, len(strain))

    def lowest(path: np.ndarray) -> np.ndarray:
        return response(cell, torch.from_numpy(path), start).mean_stress.min(dim=1).values.numpy()

    assert (lowest(strain) < 1e-3 * PRESSURE).mean() > 0.1  # the apex is met
    factor = admissible_factors(cell, strain, PRESSURE)
    assert lowest(scaled_volume(strain, factor)).min() >= LOWEST_PRESSURE * PRESSURE


def test_a_model_that_stiffens_is_not_crushed(strain: np.ndarray) -> None:
    """With a hundred times the K of the thesis, p = p0 + K eps_v would reach hundreds of p0."""
    cell = J2({"bulk_modulus": 1.25e8})
    factor = admissible_factors(cell, strain, PRESSURE)
    run = response(
        cell,
        torch.from_numpy(scaled_volume(strain, factor)),
        isotropic_start(cell, PRESSURE, len(strain)),
    )
    assert run.mean_stress.max() <= HIGHEST_PRESSURE * PRESSURE
    assert run.mean_stress.min() >= LOWEST_PRESSURE * PRESSURE
    contracting = volumetric_strain(strain, "plane").min(axis=1) > -1e-4
    assert (factor[contracting] < 1.0).all()


def test_a_path_without_an_admissible_factor_is_refused(strain: np.ndarray) -> None:
    """A cone with contractive flow loses its pressure by shear alone."""
    contractive = DruckerPrager({"dilation_slope": -0.3})
    with pytest.raises(ModelError, match="even at constant volume; start from another"):
        admissible_factors(contractive, strain, PRESSURE)
