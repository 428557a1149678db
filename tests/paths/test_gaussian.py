"""Laws of the Gaussian-process strain paths: exact conditioning, the thesis' statistics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from granbench.errors import ConfigurationError
from granbench.paths.gaussian import (
    GaussianStrain,
    conditioned_factor,
    conditioned_process,
    term_count,
)
from granbench.tensors import frobenius_norm

TIME = np.linspace(0.0, 1.0, 201)

PUBLISHED_PATHS, PUBLISHED_POINTS = 201, 200
PUBLISHED = {
    "increment": 1.28e-3,
    "xx": 0.054,
    "yy": 0.056,
    "xy": 0.033,
    "largest": 0.233,
}
"""Figures of the author's published set of paths; the thesis rounds the first to 1.3e-3."""


def kernel(length: float) -> np.ndarray:
    """Eq 6.14 with unit variance, between all pairs of times."""
    return np.exp(-((TIME[:, None] - TIME) ** 2) / (2.0 * length**2))


@pytest.mark.parametrize("length", [0.04, 0.1, 0.25, 0.5, 3.0])
def test_factor_is_one_of_the_conditioned_covariance(length: float) -> None:
    """Phi^T Phi = k(t,t') - k(t,0) k(0,t'), Eq 6.25 without noise.

    The exponents are sums of terms up to (1/l)^2 = 625 that cancel: rounding of some 1e-13.
    """
    factor = conditioned_factor(np.array([length]), TIME, term_count(length))[0]
    k = kernel(length)
    np.testing.assert_allclose(factor.T @ factor, k - np.outer(k[0], k[0]), atol=1e-12)


def test_the_matrix_itself_has_no_cholesky_factor() -> None:
    """Why the paths come from a series: in double precision the covariance is singular."""
    k = kernel(0.25)
    conditioned = k - np.outer(k[0], k[0])
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(conditioned[1:, 1:])


def test_more_terms_change_nothing() -> None:
    rng = np.random.default_rng(0)
    for length in (0.1, 0.5):
        enough = term_count(length)
        normals = rng.standard_normal((1, 1, 2 * enough))
        values = conditioned_process(normals, np.array([length]), TIME)
        fewer = conditioned_process(normals[..., :enough], np.array([length]), TIME)
        # The neglected terms have a variance below 1e-20.
        np.testing.assert_allclose(values, fewer, atol=1e-9)


@given(seed=st.integers(0, 2**31), count=st.integers(1, 5), steps=st.integers(2, 60))
@settings(deadline=None, max_examples=20)
def test_paths_start_at_zero_to_the_last_bit(seed: int, count: int, steps: int) -> None:
    strain = GaussianStrain().draw(np.random.default_rng(seed), count, steps).strain
    assert strain.shape == (count, steps + 1, 3)
    assert (strain[:, 0] == 0.0).all()


def test_a_path_is_the_same_however_finely_it_is_sampled() -> None:
    coarse = GaussianStrain().draw(np.random.default_rng(5), 7, 100).strain
    fine = GaussianStrain().draw(np.random.default_rng(5), 7, 400).strain
    np.testing.assert_allclose(fine[:, ::4], coarse, atol=1e-14)  # rounding of 0.3


def test_a_longer_draw_begins_with_the_shorter_one() -> None:
    few = GaussianStrain().draw(np.random.default_rng(5), 3, 50)
    many = GaussianStrain().draw(np.random.default_rng(5), 40, 50)
    # Blocks of another size sum in another order.
    np.testing.assert_allclose(many.strain[:3], few.strain, atol=1e-14)
    for name, values in few.parameters.items():
        np.testing.assert_array_equal(many.parameters[name][:3], values)


def test_a_seed_gives_the_same_bits() -> None:
    first, second = (GaussianStrain().draw(np.random.default_rng(9), 30, 60) for _ in range(2))
    np.testing.assert_array_equal(first.strain, second.strain)


