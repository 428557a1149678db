"""Component orders, invariants and signs; no other module states them.

Stress and strain are compression positive and the last axis holds the components; shear
components are tensor components (eps_xy, not gamma_xy). Every function takes NumPy arrays,
torch tensors or xarray's underlying arrays alike, and returns the same kind.
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


def _diagonal_and_shear(tensor: Array, order: str) -> tuple[list[Array], list[Array]]:
    if order == "principal":
        return [tensor[..., i] for i in range(3)], []
    if order == "plane":
        return [tensor[..., 0], tensor[..., 1]], [tensor[..., 2]]
    if order == "full":
        return [tensor[..., i] for i in range(3)], [tensor[..., i] for i in range(3, 6)]
    raise ConfigurationError(
        f"unknown component order {order!r}; use {', '.join(COMPONENT_ORDERS)}"
    )


def mean_stress(stress: Array, order: str = "principal") -> Array:
    """Mean stress p: tr(sigma)/3, or tr(sigma)/2 in the `plane` order (the thesis' 6.6.2).

    Parameters
    ----------
    stress : (..., component), Pa, compression positive
    order : component order of the last axis

    Returns
    -------
    (...), Pa
    """
    diagonal, _ = _diagonal_and_shear(stress, order)
    return sum(diagonal) / len(diagonal)


def deviatoric_stress(stress: Array, order: str = "principal") -> Array:
    """Deviatoric stress q: sqrt(3/2 s:s), or sqrt(2 s:s) in the `plane` order (Eq 6.29).

    Parameters
    ----------
    stress : (..., component), Pa, compression positive
    order : component order of the last axis

    Returns
    -------
    (...), Pa, never negative
    """
    diagonal, shear = _diagonal_and_shear(stress, order)
    mean = sum(diagonal) / len(diagonal)
    squares = sum((component - mean) ** 2 for component in diagonal)
    squares = squares + sum(2.0 * component**2 for component in shear)
    return (1.5 * squares if len(diagonal) == 3 else 2.0 * squares) ** 0.5


def volumetric_strain(strain: Array, order: str = "principal") -> Array:
    """Volumetric strain: the trace, compression positive.

    Parameters
    ----------
    strain : (..., component), dimensionless
    order : component order of the last axis

    Returns
    -------
    (...), dimensionless
    """
    diagonal, _ = _diagonal_and_shear(strain, order)
    return sum(diagonal)


def frobenius_norm(tensor: Array, order: str = "principal") -> Array:
    """Frobenius norm sqrt(t:t), in which a shear component counts twice.

    Parameters
    ----------
    tensor : (..., component), any unit
    order : component order of the last axis

    Returns
    -------
    (...), in the same unit
    """
    diagonal, shear = _diagonal_and_shear(tensor, order)
    squares = sum(component**2 for component in diagonal)
    return (squares + sum(2.0 * component**2 for component in shear)) ** 0.5


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


def cofactor_rows(rows: Array) -> list[Array]:
    """Derivative of the determinant of a symmetric tensor with respect to each component.

    Parameters
    ----------
    rows : (component, ...), in the `principal` or `full` order or as `PLANE_STRAIN_ROWS`

    Returns
    -------
    One (...) for each component; that of a shear component is with respect to one of its two
    entries
    """
    if len(rows) == len(COMPONENT_ORDERS["principal"]):
        x, y, z = rows
        return [y * z, z * x, x * y]
    if len(rows) == len(PLANE_STRAIN_ROWS):
        x, y, xy, z = rows
        return [y * z, x * z, -xy * z, x * y - xy * xy]
    x, y, z, yz, xz, xy = rows
    return [
        y * z - yz * yz,
        x * z - xz * xz,
        x * y - xy * xy,
        xz * xy - x * yz,
        yz * xy - y * xz,
        yz * xz - z * xy,
    ]


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


def principal_difference(tensor: np.ndarray) -> np.ndarray:
    """Difference (...) of the principal values in the plane of a tensor (..., component).

    Parameters
    ----------
    tensor : in the `plane` order, any unit
    """
    xx, yy, xy = np.moveaxis(tensor, -1, 0)
    return np.asarray(np.hypot(xx - yy, 2.0 * xy))


def least_principal(stress: np.ndarray, order: str = "principal") -> np.ndarray:
    """Least principal stress (...) of a stress (..., component); in the plane, of the two there.

    Parameters
    ----------
    stress : Pa, compression positive
    order : key of `COMPONENT_ORDERS`
    """
    if order == "principal":
        return stress.min(axis=-1)
    if order == "plane":
        xx, yy, xy = np.moveaxis(stress, -1, 0)
        return 0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy)
    xx, yy, zz, yz, xz, xy = np.moveaxis(stress, -1, 0)
    rows = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    matrices = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    return np.linalg.eigvalsh(matrices)[..., 0]


def intermediate_stress_ratio(stress: Array) -> Array:
    """b = (sigma_22 - sigma_33)/(sigma_11 - sigma_33) of a `principal` stress.

    The three directions keep their roles (axial, intermediate, minor) along a record, so b is
    read from the axes and not from sorted values; it is undefined (NaN) at isotropic stress.

    Parameters
    ----------
    stress : (..., 3), Pa

    Returns
    -------
    (...), dimensionless
    """
    return (stress[..., 1] - stress[..., 2]) / (stress[..., 0] - stress[..., 2])


def lode_sin3(stress: Array) -> Array:
    """sin(3 theta) of a `principal` stress: +1 in triaxial compression, -1 in extension.

    sin(3 theta) = 27/2 det(s)/q^3 with compression positive; undefined (NaN) at q = 0.

    Parameters
    ----------
    stress : (..., 3), Pa

    Returns
    -------
    (...), in [-1, 1]
    """
    mean = mean_stress(stress)
    determinant = (stress[..., 0] - mean) * (stress[..., 1] - mean) * (stress[..., 2] - mean)
    return 13.5 * determinant / deviatoric_stress(stress) ** 3


def pi_plane(stress: Array) -> tuple[Array, Array]:
    """Coordinates of a `principal` stress in the deviatoric (pi) plane.

    The sigma_1 axis points up; the distance from the origin is sqrt(2/3) q.

    Parameters
    ----------
    stress : (..., 3), Pa

    Returns
    -------
    (x, y), each (...), Pa
    """
    x = (stress[..., 1] - stress[..., 2]) / 2.0**0.5
    y = (2.0 * stress[..., 0] - stress[..., 1] - stress[..., 2]) / 6.0**0.5
    return x, y
