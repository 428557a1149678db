"""The picture of a packing: what is nearer hides what is behind it."""

import numpy as np
import pytest

from granbench.errors import ConfigurationError
from granbench.plotting.packing import _Canvas, _view_axes, _with_images, packing_figure

RED, BLUE = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
BOX = np.array([1.0, 1.0, 1.0])
MIDDLE = np.array([0.5, 0.5, 0.5])
TOWARDS = _view_axes()[2]


def covered(canvas: _Canvas) -> float:
    """Area of the picture that is painted, m2."""
    pixel = (canvas.x[1] - canvas.x[0]) ** 2
    return float(pixel * canvas.image[..., 3].sum())


def pixel_of(canvas: _Canvas, point: np.ndarray) -> np.ndarray:
    x, y, _ = _view_axes() @ point
    return canvas.image[np.searchsorted(canvas.y, y), np.searchsorted(canvas.x, x)]


def test_view_axes_are_orthonormal_and_right_handed() -> None:
    axes = _view_axes()
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[1, 2] > 0.0  # direction 3 points up in the picture


def test_a_sphere_inside_the_box_covers_its_circle() -> None:
    canvas = _Canvas.of_box(BOX, 200)
    canvas.add_sphere(MIDDLE, 0.3, RED)
    # The rim is resolved to a pixel of 1/150 of the edge.
    assert covered(canvas) == pytest.approx(np.pi * 0.3**2, rel=0.02)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_sphere_hides_the_other_whatever_their_order(order: tuple[int, int]) -> None:
    spheres = [(MIDDLE - 0.2 * TOWARDS, RED), (MIDDLE + 0.2 * TOWARDS, BLUE)]
    canvas = _Canvas.of_box(BOX, 100)
    for number in order:
        centre, colour = spheres[number]
        canvas.add_sphere(centre, 0.1, colour)
    seen = pixel_of(canvas, MIDDLE)
    assert seen[2] > 0.2
    assert seen[0] == 0.0


def test_a_sphere_outside_the_box_is_not_drawn() -> None:
    canvas = _Canvas.of_box(BOX, 100)
    canvas.add_sphere(MIDDLE + 2.0 * TOWARDS, 0.3, RED)
    canvas.add_sphere(np.array([0.5, 0.5, 1.31]), 0.3, RED)
    assert covered(canvas) == 0.0


def test_a_sphere_that_holds_the_box_is_cut_to_its_three_faces() -> None:
    canvas = _Canvas.of_box(BOX, 200)
    canvas.add_sphere(MIDDLE, 5.0, RED)
    # A unit cube seen along a unit vector n has the silhouette |n_x| + |n_y| + |n_z|.
    assert covered(canvas) == pytest.approx(np.abs(TOWARDS).sum(), rel=0.02)
    brightness = np.unique(canvas.image[canvas.image[..., 3] > 0.0][:, 0].round(9))
    assert brightness.size == 3


def test_a_grain_at_a_face_appears_at_the_opposite_one_too() -> None:
    centres, radii = _with_images(np.array([[0.5, 0.5, 0.95]]), np.array([0.1]), BOX)
    assert sorted(centres[:, 2]) == pytest.approx([-0.05, 0.95])
    assert radii == pytest.approx([0.1, 0.1])
    corner, _ = _with_images(np.array([[0.02, 0.02, 0.98]]), np.array([0.1]), BOX)
    assert len(corner) == 8


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
