"""Void ratios and intercepts of CSUH, in Pa.

The source has kPa inside the logarithms; here p and p_s are in Pa and the reference pressure is
1 kPa, compression positive.

References
----------
Yao, Liu, Luo, Tian & Zhang (2019), Computers and Geotechnics 110:326-343; Guan (2023), Sec 7.4.
"""

import math

import torch
from torch import Tensor

from granbench.models.arrays import Array, log

REFERENCE_PRESSURE = 1e3
"""1 kPa, at which Z is read; Pa."""


def inflection_pressure(intercept: Tensor, low_intercept: Tensor, slope: Tensor) -> Tensor:
    """p_s = exp((N - Z)/lambda) - 1 in kPa (Eq 7.30), here in Pa; zero where N is below Z."""
    return REFERENCE_PRESSURE * torch.expm1((intercept - low_intercept).clamp(min=0.0) / slope)


def reference_void_ratio(
    p: Array, surface: Array, intercept: Array, kappa: Array, plastic: Array, p_s: Array
) -> Array:
    """e_eta, the loosest void ratio at a stress (on the line of its eta).

    e_eta = Z - lambda ln((p + p_s)/(1 + p_s)) - (lambda - kappa) ln((A p + p_s)/(p + p_s)), sorted
    by its logarithms.

    Parameters
    ----------
    p : Pa
    surface : A p + p_s, Pa
    intercept : Z + lambda ln(1 kPa + p_s), as of `intercept_in_pascal`
    kappa, plastic : kappa and lambda - kappa
    p_s : Pa
    """
    return intercept - kappa * log(p + p_s) - plastic * log(surface)


def intercept_in_pascal(low_intercept: Tensor, slope: Tensor, p_s: Tensor) -> Tensor:
    """Z + lambda ln(1 kPa + p_s), the intercept of e_eta where pressures are in Pa."""
    return low_intercept + slope * torch.log(REFERENCE_PRESSURE + p_s)


def low_pressure_intercept(intercept: float, loosest: float, slope: float) -> float:
    """Z where a source gives e_c0, critical void ratio at p = 0: p_s = exp((N - e_c0)/lambda)."""
    return intercept - slope * math.log1p(math.exp((intercept - loosest) / slope))
