"""Plasticity of the published `gp-*` records.

Stresses have 16 bits of mantissa, and numbers without unit lie on a grid of 2^-20: the tolerances
follow from these roundings.
"""

import numpy as np
import pytest
import torch
import xarray as xr
from gp_records import (
    NAMES,
    UNIT,
    full_stress,
    ground_truth,
    invariants,
    principal_stress,
    rollout,
    series,
    shipped,
    some,
    split_rows,
)

from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.scoring import score
from granbench.cells.find import find_cells
from granbench.data.adapters import conditions_of
from granbench.data.normalisation import Normalisation
from granbench.generators.rounding import recorded
from granbench.paths.drawn import STRAIN_GRID
from granbench.records import verify
from granbench.tensors import frobenius_norm, lode_sin3, volumetric_strain

ADMISSIBLE = (
    "train", "validation", "test", "ood-rougher", "ood-amplitude", "ood-proportional", "ood-cyclic"
)  # fmt: skip
PRESSURE = 1e5
HALF_GRID = 0.5 * STRAIN_GRID


def plastic_strain(records: xr.Dataset, *labels: str) -> np.ndarray:
    return np.stack([series(records, f"plastic_strain_{label}") for label in labels], axis=-1)


@pytest.mark.parametrize("name", NAMES)
def test_the_file_is_unchanged(name: str) -> None:
    verify(shipped(name), name)


@pytest.mark.parametrize("name", NAMES)
def test_the_ground_truth_reproduces_its_records_to_the_last_bit(name: str) -> None:
    """On one path in eight of every split, for stress and all internal variables.

    On another machine the last bits may differ, so that one value in a million is rounded to the
    other side.
    """
    records = some(name)
    run = rollout(records)
    for variable, values in {"stress": run.stress, **run.internals}.items():
        again, kept = recorded(variable, values), records[variable].values
        assert (again != kept).mean() < 1e-5, variable
        np.testing.assert_allclose(again, kept, rtol=4.0 * UNIT, atol=STRAIN_GRID)


@pytest.mark.parametrize("name", NAMES)
def test_the_ground_truth_continues_from_any_recorded_state(name: str) -> None:
    """The error of one step from a recorded state is that of the rounding of the state.

    It is measured in standard deviations of the training stress: 8e-6 of a stress of up to eight
    standard deviations, and for CSUH half a grid step of H, 5e-7/c_p = 9e-6 of the size of the
    yield surface.
    """
    records = some(name)
    cell = ground_truth(records)
    strain, stress = series(records, "strain"), series(records, "stress")
    std = Normalisation.from_training(shipped(name)).std["stress"]
    for step in (40, 100, 160):
        with torch.no_grad():
            state = cell.initial_state(conditions_of(records, step))
            predicted, _ = cell.step(torch.from_numpy(strain[:, step + 1] - strain[:, step]), state)
        error = (predicted.numpy() - stress[:, step + 1]) / std
        assert np.sqrt((error**2).mean()) < 2e-5
        assert np.abs(error).max() < 2e-4


@pytest.mark.parametrize("name", NAMES)
def test_the_oracle_scores_exactly_zero(name: str) -> None:
    records = shipped(name)
    looked_up = evaluated(records)
    cell = find_cells("oracle", records).cell
    predictions = predict({0: cell}, looked_up, ["rollout", "single-step"])
    assert score(predictions, looked_up, Normalisation.from_training(records)).perfect


def test_j2_never_exceeds_its_yield_stress_and_is_elastic_in_volume() -> None:
    records = shipped("gp-j2")
    values = ground_truth(records).values()
    p, q = invariants(records)
    # q = sqrt(4 s_xx^2 + 4 s_xy^2), s_xx = (xx - yy)/2: each component off by its own unit.
    slack = 2.0 * UNIT * np.abs(series(records, "stress")).sum(-1)
    assert (q <= values["yield_stress"] + slack).all()
    assert (q > 0.9999 * values["yield_stress"]).mean() > 0.25  # many steps yield
    volumetric = volumetric_strain(series(records, "strain"), "plane")
    np.testing.assert_allclose(p, values["bulk_modulus"] * volumetric, atol=slack.max())


