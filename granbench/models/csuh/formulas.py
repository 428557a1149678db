r"""The formula set of CSUH, without any integration.

p and p_s in Pa, compression positive; the reference pressure is 1 kPa; eta = q/p. Squares are
passed where only squares occur. The published forms and the ones here are identical, but these
stay regular at xi = 0, at eta = M_c and at eta = 0.

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


def critical_ratio(compression: Tensor, lode_sin3: Tensor) -> Tensor:
    """M = 18 M_com/(18 + 3 (1 - sin 3 theta)) (Eq 7.35): M_com at +1, 3/4 of it at -1."""
    return 6.0 * compression / (7.0 - lode_sin3)


def surface_factor(eta2: Tensor, critical2: Tensor, spacing: Tensor) -> Tensor:
    """A(eta) = 1 + (1 + chi) eta^2/(M^2 - chi eta^2) = (M^2 + eta^2)/(M^2 - chi eta^2).

    Yield surfaces are A p = const (Eq 7.31 with its missing brackets).
    """
    return (critical2 + eta2) / (critical2 - spacing * eta2)


def yield_numerator(eta2: Tensor, critical2: Tensor, spacing: Tensor) -> Tensor:
    """df/dp times `yield_denominator`: M^4 - (1 + 3 chi) M^2 eta^2 - chi eta^4."""
    return critical2 * (critical2 - (1.0 + 3.0 * spacing) * eta2) - spacing * eta2 * eta2


def yield_denominator(
    p: Tensor, eta2: Tensor, critical2: Tensor, spacing: Tensor, p_s: Tensor
) -> Tensor:
    """D = p (M^2 - chi eta^2)(M^2 + eta^2 + (M^2 - chi eta^2) p_s/p), without dividing by p."""
    cone = critical2 - spacing * eta2
    return cone * ((critical2 + eta2) * p + cone * p_s)


def yield_gradient(
    p: Tensor, eta: Tensor, critical: Tensor, spacing: Tensor, p_s: Tensor
) -> tuple[Tensor, Tensor]:
    """df/dp and df/dq, 1/Pa, at a fixed M."""
    eta2, critical2 = eta * eta, critical * critical
    denominator = yield_denominator(p, eta2, critical2, spacing, p_s)
    df_dq = 2.0 * critical2 * (1.0 + spacing) * eta
    return yield_numerator(eta2, critical2, spacing) / denominator, df_dq / denominator


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


def failure_ratio(critical: Tensor, overconsolidation: Tensor) -> Tensor:
    """M_f = 6/(1 + sqrt(1 + 12 (3 - M) R/M^2)) (Eq 7.28), with R = exp(-xi/(lambda - kappa)).

    M_f = M where R = 1, above M in a dense state, below 3 always.
    """
    inner = 12.0 * (3.0 - critical) * overconsolidation / (critical * critical)
    return 6.0 / (1.0 + torch.sqrt(1.0 + inner))


def characteristic_square(critical2: Tensor, dilatancy: Tensor, looseness: Tensor) -> Tensor:
    """M_c^2 of M_c = M exp(-m xi) (Eq 7.28); `looseness` is -xi = e - e_eta."""
    return critical2 * torch.exp(2.0 * dilatancy * looseness)


def critical_void_ratio(
    p: Tensor, spacing: Tensor, intercept: Tensor, kappa: Tensor, plastic: Tensor, p_s: Tensor
) -> Tensor:
    """e_cs(p): e_eta at eta = M, where A = 2/(1 - chi)."""
    return reference_void_ratio(p, 2.0 * p / (1.0 - spacing) + p_s, intercept, kappa, plastic, p_s)


def low_pressure_intercept(intercept: float, loosest: float, slope: float) -> float:
    """Z where a source gives e_c0, critical void ratio at p = 0: p_s = exp((N - e_c0)/lambda)."""
    return intercept - slope * math.log1p(math.exp((intercept - loosest) / slope))
