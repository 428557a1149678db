"""A packing as a person would see it: shaded spheres, cut at the faces of their periodic box."""

import itertools
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from granbench.errors import ConfigurationError
from granbench.plotting.style import figure_grid, house_style

AZIMUTH, ELEVATION = np.radians(35.0), np.radians(24.0)
LIGHT = np.array([-0.10, 0.62, 0.78])
"""Direction to the light in the picture's axes (right, up, to the viewer)."""
AMBIENT = 0.38
RIM = 0.55
"""Brightness of a sphere at its silhouette over that at its middle: it tells one from the next."""

Floats = NDArray[np.float64]


@house_style
def packing_figure(
    positions: ArrayLike, diameters: ArrayLike, box: ArrayLike, *, pixels: int = 900
) -> Figure:
    """Grains as shaded spheres, coloured by diameter, in a parallel projection.

    A grain that reaches through a face of the box is cut there, and its image at the opposite
    face is drawn as well, so the box looks as full as it is.

    Parameters
    ----------
    positions : (grain, 3), m, from 0 to the box edges
    diameters : (grain,), m
    box : (3,) or one edge, m
    pixels : width of the picture

    Raises
    ------
    ConfigurationError
        If the shapes do not fit, or a diameter or box edge is not positive.
    """
    centres = np.asarray(positions, dtype=float)
    radii = 0.5 * np.asarray(diameters, dtype=float)
    edges = np.broadcast_to(np.asarray(box, dtype=float), (3,))
    if centres.ndim != 2 or centres.shape[1] != 3 or radii.shape != centres.shape[:1]:
        raise ConfigurationError(
            f"positions {centres.shape} and diameters {radii.shape} do not fit; give (grain, 3) "
            "and (grain,)"
        )
    if not radii.size or not (radii > 0.0).all() or not (edges > 0.0).all():
        raise ConfigurationError("diameters and box edges must be positive (m); check the packing")
    colours = _diameter_scale(2.0 * radii)
    canvas = _Canvas.of_box(edges, pixels)
    for centre, radius in zip(*_with_images(centres, radii, edges), strict=True):
        canvas.add_sphere(centre, radius, np.asarray(colours.to_rgba(2.0 * radius)[:3]))
    figure, (axis,) = figure_grid(panel=(5.2, 4.6))
    axis.imshow(canvas.image, extent=canvas.extent, origin="lower", interpolation="antialiased")
    _draw_box(axis, edges)
    axis.set_axis_off()
    sides = " × ".join(f"{1e3 * edge:.0f}" for edge in edges)
    axis.set_title(f"{radii.size} grains, box {sides} mm")
    if radii.max() > radii.min() * (1.0 + 1e-6):
        bar = figure.colorbar(colours, ax=axis, shrink=0.7, label="grain diameter $d$ [mm]")
        bar.ax.yaxis.set_major_formatter(lambda metres, _: f"{1e3 * metres:g}")
    return figure


def _view_axes() -> Floats:
    """Rows right, up and towards the viewer in the box's axes; direction 3 of it points up."""
    level = np.cos(ELEVATION)
    towards = np.array([level * np.sin(AZIMUTH), -level * np.cos(AZIMUTH), np.sin(ELEVATION)])
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def _corners(edges: Floats) -> Floats:
    """The box's corners in view axes, (8, 3); bit k of the row tells the side in direction k."""
    sides = np.array(list(itertools.product((0.0, 1.0), repeat=3)))[:, ::-1]
    return (sides * edges) @ _view_axes().T


def _diameter_scale(diameters: Floats) -> mpl.cm.ScalarMappable:
    low, high = float(diameters.min()), float(diameters.max())
    if high <= low * (1.0 + 1e-6):
        low, high = 0.0, 1.1 * high
    return mpl.cm.ScalarMappable(Normalize(low, high), mpl.colormaps["cividis"])


def _with_images(centres: Floats, radii: Floats, edges: Floats) -> tuple[Floats, Floats]:
    """The grains and those of their periodic images that reach into the box."""
    shifts = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3))) * edges
    images = centres + shifts[:, None, :]
    reach = radii[None, :, None]
    inside = ((images > -reach) & (images < edges + reach)).all(axis=-1)
    return images[inside], np.broadcast_to(radii, inside.shape)[inside]