@pytest.mark.parametrize("name", ["gp-j2-hardening", "gp-ime"])
def test_hardening_yield_stress_is_not_exceeded(name: str) -> None:
    """q <= Y(|eps^p|), up to the rounding of q and of the plastic strain times the slope of Y."""
    records = shipped(name)
    cell = ground_truth(records)
    order = ("xx", "yy", "zz", "xy") if name == "gp-ime" else ("xx", "yy", "xy")
    plastic = plastic_strain(records, *order)
    shear_twice = np.ones(len(order)) + (np.array(order) == "xy")
    norm = np.sqrt((shear_twice * plastic**2).sum(-1))
    with torch.no_grad():
        strength, slope = cell.strength(cell.constants(), torch.from_numpy(norm))
    _, q = invariants(records)
    stress = np.abs(full_stress(records) if name == "gp-ime" else series(records, "stress"))
    slack = 2.0 * UNIT * stress.sum(-1) + slope.numpy() * HALF_GRID * np.sqrt(len(order) + 1.0)
    assert (q <= strength.numpy() + slack).all()
    on_surface = q >= strength.numpy() - slack
    assert 0.1 < on_surface.mean() < 1.0
    moved = np.abs(np.diff(plastic, axis=1)).max(axis=-1) > STRAIN_GRID
    assert on_surface[:, 1:][moved].all()  # plastic strain grows on the surface only
    # Isochoric flow; each component is off by half a grid.
    trace = plastic[..., :-1].sum(axis=-1)
    assert np.abs(trace).max() <= (len(order) - 1) * HALF_GRID


@pytest.mark.parametrize("name", ["gp-j2-hardening", "gp-ime"])
def test_stress_follows_from_the_elastic_strain(name: str) -> None:
    """sigma = K eps_v + 2 G (e - eps^p), with the recorded internal variables."""
    records = shipped(name)
    cell = ground_truth(records)
    values = cell.values()
    if name == "gp-ime":
        young, poisson = values["young_modulus"], values["poisson_ratio"]
        bulk, shear = young / (3.0 - 6.0 * poisson), young / (2.0 + 2.0 * poisson)
    else:
        bulk, shear = values["bulk_modulus"], values["shear_modulus"]
    strain = series(records, "strain")
    xx, yy, xy = np.moveaxis(strain, -1, 0)
    volumetric = xx + yy
    dimension = cell.dimension
    deviator = np.stack([xx - volumetric / dimension, yy - volumetric / dimension, xy], axis=-1)
    elastic = deviator - plastic_strain(records, "xx", "yy", "xy")
    expected = 2.0 * shear * elastic
    expected[..., :2] += (bulk * volumetric)[..., None]
    stress = series(records, "stress")
    slack = UNIT * np.abs(stress) + 2.0 * shear * HALF_GRID
    assert (np.abs(stress - expected) <= 1.01 * slack).all()


def test_drucker_prager_stays_in_its_cone_and_meets_the_apex_only_unscaled() -> None:
    records = shipped("gp-dp")
    p, q = invariants(records)
    friction = ground_truth(records).values()["friction_slope"]
    slack = 2.0 * UNIT * np.abs(series(records, "stress")).sum(-1)
    assert (q <= friction * p + slack).all()
    assert (q > 0.9999 * friction * p).mean() > 0.4
    held = split_rows(records, *ADMISSIBLE)
    assert p[held].min() >= 0.1 * PRESSURE * (1.0 - UNIT)
    assert p[held].max() <= 50.0 * PRESSURE
    unscaled = split_rows(records, "ood-unscaled")
    at_apex = p[unscaled] == 0.0
    assert at_apex.any(axis=1).mean() > 0.2  # as drawn, many paths lose all strength
    assert (series(records, "stress")[unscaled][at_apex] == 0.0).all()


