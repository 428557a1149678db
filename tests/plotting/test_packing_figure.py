"""The picture of a packing: what is nearer hides what is behind it."""

import numpy as np
import pytest

from granbench.errors import ConfigurationError
from granbench.plotting.packing import _render, _view_axes, packing_figure

RED, BLUE = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def picture(centres, radii, colours, pixels: int = 60) -> np.ndarray:
    return _render(
        np.array(centres, dtype=float),
        np.array(radii, dtype=float),
        np.array(colours),
        np.array([-1.0, -1.0]),
        np.array([1.0, 1.0]),
        pixels,
    )


def test_view_axes_are_orthonormal_and_right_handed() -> None:
    axes = _view_axes()
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[1, 2] > 0.0  # direction 3 points up in the picture


def test_one_sphere_covers_its_circle() -> None:
    image = picture([[0.0, 0.0, 0.0]], [0.5], [RED])
    # Area pi/16 of the picture; the rim is resolved to a pixel.
    assert image[..., 3].mean() == pytest.approx(np.pi / 16.0, rel=0.03)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_sphere_hides_the_other_whatever_their_order(order: tuple[int, int]) -> None:
    centres = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])[list(order)]
    colours = np.array([RED, BLUE])[list(order)]
    centre_pixel = picture(centres, [0.4, 0.4], colours)[30, 30]
    assert centre_pixel[2] > 0.2
    assert centre_pixel[0] == 0.0


def test_figure_names_the_packing_and_its_sizes() -> None:
    rng = np.random.default_rng(3)
    figure = packing_figure(
        rng.uniform(0.0, 0.1, (40, 3)), rng.uniform(4e-3, 12e-3, 40), (0.1, 0.1, 0.08), pixels=120
    )
    assert figure.axes[0].get_title() == "40 grains, box 100 × 100 × 80 mm"
    assert figure.axes[1].get_ylabel() == "grain diameter $d$ [mm]"


def test_grains_of_one_size_need_no_colour_bar() -> None:
    figure = packing_figure([[0.01, 0.01, 0.01]], [0.01], 0.02, pixels=60)
    assert len(figure.axes) == 1


@pytest.mark.parametrize(
    ("positions", "diameters", "box", "complaint"),
    [
        ([[0.0, 0.0]], [0.1], 1.0, "do not fit"),
        ([[0.0, 0.0, 0.0]], [0.1, 0.1], 1.0, "do not fit"),
        ([[0.0, 0.0, 0.0]], [0.0], 1.0, "positive"),
        ([[0.0, 0.0, 0.0]], [0.1], -1.0, "positive"),
        (np.empty((0, 3)), [], 1.0, "positive"),
    ],
)
def test_an_impossible_packing_is_refused(positions, diameters, box, complaint: str) -> None:
    with pytest.raises(ConfigurationError, match=complaint):
        packing_figure(positions, diameters, box)