@dataclass
class _Canvas:
    """A picture with a depth for each pixel, through which the box is seen along parallel rays.

    Parameters
    ----------
    x, y : (column,), (row,), m, of the pixels' centres in view axes
    entry, exit : (row, column), m, depth (towards the viewer) at which a ray enters and leaves
        the box; entry < exit where it misses
    face : (row, column), brightness of the face by which it enters
    """

    x: Floats
    y: Floats
    entry: Floats
    exit: Floats
    face: Floats

    def __post_init__(self) -> None:
        self.image = np.zeros((self.y.size, self.x.size, 4))
        self.depth = np.full(self.entry.shape, -np.inf)

    @classmethod
    def of_box(cls, edges: Floats, pixels: int) -> "_Canvas":
        """An empty canvas that the box fills."""
        corners = _corners(edges)[:, :2]
        low, high = corners.min(axis=0), corners.max(axis=0)
        size = (high[0] - low[0]) / pixels
        x = low[0] + size * (np.arange(pixels) + 0.5)
        y = low[1] + size * (np.arange(int(np.ceil((high[1] - low[1]) / size))) + 0.5)
        right, up, towards = _view_axes()
        # A point of the ray at depth z is x right + y up + z towards.
        base = x[None, :, None] * right + y[:, None, None] * up
        bounds = np.sort(np.stack([-base / towards, (edges - base) / towards]), axis=0)
        normals = _view_axes().T * np.sign(towards)[:, None]
        brightness = AMBIENT + (1.0 - AMBIENT) * np.maximum(0.0, normals @ _light())
        face = brightness[bounds[1].argmin(axis=-1)]
        return cls(x, y, bounds[1].min(axis=-1), bounds[0].max(axis=-1), face)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the picture, m."""
        half = 0.5 * (self.x[1] - self.x[0])
        return (self.x[0] - half, self.x[-1] + half, self.y[0] - half, self.y[-1] + half)

    def add_sphere(self, centre: Floats, radius: float, colour: Floats) -> None:
        """Paint the part of a sphere that lies in the box and in front of what is there.

        Parameters
        ----------
        centre : (3,), m, in the box's axes
        radius : m
        colour : (3,), red, green, blue
        """
        x0, y0, z0 = _view_axes() @ centre
        columns = slice(*np.searchsorted(self.x, (x0 - radius, x0 + radius)))
        rows = slice(*np.searchsorted(self.y, (y0 - radius, y0 + radius)))
        patch = (rows, columns)
        x = (self.x[columns] - x0)[None, :] / radius
        y = (self.y[rows] - y0)[:, None] / radius
        squared = x**2 + y**2
        z = np.sqrt(np.maximum(0.0, 1.0 - squared))
        front, back = z0 + radius * z, z0 - radius * z
        depth = np.minimum(front, self.entry[patch])
        seen = (squared < 1.0) & (depth > np.maximum(back, self.exit[patch]))
        seen &= depth > self.depth[patch]
        light = _light()
        lambert = np.maximum(0.0, x * light[0] + y * light[1] + z * light[2])
        round_part = (AMBIENT + (1.0 - AMBIENT) * lambert) * (RIM + (1.0 - RIM) * np.sqrt(z))
        brightness = np.where(front > self.entry[patch], self.face[patch], round_part)
        painted = np.clip(brightness[seen][:, None] * colour, 0.0, 1.0)
        self.image[patch][seen] = np.concatenate([painted, np.ones((len(painted), 1))], axis=1)
        self.depth[patch] = np.where(seen, depth, self.depth[patch])


def _light() -> Floats:
    return LIGHT / np.linalg.norm(LIGHT)


def _draw_box(axis: Axes, edges: Floats) -> None:
    """The edges that the viewer sees: those that do not meet in the farthest corner."""
    corners = _corners(edges)
    farthest = int(corners[:, 2].argmin())
    for one, other in itertools.combinations(range(8), 2):
        if (one ^ other).bit_count() == 1 and farthest not in (one, other):
            axis.plot(*corners[[one, other], :2].T, color="0.25", linewidth=0.8)
