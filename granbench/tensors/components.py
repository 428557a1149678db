"""Component orders of tensors, and components in other axes.

Shear components are tensor components (eps_xy, not gamma_xy).
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from granbench.errors import ConfigurationError

Array = Any  # numpy.ndarray or torch.Tensor: only arithmetic and indexing are used

COMPONENT_ORDERS: dict[str, tuple[str, ...]] = {
    "principal": ("11", "22", "33"),
    "plane": ("xx", "yy", "xy"),
    "full": ("xx", "yy", "zz", "yz", "xz", "xy"),
}
SHEAR_COMPONENTS: tuple[str, ...] = ("23", "13", "12")
"""Off-diagonal components in the axes of a `principal` record."""

PLANE_STRAIN_ROWS: tuple[str, ...] = (*COMPONENT_ORDERS["plane"], "zz")
"""Components of a three-dimensional tensor in plane strain: those of the plane, then zz."""

PRINCIPAL_DIRECTIONS: dict[str, dict[str, str]] = {
    "principal": {"11": "11", "22": "22", "33": "33"},
    "plane": {"11": "yy", "33": "xx"},
    "full": {"11": "yy", "22": "zz", "33": "xx"},
}
"""Directions of a principal loading programme in each order: the axial one is y, which points up,
the minor one is x, and the intermediate one points out of the plane."""


def component_order(components: Iterable[object]) -> str:
    """Name of the order whose labels are `components`.

    Parameters
    ----------
    components : labels, such as the values of a dataset's coordinate `component`

    Raises
    ------
    ConfigurationError
        If no order has these labels.
    """
    given = tuple(map(str, components))
    for name, labels in COMPONENT_ORDERS.items():
        if labels == given:
            return name
    known = "; ".join(f"{name}: {', '.join(labels)}" for name, labels in COMPONENT_ORDERS.items())
    raise ConfigurationError(
        f"components {', '.join(given)} follow no known order; use one of {known}"
    )


def is_normal(label: str) -> bool:
    """Whether a component such as `xx` or `11` is a normal one, not a shear component."""
    return label[0] == label[-1]


def normal_mask(order: str) -> tuple[float, ...]:
    """1 for a normal component of the order, 0 for a shear component."""
    return tuple(float(is_normal(label)) for label in COMPONENT_ORDERS[order])


def contraction_weights(order: str) -> tuple[float, ...]:
    """Number of times that each component occurs in the tensor: 1, or 2 for a shear component.

    These are the weights of a double contraction: a : b = sum of weight a b.
    """
    return tuple(2.0 - normal for normal in normal_mask(order))


def component_rotation(rotation: np.ndarray, order: str) -> np.ndarray:
    """Matrix L that turns components of a tensor: L @ t are those of Q t Q^T.

    Parameters
    ----------
    rotation : Q, orthogonal, (2, 2) in the `plane` order, else (3, 3); reflections are allowed
    order : component order

    Returns
    -------
    (component, component)

    Raises
    ------
    ConfigurationError
        If a `principal` tensor would get shear components: its axes can only be exchanged.
    """
    labels = COMPONENT_ORDERS[order]
    places = [tuple("xyz123".index(letter) % 3 for letter in label) for label in labels]
    if order == "principal" and not np.isin(np.abs(rotation), (0.0, 1.0)).all():
        raise ConfigurationError("principal components can be exchanged, but not turned")
    matrix = np.empty((len(labels), len(labels)))
    for row, (i, j) in enumerate(places):
        for column, (k, m) in enumerate(places):
            entry = rotation[i, k] * rotation[j, m]
            # A shear component is both of its entries.
            matrix[row, column] = entry if k == m else entry + rotation[i, m] * rotation[j, k]
    return matrix


def plane_components(
    first: Array, second: Array, cosine: Array, sine: Array
) -> tuple[Array, Array, Array]:
    """Components xx, yy, xy of a tensor in the plane from its principal values (Eq 6.35).

    Parameters
    ----------
    first, second : (...), principal values
    cosine, sine : (...), of the angle from the x axis to the direction of `first`
    """
    return (
        cosine**2 * first + sine**2 * second,
        sine**2 * first + cosine**2 * second,
        sine * cosine * (first - second),
    )


def full_components(plane: Array, out_of_plane: Array) -> np.ndarray:
    """Components of a tensor in the `full` order from those in the plane and zz.

    Parameters
    ----------
    plane : (..., component), in the `plane` order
    out_of_plane : (...), component zz; yz and xz are zero

    Returns
    -------
    (..., 6)
    """
    known = dict(zip(COMPONENT_ORDERS["plane"], np.moveaxis(plane, -1, 0), strict=True))
    known["zz"] = out_of_plane
    zero = np.zeros_like(out_of_plane)
    return np.stack([known.get(label, zero) for label in COMPONENT_ORDERS["full"]], axis=-1)
