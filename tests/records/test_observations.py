"""Peak and critical states of recorded tests."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from granbench.errors import DatasetError
from granbench.records.observations import (
    ATMOSPHERIC_PRESSURE,
    CriticalStateLine,
    comparable_compressions,
    critical_states,
    initial_void_ratio_at,
    matsuoka_nakai_ratio,
    peak_stresses,
    principal_stress,
    select,
    strained,
    stress_ratio,
)
from granbench.tensors import deviatoric_stress, intermediate_stress_ratio, mean_stress

RATIOS = st.floats(0.05, 1.6)
B_VALUES = st.floats(0.0, 1.0)


@given(b=B_VALUES, ratio=RATIOS)
def test_principal_stress_has_the_given_invariants(b: float, ratio: float) -> None:
    stress = principal_stress(np.array(b), np.array(ratio))
    assert mean_stress(stress) == pytest.approx(1.0)
    assert deviatoric_stress(stress) == pytest.approx(ratio)
    assert intermediate_stress_ratio(stress) == pytest.approx(b, abs=1e-9)


@given(compression=RATIOS)
def test_matsuoka_nakai_has_the_closed_form_of_extension(compression: float) -> None:
    # One friction angle in compression and extension: M_e = 6 sin(phi) / (3 + sin(phi)).
    sine = 3.0 * compression / (6.0 + compression)
    extension = 6.0 * sine / (3.0 + sine)
    ratio = matsuoka_nakai_ratio(np.array([0.0, 1.0]), compression)
    assert ratio == pytest.approx([compression, extension], rel=1e-9)


@given(b=B_VALUES, compression=RATIOS)
def test_matsuoka_nakai_is_weakest_in_extension_and_strongest_in_compression(
    b: float, compression: float
) -> None:
    low, middle, high = matsuoka_nakai_ratio(np.array([1.0, b, 0.0]), compression)
    assert low - 1e-9 <= middle <= high + 1e-9


def test_critical_state_line_is_recovered_from_its_own_points() -> None:
    line = CriticalStateLine(intercept=0.70, slope=0.02, residual_rms=0.0)
    pressure = np.geomspace(0.05e6, 6e6, 12)
    fitted = CriticalStateLine.fit(pressure, line.void_ratio(pressure))
    assert (fitted.intercept, fitted.slope) == pytest.approx((0.70, 0.02))
    assert fitted.residual_rms == pytest.approx(0.0, abs=1e-12)
    assert line.void_ratio(np.array(ATMOSPHERIC_PRESSURE)) == pytest.approx(0.68)


def test_critical_state_line_needs_two_pressures() -> None:
    with pytest.raises(DatasetError, match="mean stress"):
        CriticalStateLine.fit(np.array([1e6, 1e6]), np.array([0.6, 0.61]))


def test_comparable_compressions_differ_in_density_only(records: xr.Dataset) -> None:
    group = comparable_compressions(records)
    assert group.sizes["path"] >= 2
    assert set(group["loading_family"].values) == {"constant-p"}
    for name in ("grading", "initial_mean_stress", "intermediate_stress_ratio"):
        assert len(set(group[name].values)) == 1
    assert (np.diff(group["initial_void_ratio"].values) >= 0.0).all()


def test_comparable_compressions_are_none_without_constant_p_tests(records: xr.Dataset) -> None:
    assert comparable_compressions(select(records, loading_family="cyclic")).sizes["path"] == 0


def test_peak_is_nowhere_exceeded(records: xr.Dataset) -> None:
    peaks = peak_stresses(records)
    monotonic = select(records, loading_family=("constant-p", "constant-sigma3"))
    ratio = deviatoric_stress(peaks.values) / mean_stress(peaks.values)
    assert ratio == pytest.approx(stress_ratio(monotonic).max(axis=1), rel=1e-6)


def test_critical_states_come_from_fully_strained_monotonic_tests(records: xr.Dataset) -> None:
    states = critical_states(records)
    assert set(states["loading_family"].values) == {"constant-p", "constant-sigma3"}
    assert states.sizes["path"] == strained(records).sizes["path"]
    assert strained(records, axial_strain=0.9).sizes["path"] == 0
    last = strained(records)["void_ratio"].isel(step=-1).values
    # One averaged step in 41: the mean is the last value.
    assert states["void_ratio"].values == pytest.approx(last, abs=5e-3)


def test_initial_void_ratios_of_one_compression_line_agree_at_one_pressure() -> None:
    # Exact for two specimens with different pressures on parallel lines.
    pressure = np.array([0.1e6, 1e6, 2e6, 4e6])
    dense, slope = np.array([0.0, 0.0, 0.2, 0.2]), 0.01
    void_ratio = 0.7 - dense - slope * (pressure / ATMOSPHERIC_PRESSURE) ** 0.7
    records = xr.Dataset(
        coords={
            "specimen": ("path", ["a", "a", "b", "b"]),
            "initial_mean_stress": ("path", pressure),
            "initial_void_ratio": ("path", void_ratio),
        }
    )
    compared = initial_void_ratio_at(records, ATMOSPHERIC_PRESSURE)
    np.testing.assert_allclose(compared, [0.69, 0.69, 0.49, 0.49], rtol=1e-12)


def test_a_single_pressure_leaves_the_initial_void_ratio_as_it_is() -> None:
    records = xr.Dataset(
        coords={
            "specimen": ("path", ["a", "b"]),
            "initial_mean_stress": ("path", [1e6, 1e6]),
            "initial_void_ratio": ("path", [0.5, 0.7]),
        }
    )
    np.testing.assert_array_equal(initial_void_ratio_at(records, 1e6), [0.5, 0.7])
