"""Invariants and principal values of stress and strain, compression positive.

The last axis holds the components, unless a docstring says otherwise. Every function takes NumPy
arrays, torch tensors or xarray's underlying arrays alike, and returns the same kind.
"""

import numpy as np

from granbench.errors import ConfigurationError
from granbench.tensors.components import COMPONENT_ORDERS, PLANE_STRAIN_ROWS, Array


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
