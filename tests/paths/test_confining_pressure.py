"""Random confining pressures are the same whatever a library or processor makes of eigenvectors."""

import numpy as np
import pytest

from granbench.paths.confining_pressure import STEPS, RandomConfinement


@pytest.mark.parametrize("curvature", [0.7, 1.0, 2.0, 3.0, 4.0, 5.0])
def test_a_pressure_does_not_depend_on_the_signs_of_eigenvectors(curvature, monkeypatch):
    """Nothing in the definition of an eigenvector fixes its sign."""
    confinement = RandomConfinement(curvature, seed=2, mean=2e5, deviation=1e4)
    plain = confinement.pressures()[1]
    solve = np.linalg.eigh
    rng = np.random.default_rng(0)

    def turned(kernel):
        values, vectors = solve(kernel)
        return values, vectors * rng.choice([-1.0, 1.0], size=vectors.shape[1])

    monkeypatch.setattr(np.linalg, "eigh", turned)
    for _ in range(5):
        np.testing.assert_allclose(confinement.pressures()[1], plain, rtol=1e-9)


def test_a_pressure_of_the_released_data_is_what_it_was():
    """`biaxial-smooth-monotonic-random-100kpa` of `fem-ime` 1.0.0: its sides carry the pressure."""
    x, pressure = RandomConfinement(4.0, seed=6, mean=1e5, deviation=2e4).pressures()
    assert pressure.shape == (STEPS + 1,) and pressure[0] == 1e5
    places = np.searchsorted(x, [0.25, 0.5, 0.75, 1.0])
    # The recorded lateral stresses, which the damping of the analysis keeps within one per cent.
    recorded = [97190.0, 137174.0, 135850.0, 115235.0]
    np.testing.assert_allclose(pressure[places], recorded, rtol=0.01)