def test_drucker_prager_dilates_less_than_its_cone_opens() -> None:
    """Non-associated: plastic dilation over shear, -eps_v^p/gamma^p, is M_d on the cone, not M.

    The shear strain conjugate to q is |e|/sqrt 2. Along proportional paths, which never turn, its
    plastic part is the total minus the elastic part, q/4G; eps_v^p follows from p.
    """
    records = shipped("gp-dp")
    records = records.isel(path=split_rows(records, "ood-proportional"))
    values = ground_truth(records).values()
    strain = series(records, "strain")
    p, q = invariants(records)
    volumetric = volumetric_strain(strain, "plane")
    plastic_volume = volumetric - (p - PRESSURE) / values["bulk_modulus"]
    deviator = strain - 0.5 * volumetric[..., None] * np.array([1.0, 1.0, 0.0])
    shear = frobenius_norm(deviator, "plane") / np.sqrt(2.0)
    plastic_shear = shear - q / (4.0 * values["shear_modulus"])
    yielded = plastic_shear[:, -1] > 0.01
    assert yielded.sum() > 20
    ratio = -plastic_volume[yielded, -1] / plastic_shear[yielded, -1]
    # Grid of the strain over a plastic strain of 0.01, and rounding of p over K: some 1e-3.
    np.testing.assert_allclose(ratio, values["dilation_slope"], rtol=5e-3)


def test_csuh_void_ratio_follows_the_volumetric_strain() -> None:
    records = shipped("gp-csuh")
    reference = series(records, "reference_void_ratio")
    volumetric = volumetric_strain(series(records, "strain"), "plane")
    expected = reference - (1.0 + reference) * volumetric
    # Strain and e0 are what the model was given; only e itself was rounded.
    np.testing.assert_allclose(series(records, "void_ratio"), expected, rtol=0.0, atol=STRAIN_GRID)
    for name in ("reference_void_ratio", "initial_yield_pressure"):
        assert np.ptp(records[name].values) == 0.0
    assert (records["initial_yield_pressure"].values == PRESSURE).all()


def test_csuh_stays_in_its_range_of_pressure_inside_its_yield_surface() -> None:
    """f <= 0 (Eq 7.31), up to the rounding of stress and of H, 5e-7/c_p = 9e-6 each."""
    records = shipped("gp-csuh")
    p, q = invariants(records)
    assert p.min() >= 0.1 * PRESSURE * (1.0 - UNIT)
    assert p.max() <= 50.0 * PRESSURE * (1.0 + UNIT)
    values, reference = ground_truth(records).values(), series(records, "reference_void_ratio")
    plastic_slope = values["compression_slope"] - values["swelling_slope"]
    loaded = q > 1.0  # an isotropic stress has no Lode angle
    size, hardening = _surface(records, p, q), series(records, "hardening")
    f = np.log(size / PRESSURE) - hardening * (1.0 + reference) / plastic_slope
    assert f[loaded].max() < 3e-5
    assert (np.abs(f[loaded]) < 3e-5).mean() > 0.5  # loading goes along the surface


def _surface(records: xr.Dataset, p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Size A p of the yield surface through the stress of a clay (chi = 0, N = Z), Pa."""
    values = ground_truth(records).values()
    assert values["critical_spacing"] == 0.0
    assert values["compression_intercept"] == values["low_pressure_intercept"]
    with np.errstate(invalid="ignore"):
        sine = lode_sin3(principal_stress(records))
    critical = 6.0 * values["critical_ratio"] / (7.0 - np.nan_to_num(sine, nan=1.0))  # Eq 7.35
    return p + q**2 / (critical**2 * p)


def test_csuh_is_never_looser_than_its_loosest_state() -> None:
    """Xi = e_eta - e >= 0 (Eq 7.29); the error of the integration of H is about 1e-4."""
    records = shipped("gp-csuh")
    p, q = invariants(records)
    values = ground_truth(records).values()
    slope, swelling = values["compression_slope"], values["swelling_slope"]
    loosest = (
        values["low_pressure_intercept"]
        - slope * np.log(p / 1e3)
        - (slope - swelling) * np.log(_surface(records, p, q) / p)
    )
    xi = loosest - series(records, "void_ratio")
    assert xi.min() > -1e-4
    # At the start that of the overconsolidation ratio, (lambda - kappa) ln 120, within a grid.
    start = (slope - swelling) * np.log(values["overconsolidation_ratio"])
    np.testing.assert_allclose(xi[:, 0], start, atol=STRAIN_GRID)
    assert xi.max() > start  # unloading and dilation at low pressure make it denser than normal
