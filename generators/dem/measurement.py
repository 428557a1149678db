"""Measurements in a box of grains: contacts, coordination number, fabric, inertial number."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granbench.generators.dem.box import GrainBox

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Contacts:
    """The contacts between the grains.

    Parameters
    ----------
    normals : (contact, 3), unit vectors from the second to the first grain
    grain_count : number of grains, rattlers included
    """

    normals: Floats
    grain_count: int

    @property
    def coordination_number(self) -> float:
        """Coordination number Z = 2 N_c / N of all grains."""
        return 2 * len(self.normals) / self.grain_count

    @property
    def fabric(self) -> Floats:
        """Contact fabric Phi = sum(n n) / N_c, (6,), order xx, yy, zz, yz, xz, xy; trace 1."""
        if not len(self.normals):
            return np.zeros(6)
        tensor = self.normals.T @ self.normals / len(self.normals)
        return tensor[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]


def contacts(box: GrainBox) -> Contacts:
    """Return the present contacts, including those across periodic faces."""
    branch = _branches(box)
    length = np.linalg.norm(branch, axis=1, keepdims=True)
    return Contacts(branch / length, box.grain_count)


def _branches(box: GrainBox) -> Floats:
    """Branch vectors from the second to the first grain of every contact, (contact, 3), m."""
    pairs = box.contact_pairs()
    positions = box.engine.positions()
    branch = positions[pairs[:, 0]] - positions[pairs[:, 1]]
    return branch - box.lengths * np.round(branch / box.lengths)


def contact_stress(box: GrainBox) -> Floats:
    """Return the present stress sum(f d) / V over all contacts (Eq 2.5), Pa.

    f is the force on the first grain of a contact and d the branch from the second grain to it. It
    equals the virial of `GrainBox.strain`, and takes much longer to compute.

    Returns
    -------
    stress : (6,), compression positive, order xx, yy, zz, yz, xz, xy
    """
    branches = _branches(box)
    tensor = box.contact_forces().T @ branches / box.volume
    tensor = 0.5 * (tensor + tensor.T)
    return tensor[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]


def inertial_number(rate: float, d50: float, density: float, mean_stress: float) -> float:
    """Return the inertial number I = rate d50 sqrt(rho / p) (Eq 2.6).

    Parameters
    ----------
    rate : of strain, 1/s
    d50 : median diameter by mass, m
    density : of the grains, kg/m3
    mean_stress : Pa
    """
    return rate * d50 * math.sqrt(density / mean_stress)


def rate_at(inertial: float, d50: float, density: float, mean_stress: float) -> float:
    """Return the strain rate, 1/s, at which the inertial number of Eq 2.6 is `inertial`.

    Parameters
    ----------
    inertial : inertial number
    d50, density, mean_stress : as for `inertial_number`
    """
    return inertial / (d50 * math.sqrt(density / mean_stress))
