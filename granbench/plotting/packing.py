"""A packing as a person would see it: shaded spheres in their periodic box."""

import itertools

import matplotlib as mpl
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from granbench.errors import ConfigurationError
from granbench.plotting.style import figure_grid, house_style

AZIMUTH, ELEVATION = np.radians(35.0), np.radians(24.0)
LIGHT = np.array([-0.45, 0.60, 0.66])
"""Direction to the light in the picture's axes (right, up, to the viewer)."""
AMBIENT = 0.30
RIM = 0.55
"""Brightness of a sphere at its silhouette over that at its middle: it tells one from the next."""


@house_style
def packing_figure(
    positions: ArrayLike, diameters: ArrayLike, box: ArrayLike, *, pixels: int = 900
) -> Figure:
    """Grains as shaded spheres, coloured by diameter, in a parallel projection.

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
    frame = _view_axes()
    corners = np.array(list(itertools.product(*((0.0, edge) for edge in edges)))) @ frame.T
    margin = radii.max()
    low, high = corners[:, :2].min(axis=0) - margin, corners[:, :2].max(axis=0) + margin
    colours = _diameter_scale(2.0 * radii)
    image = _render(
        centres @ frame.T, radii, colours.to_rgba(2.0 * radii)[:, :3], low, high, pixels
    )
    figure, (axis,) = figure_grid(panel=(5.2, 4.6))
    extent = (low[0], high[0], low[1], high[1])
    axis.imshow(image, extent=extent, origin="lower", interpolation="antialiased")
    _draw_box(axis, corners)
    axis.set_axis_off()
    axis.set_title(
        f"{radii.size} grains, box {' × '.join(f'{1e3 * edge:.0f}' for edge in edges)} mm"
    )
    if radii.max() > radii.min() * (1.0 + 1e-6):
        bar = figure.colorbar(colours, ax=axis, shrink=0.7, label="grain diameter $d$ [mm]")
        bar.ax.yaxis.set_major_formatter(lambda metres, _: f"{1e3 * metres:g}")
    return figure


def _view_axes() -> NDArray[np.float64]:
    """Rows right, up and towards the viewer in the box's axes; direction 3 of it points up."""
    towards = np.array(
        [
            np.cos(ELEVATION) * np.sin(AZIMUTH),
            -np.cos(ELEVATION) * np.cos(AZIMUTH),
            np.sin(ELEVATION),
        ]
    )
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def _diameter_scale(diameters: NDArray) -> mpl.cm.ScalarMappable:
    low, high = float(diameters.min()), float(diameters.max())
    if high <= low * (1.0 + 1e-6):
        low, high = 0.0, 1.1 * high
    return mpl.cm.ScalarMappable(Normalize(low, high), mpl.colormaps["cividis"])


def _render(
    centres: NDArray,
    radii: NDArray,
    colours: NDArray,
    low: NDArray,
    high: NDArray,
    pixels: int,
) -> NDArray[np.float64]:
    """Picture (row, column, rgba) of spheres in view axes, nearest surface first.

    A depth buffer settles what hides what, so touching spheres meet in their true curve. The
    loop over grains writes into overlapping patches of that buffer: it is sequential by nature.
    """
    scale = pixels / (high[0] - low[0])
    rows = int(np.ceil((high[1] - low[1]) * scale))
    image = np.zeros((rows, pixels, 4))
    depth = np.full((rows, pixels), -np.inf)
    light = LIGHT / np.linalg.norm(LIGHT)
    for centre, radius, colour in zip(centres, radii, colours, strict=True):
        first = np.maximum(np.floor((centre[:2] - radius - low) * scale).astype(int), 0)
        last = np.ceil((centre[:2] + radius - low) * scale).astype(int) + 1
        patch = (slice(first[1], last[1]), slice(first[0], last[0]))
        height, width = depth[patch].shape
        x = ((np.arange(width) + first[0] + 0.5) / scale + low[0] - centre[0]) / radius
        y = ((np.arange(height) + first[1] + 0.5) / scale + low[1] - centre[1]) / radius
        squared = x[None, :] ** 2 + y[:, None] ** 2
        z = np.sqrt(np.maximum(0.0, 1.0 - squared))
        seen = (squared < 1.0) & (centre[2] + radius * z > depth[patch])
        lambert = np.maximum(0.0, x[None, :] * light[0] + y[:, None] * light[1] + z * light[2])
        brightness = (AMBIENT + (1.0 - AMBIENT) * lambert) * (RIM + (1.0 - RIM) * np.sqrt(z))
        depth[patch] = np.where(seen, centre[2] + radius * z, depth[patch])
        shaded = np.concatenate(
            [colour * brightness[..., None], np.ones((height, width, 1))], axis=-1
        )
        image[patch] = np.where(seen[..., None], shaded, image[patch])
    return np.clip(image, 0.0, 1.0)


def _draw_box(axis: mpl.axes.Axes, corners: NDArray) -> None:
    """Edges of the box; those that meet in the farthest corner lie behind the grains, dashed."""
    farthest = int(corners[:, 2].argmin())
    for one, other in itertools.combinations(range(8), 2):
        if (one ^ other).bit_count() == 1:
            hidden = farthest in (one, other)
            axis.plot(
                *corners[[one, other], :2].T,
                color="0.3",
                linewidth=0.8,
                linestyle=":" if hidden else "-",
            )