def test_every_path_has_its_own_parameters_within_their_ranges() -> None:
    drawn = GaussianStrain().draw(np.random.default_rng(0), 500, 4).parameters
    ranges = {
        "strain_deviation": (0.05, 0.09),  # v / 2
        "correlation_length": (0.1, 0.5),
        "rotation_deviation": (0.0, np.pi / 8),  # v_theta / 2
        "initial_angle": (-np.pi, np.pi),
    }
    assert set(drawn) == set(ranges)
    for name, (low, high) in ranges.items():
        values = drawn[name]
        assert low <= values.min() < values.max() <= high
        # The mean of 500 uniform numbers scatters by (high - low) / sqrt(12 * 500).
        assert values.mean() == pytest.approx((low + high) / 2, abs=4 * (high - low) / 77.0)


def test_rotation_keeps_the_principal_strains() -> None:
    """With the same numbers and no rotation of the axes the invariants are the same."""
    turning = GaussianStrain().draw(np.random.default_rng(2), 20, 50).strain
    fixed = GaussianStrain(v_theta=(0.0, 0.0)).draw(np.random.default_rng(2), 20, 50).strain
    np.testing.assert_allclose(turning[..., :2].sum(-1), fixed[..., :2].sum(-1), atol=1e-14)
    np.testing.assert_allclose(
        frobenius_norm(turning, "plane"), frobenius_norm(fixed, "plane"), atol=1e-14
    )
    assert np.abs(turning - fixed).max() > 0.01


def test_variance_at_the_end_is_that_of_the_conditioned_process() -> None:
    """var(eps_1 + eps_2) = 2 s^2 (1 - exp(-1/l^2)) at t = 1, over 4000 paths of one (v, l)."""
    family = GaussianStrain(v=(0.15, 0.15), l=(0.5, 0.5))
    end = family.draw(np.random.default_rng(1), 4000, 2).strain[:, -1]
    expected = 2.0 * 0.075**2 * (1.0 - np.exp(-4.0))
    # A variance of 4000 normal numbers scatters by sqrt(2/4000) = 2.2 %.
    assert (end[:, 0] + end[:, 1]).var() == pytest.approx(expected, rel=0.09)


def test_statistics_are_those_of_the_published_paths() -> None:
    """Each figure of the 201 published paths lies where a random set of 201 of ours would.

    Tolerance: three standard deviations between sets. The published norm of the increment
    counts the shear strain once; with twice, as in the Frobenius norm, ours is 1.35e-3. The
    full v as standard deviation, which the text of the thesis suggests, would be 2 times off.
    """
    rng = np.random.default_rng(0)
    steps = PUBLISHED_POINTS - 1
    strain = GaussianStrain().draw(rng, 10 * PUBLISHED_PATHS, steps).strain
    norms = np.linalg.norm(np.diff(strain, axis=1), axis=-1)

    def figures(rows) -> list[float]:
        components = strain[rows].std(axis=(0, 1))
        return [np.median(norms[rows]), *components, np.abs(strain[rows]).max()]

    sets = rng.integers(len(strain), size=(100, PUBLISHED_PATHS))
    ours = np.array([figures(rows) for rows in sets])
    for name, mean, scatter in zip(PUBLISHED, ours.mean(0), ours.std(0), strict=True):
        assert PUBLISHED[name] == pytest.approx(mean, abs=3.0 * scatter), name
    assert np.median(norms) == pytest.approx(1.3e-3, rel=0.08)
    full = frobenius_norm(np.diff(strain, axis=1), "plane")
    assert np.median(full) == pytest.approx(1.35e-3, rel=0.05)


@pytest.mark.parametrize(
    ("fields", "name"),
    [({"v": (0.2, 0.1)}, "v"), ({"l": (0.0, 0.5)}, "l"), ({"v_theta": (-1.0, 0.0)}, "v_theta")],
)
def test_a_range_that_cannot_be_is_refused(fields: dict, name: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"GaussianStrain\.{name} = .* rising"):
        GaussianStrain(**fields)
