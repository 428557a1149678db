"""Laws of the drawn strain paths: the grid, straight paths, cycles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from granbench.errors import ConfigurationError
from granbench.paths.drawn import STRAIN_GRID, directions, on_strain_grid
from granbench.paths.gaussian import GaussianStrain
from granbench.paths.proportional import ProportionalStrain
from granbench.paths.strain_cycles import StrainCycles, unit_cycles
from granbench.tensors import frobenius_norm

FAMILIES = (GaussianStrain(), ProportionalStrain(), StrainCycles())
TIME = np.linspace(0.0, 1.0, 2001)


@given(arrays(float, 40, elements=st.floats(-0.49, 0.49)))
def test_single_precision_keeps_strains_on_the_grid_and_their_differences(strain) -> None:
    gridded = on_strain_grid(strain)
    assert np.abs(gridded - strain).max() <= STRAIN_GRID / 2.0
    single = gridded.astype(np.float32)
    np.testing.assert_array_equal(single.astype(float), gridded)
    np.testing.assert_array_equal(np.diff(single).astype(float), np.diff(gridded))


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.loading_family)
def test_every_family_starts_at_zero_and_repeats_itself(family) -> None:
    one, again = (family.draw(np.random.default_rng(3), 25, 40) for _ in range(2))
    assert one.strain.shape == (25, 41, 3)
    assert (one.strain[:, 0] == 0.0).all()
    np.testing.assert_array_equal(one.strain, again.strain)
    assert all(values.shape == (25,) for values in one.parameters.values())
    fewer = family.draw(np.random.default_rng(3), 4, 40)
    np.testing.assert_allclose(one.strain[:4], fewer.strain, atol=1e-14)
    assert type(family).model_validate(family.model_dump(mode="json")) == family


def test_directions_are_unit_and_uniform() -> None:
    """Over 20,000 directions in (xx, yy, sqrt 2 xy) the covariance is a third of unity."""
    drawn = directions(np.random.default_rng(0), 20_000)
    np.testing.assert_allclose(frobenius_norm(drawn, "plane"), 1.0, rtol=1e-12)
    euclidean = drawn * np.array([1.0, 1.0, np.sqrt(2.0)])
    # Sampling error of a second moment: below 1 / sqrt(20000) = 0.7 %.
    np.testing.assert_allclose(euclidean.T @ euclidean / 20_000, np.eye(3) / 3.0, atol=0.01)


def test_proportional_paths_are_straight_and_end_at_their_amplitude() -> None:
    drawn = ProportionalStrain().draw(np.random.default_rng(0), 50, 20)
    end = drawn.strain[:, -1:]
    np.testing.assert_allclose(drawn.strain, np.linspace(0, 1, 21)[:, None] * end, atol=1e-15)
    np.testing.assert_allclose(
        frobenius_norm(end[:, 0], "plane"), drawn.parameters["strain_amplitude"], rtol=1e-12
    )


@given(ratio=st.floats(-1.0, 0.9), cycles=st.integers(1, 6))
def test_cycles_turn_between_their_ratio_and_one(ratio: float, cycles: int) -> None:
    """One loading and 2 n legs of length 1 - R: the path's length, bounds, ends and turns."""
    course = unit_cycles(np.array([ratio]), np.array([float(cycles)]), TIME)[0]
    length = 1.0 + 2.0 * cycles * (1.0 - ratio)
    increment = length / (TIME.size - 1)
    assert course[0] == 0.0
    assert course[-1] == pytest.approx(1.0, abs=1e-12)
    assert course.max() <= 1.0 + 1e-12
    assert course.min() >= min(ratio, 0.0) - 1e-12
    # A turning point between two samples is missed by less than an increment.
    assert course.min() <= min(ratio, 0.0) + increment
    steps = np.diff(course)
    assert np.abs(steps).max() <= increment * (1.0 + 1e-9)
    signs = np.sign(steps[np.abs(steps) > 0.5 * increment])
    assert (np.diff(signs) != 0).sum() == 2 * cycles


def test_cyclic_paths_stay_on_their_line() -> None:
    drawn = StrainCycles().draw(np.random.default_rng(1), 60, 200)
    peak = np.argmax(frobenius_norm(drawn.strain, "plane"), axis=1)
    direction = drawn.strain[np.arange(60), peak]
    direction /= frobenius_norm(direction, "plane")[:, None]
    weight = np.array([1.0, 1.0, 2.0])
    along = (drawn.strain * weight * direction[:, None]).sum(-1)
    np.testing.assert_allclose(along[..., None] * direction[:, None], drawn.strain, atol=1e-15)
    assert set(drawn.parameters["strain_cycles"]) == {2.0, 3.0, 4.0, 5.0}


@pytest.mark.parametrize(
    ("family", "fields"),
    [
        (ProportionalStrain, {"amplitude": (0.2, 0.1)}),
        (StrainCycles, {"ratio": (-2.0, 0.0)}),
        (StrainCycles, {"ratio": (0.0, 1.0)}),
        (StrainCycles, {"cycles": (0, 3)}),
    ],
)
def test_a_range_that_cannot_be_is_refused(family: type, fields: dict) -> None:
    (name,) = fields
    with pytest.raises(ConfigurationError, match=rf"{family.__name__}\.{name} = "):
        family(**fields)
