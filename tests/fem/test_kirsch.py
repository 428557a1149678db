"""The elastic plate with a hole (Kirsch 1898): stresses converge, and three-fold at the hole."""

import numpy as np
from plane_bodies import LAME, SHEAR, Body, elastic_cell

from granbench.fem import ImplicitSettings, run
from granbench.fem.loading import Loading, LoadingHistory, Prescribed
from granbench.fem.problems.perforated_plate import RADIUS, quarter_plate

PULL = 1e3
POISSON = 0.5 * LAME / (LAME + SHEAR)
BULGE = 3.0 - 4.0 * POISSON


def displacement(nodes: np.ndarray) -> np.ndarray:
    """(node, direction) of an infinite plate under a tension `PULL` along x, in plane strain."""
    r = np.hypot(*nodes.T)
    cosine, sine = (nodes / r[:, None]).T
    cosine_3, sine_3 = 4.0 * cosine**3 - 3.0 * cosine, 3.0 * sine - 4.0 * sine**3
    far, near = r / RADIUS, RADIUS / r
    x = far * (BULGE + 1.0) * cosine + 2.0 * near * ((1.0 + BULGE) * cosine + cosine_3)
    y = far * (BULGE - 3.0) * sine + 2.0 * near * ((1.0 - BULGE) * sine + sine_3)
    x, y = x - 2.0 * near**3 * cosine_3, y - 2.0 * near**3 * sine_3
    return PULL * RADIUS / (8.0 * SHEAR) * np.column_stack([x, y])


def stress(points: np.ndarray) -> np.ndarray:
    """(point, component), compression positive."""
    angle = np.arctan2(points[:, 1], points[:, 0])
    near = (RADIUS / np.hypot(*points.T)) ** 2
    c2, c4, s2, s4 = np.cos(2 * angle), np.cos(4 * angle), np.sin(2 * angle), np.sin(4 * angle)
    xx = 1.0 - near * (1.5 * c2 + c4) + 1.5 * near**2 * c4
    yy = -near * (0.5 * c2 - c4) - 1.5 * near**2 * c4
    xy = -near * (0.5 * s2 + s4) + 1.5 * near**2 * s4
    return -PULL * np.column_stack([xx, yy, xy])


def error(cells: int) -> float:
    """L2 error of the stress relative to its size."""
    outside = {"x": lambda n: displacement(n)[:, 0], "y": lambda n: displacement(n)[:, 1]}
    supports = (
        Prescribed("right", **outside),
        Prescribed("top", **outside),
        Prescribed("left", x=0.0),
        Prescribed("bottom", y=0.0),
    )
    problem = Body(Loading(supports, LoadingHistory((0.0, 1.0), (0.0, 1.0))))
    mesh = quarter_plate(cells, cells)
    settings = ImplicitSettings(steps=1, tolerance=1e-10)
    found = run(problem, elastic_cell(), solver=settings, mesh=mesh).check()
    exact = stress(found["point_position"].values)
    volume = found["point_volume"].values[:, None]
    missed = volume * (found["stress"].values[-1] - exact) ** 2
    return float(np.sqrt(missed.sum() / (volume * exact**2).sum()))


def test_stress_converges_with_the_square_of_the_cells() -> None:
    """Also the polygon that stands for the hole comes closer with the square of its sides."""
    errors = np.array([error(cells) for cells in (8, 16, 32)])
    rates = np.log2(errors[:-1] / errors[1:])
    assert errors[-1] < 2e-3
    assert rates.min() > 1.7, (errors, rates)


def test_stress_at_the_hole_is_three_times_the_pull() -> None:
    """The closed form itself, at the side of the hole; it keeps the test of convergence honest."""
    side = stress(np.array([[0.0, RADIUS]]))
    np.testing.assert_allclose(side, [[-3.0 * PULL, 0.0, 0.0]], atol=1e-9 * PULL)
    far = stress(np.array([[1e4, 1e4]]))
    np.testing.assert_allclose(far, [[-PULL, 0.0, 0.0]], atol=1e-6 * PULL)
