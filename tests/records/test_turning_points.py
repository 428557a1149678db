"""Thinning keeps the reversals of prescribed and of measured series."""

import dataclasses

import numpy as np
import pytest

from granbench.laboratory import LaboratoryTest, to_records
from granbench.records.turning_points import reversals, shown_rows, spread_places, turning_rows


def cyclic(cycles: int, rows_of_leg: int, wave: str = "triangle") -> LaboratoryTest:
    """A drained cyclic test, with hysteresis between strain and q."""
    phase = np.linspace(0.0, 2.0 * np.pi * cycles, 2 * cycles * rows_of_leg + 1)
    waves = {"triangle": 0.5 - np.arcsin(np.cos(phase)) / np.pi, "sine": 0.5 - 0.5 * np.cos(phase)}
    strain = np.zeros((len(phase), 3))
    strain[:, 0] = 0.02 * waves[wave] + 1e-4 * phase
    strain[:, 1:] = -0.2 * strain[:, :1]
    stress = np.full_like(strain, 1e5)
    stress[:, 0] += 8e4 * np.sin(phase - 0.4) + 4e4
    return LaboratoryTest("cyclic", "made here", "triaxial-drained", strain, stress)


@pytest.mark.parametrize("wave", ["triangle", "sine"])
@pytest.mark.parametrize(("cycles", "count"), [(3, 20), (10, 60), (10, 30)])
def test_no_reversal_is_thinned_away(wave: str, cycles: int, count: int) -> None:
    test = cyclic(cycles, 40, wave)
    thin = test.thinned(count)
    for whole, few in zip(
        (test.axial_strain, test.stress[:, 0]), (thin.axial_strain, thin.stress[:, 0]), strict=True
    ):
        size = np.ptp(whole)
        turned = whole[reversals(whole, 0.05 * size)]
        assert len(turned) >= 2 * cycles - 1
        kept = few[reversals(few, 0.05 * size)]
        np.testing.assert_allclose(kept, turned, atol=1e-3 * size)


def test_reversals_that_are_more_than_the_points_are_all_kept() -> None:
    test = cyclic(20, 10)
    thin = test.thinned(12)
    assert thin.steps == test.reversals > 40


def test_a_small_loop_in_a_long_test_is_kept() -> None:
    axial = np.concatenate(
        [np.linspace(0.0, 0.1, 200), [0.0998, 0.0996], np.linspace(0.1, 0.2, 200)]
    )
    rows = turning_rows([(axial, 0.2)], [])
    assert {199, 201} <= set(rows.tolist())


def test_noise_is_no_reversal() -> None:
    smooth = np.linspace(0.0, 1.0, 500) ** 0.5
    noisy = smooth + 2e-3 * np.random.default_rng(1).standard_normal(500)
    assert len(turning_rows([], [(noisy, 1.0)])) < 10
    assert len(turning_rows([], [(smooth, 1.0)])) == 2


def test_records_keep_the_reversals_of_all_tests() -> None:
    test = cyclic(30, 20)
    other = dataclasses.replace(test, name="other")
    records = to_records([test, other], steps=21)
    strain = records["strain"].values[0, :, 0]
    assert len(reversals(strain, 1e-3)) == len(reversals(test.axial_strain, 1e-3))


def test_places_are_even_between_those_that_are_kept() -> None:
    lengths = np.linspace(0.0, 1.0, 101)
    places = spread_places(lengths, np.array([0, 30, 100]), 11)
    assert {0.0, 30.0, 100.0} <= set(places.tolist()) and len(places) == 11
    assert np.diff(places).max() < 11.0


def test_figures_mark_the_peaks_of_a_cyclic_curve() -> None:
    test = cyclic(10, 50)
    rows = shown_rows(test.axial_strain, test.stress[:, 0], 40)
    assert len(rows) < 100
    turned = reversals(test.stress[:, 0], 1e4)
    assert set(turned.tolist()) <= set(rows)
