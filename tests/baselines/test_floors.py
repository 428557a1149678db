"""The floors and the ceiling that every model is measured between."""

import numpy as np
import pytest
import torch
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from granbench.baselines.linear_elastic import LinearElasticCell, fitted_moduli
from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import quantise
from granbench.cells.baseline import BASELINES, TrainingRequest, find_baseline
from granbench.cells.contract import Conditions
from granbench.cells.find import UntrainedBaselineError, find_cells
from granbench.data.adapters import conditions_of, history_of
from granbench.errors import ModelError

FLOORS = ("persistence", "linear-elastic", "oracle")


def test_every_baseline_of_the_package_is_found_by_name() -> None:
    assert {"lstm", "mlstm", *FLOORS} <= set(BASELINES)
    for name in BASELINES:
        baseline = find_baseline(name)
        assert baseline.name == name
        assert baseline.title


def test_unknown_baseline_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(ModelError, match="did you mean 'mlstm'"):
        find_baseline("mlsmt")


@pytest.mark.parametrize("name", FLOORS)
def test_a_baseline_without_training_cannot_be_trained(
    records: xr.Dataset, tmp_path, name: str
) -> None:
    with pytest.raises(ModelError, match=name):
        find_baseline(name).train(TrainingRequest(records, tmp_path))


@pytest.mark.parametrize("name", ["lstm", "mlstm"])
def test_using_an_untrained_baseline_is_an_error(records: xr.Dataset, name: str) -> None:
    with pytest.raises(UntrainedBaselineError, match=name):
        find_cells(name, records)


def test_oracle_is_exact_under_every_protocol(records: xr.Dataset) -> None:
    # In another order than it was shown them, so that positions do not help.
    asked = records.isel(path=np.random.default_rng(0).permutation(records.sizes["path"])[:9])
    predictions = predict({0: find_cells("oracle", records).cell}, asked)
    for name in ("stress", "void_ratio"):
        truth = quantise(asked[name].values)
        assert (predictions[name].values == truth).all()


def test_oracle_refuses_a_path_that_it_was_not_shown(records: xr.Dataset) -> None:
    cell = find_cells("oracle", records.isel(path=slice(0, 3))).cell
    with pytest.raises(ModelError, match="whole dataset"):
        cell.initial_state(conditions_of(records))


def test_persistence_keeps_the_stress_constant(records: xr.Dataset) -> None:
    cell = find_cells("persistence", records).cell
    history = history_of(records)
    result = cell.rollout(history.strain, history.conditions)
    assert (result.stress == history.stress[:, :1]).all()
    assert (result.internals["void_ratio"] == history.internals["void_ratio"][:, :1]).all()
    states = cell.condition_each(history)
    assert torch.equal(states[..., :3], history.stress)


@settings(deadline=None)
@given(bulk=st.floats(1e5, 1e9), shear=st.floats(1e5, 1e9), seed=st.integers(0, 2**16))
def test_moduli_are_recovered_from_elastic_records(bulk: float, shear: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    strain = np.cumsum(rng.normal(0.0, 1e-3, (4, 30, 3)), axis=1)
    strain -= strain[:, :1]
    conditions = Conditions(
        torch.full((4, 3), 1e5, dtype=torch.float64),
        {"initial_void_ratio": torch.full((4,), 0.6, dtype=torch.float64)},
    )
    stress = LinearElasticCell(bulk, shear).rollout(torch.from_numpy(strain), conditions).stress
    # Increments are differences of stresses: at 1e5 Pa + 1e-3 x modulus they keep 11 digits.
    assert fitted_moduli(strain, stress.numpy()) == pytest.approx((bulk, shear), rel=1e-8)


def test_scatter_about_elasticity_does_not_bias_the_moduli() -> None:
    rng = np.random.default_rng(0)
    dstrain = rng.normal(0.0, 1e-3, (50, 200, 3))
    volumetric = dstrain.sum(-1, keepdims=True)
    dstress = 5e7 * volumetric + 2 * 2e7 * (dstrain - volumetric / 3)
    dstress += rng.normal(0.0, 1e4, dstress.shape)
    strain, stress = np.cumsum(dstrain, axis=1), np.cumsum(dstress, axis=1)
    # The standard errors are 1e4 / (1e-3 sqrt(3) 100) = 58 kPa for K and below that for G.
    assert fitted_moduli(strain, stress) == pytest.approx((5e7, 2e7), abs=2.5e5)


def test_void_ratio_follows_the_volume_exactly(records: xr.Dataset) -> None:
    """However the strain is divided into steps, 1 + e = (1 + e0) exp(-eps_v)."""
    cell = find_cells("linear-elastic", records).cell
    history = history_of(records)
    result = cell.rollout(history.strain, history.conditions)
    initial = history.conditions.require("initial_void_ratio")[:, None]
    expected = (1.0 + initial) * torch.exp(-history.strain.sum(-1)) - 1.0
    torch.testing.assert_close(result.internals["void_ratio"], expected)


def test_moduli_need_strain_in_volume_and_shape() -> None:
    strain = np.cumsum(np.full((1, 5, 3), [1e-3, -1e-3, 0.0]), axis=1)
    with pytest.raises(ModelError, match="training paths"):
        fitted_moduli(strain, 1e7 * strain)


def test_linear_elastic_reads_only_the_training_split(records: xr.Dataset) -> None:
    spoilt = records.copy(deep=True)
    spoilt["stress"][records["split"].values != "train"] *= 3.0
    honest, same = (find_cells("linear-elastic", ds).cell for ds in (records, spoilt))
    assert (honest.bulk_modulus, honest.shear_modulus) == (same.bulk_modulus, same.shear_modulus)
