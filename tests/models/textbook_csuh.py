"""CSUH as a textbook has it, to check the cell against: principal axes, kPa, NumPy, tiny steps.

Every formula is the published one. Gradients are taken by the complex step, exact to rounding, so
that no derivative is written down here; plastic strain is integrated with the classical
Runge-Kutta method of order four, in all three principal directions, H along with it.
"""

import math
from dataclasses import dataclass

import numpy as np

IMAGINARY = 1e-40


def critical_ratio(compression, sin3):
    """M = 18 M_com/(18 + 3 (1 - sin 3 theta)) (Eq 7.35)."""
    return 18.0 * compression / (18.0 + 3.0 * (1.0 - sin3))


def surface_factor(eta, critical, spacing):
    """A = 1 + (1 + chi) eta^2/(M^2 - chi eta^2) (Eq 7.31 with its missing brackets)."""
    return 1.0 + (1.0 + spacing) * eta**2 / (critical**2 - spacing * eta**2)


def invariants(stress: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """p, q and sin(3 theta) of principal stresses (3, point), which may be complex."""
    p = stress.sum(axis=0) / 3.0
    s = stress - p
    square = 1.5 * (s * s).sum(axis=0)
    q = np.sqrt(np.where(square == 0.0, 1e-300, square))
    cube = np.where(square == 0.0, 1.0, q**3)
    return p, q, np.where(square == 0.0, 1.0, 13.5 * s[0] * s[1] * s[2] / cube)


def gradient(function, stress: np.ndarray) -> np.ndarray:
    """Gradient of a function of principal stresses (3, point), by the complex step."""
    rows = []
    for k in range(3):
        shifted = stress.astype(complex)
        shifted[k] += 1j * IMAGINARY
        rows.append(function(shifted).imag / IMAGINARY)
    return np.array(rows)


@dataclass(frozen=True)
class Textbook:
    """Points of one material.

    Parameters
    ----------
    M, slope, swelling, nu, intercept, low, chi, m : M_com, lambda, kappa, nu, N, Z, chi, m
    e0 : (point,)
    size : p_x0 of each point, (point,), kPa
    """

    M: float
    slope: float
    swelling: float
    nu: float
    intercept: float
    low: float
    chi: float
    m: float
    e0: np.ndarray
    size: np.ndarray

    @property
    def p_s(self) -> float:
        return math.exp((self.intercept - self.low) / self.slope) - 1.0

    @property
    def c_p(self) -> np.ndarray:
        return (self.slope - self.swelling) / (1.0 + self.e0)

    def critical(self, sin3: np.ndarray) -> np.ndarray:
        """Eq 7.35."""
        return 18.0 * self.M / (18.0 + 3.0 * (1.0 - sin3))

    def surface(self, stress: np.ndarray) -> np.ndarray:
        """A p."""
        p, q, sin3 = invariants(stress)
        eta, M = q / p, self.critical(sin3)
        return p * (1.0 + (1.0 + self.chi) * eta**2 / (M**2 - self.chi * eta**2))

    def f(self, stress: np.ndarray, hardening: np.ndarray) -> np.ndarray:
        """Eq 7.31 with its brackets."""
        of_size = np.log(self.size + self.p_s)
        return np.log(self.surface(stress) + self.p_s) - of_size - hardening / self.c_p

    def inside(self, stress: np.ndarray, hardening: np.ndarray) -> np.ndarray:
        """Whether f <= 0; beyond the cone chi eta^2 = M^2, where f means nothing, it is not."""
        p, q, sin3 = invariants(stress)
        in_cone = (p > 0.0) & (self.chi * q**2 < (self.critical(sin3) * p) ** 2)
        inner = np.where(in_cone, stress, 1.0)
        return in_cone & (self.f(inner, hardening) <= 0.0)

    def state(self, stress: np.ndarray, void_ratio: np.ndarray) -> np.ndarray:
        """xi."""
        p, p_s, plastic = stress.sum(axis=0) / 3.0, self.p_s, self.slope - self.swelling
        e_eta = (
            self.low
            - self.slope * np.log((p + p_s) / (1.0 + p_s))
            - plastic * np.log((self.surface(stress) + p_s) / (p + p_s))
        )
        return e_eta - void_ratio

    def limits(self, stress: np.ndarray, void_ratio: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """M_f and M_c."""
        M, xi = self.critical(invariants(stress)[2]), self.state(stress, void_ratio)
        over = M**2 / (12.0 * (3.0 - M)) / np.exp(-xi / (self.slope - self.swelling))
        return 6.0 * (np.sqrt(over * (1.0 + over)) - over), M * np.exp(-self.m * xi)

    def elastic_rate(self, stress: np.ndarray, strain: np.ndarray) -> np.ndarray:
        bulk = (1.0 + self.e0) * (stress.sum(axis=0) / 3.0 + self.p_s) / self.swelling
        shear = 3.0 * (1.0 - 2.0 * self.nu) / (2.0 * (1.0 + self.nu)) * bulk
        volumetric = strain.sum(axis=0)
        return bulk * volumetric + 2.0 * shear * (strain - volumetric / 3.0)

    def rate(self, state: np.ndarray, strain: np.ndarray) -> np.ndarray:
        """Rates of stress, H and e, (5, point), under a strain rate (3, point), on the surface."""
        stress, hardening, void_ratio = state[:3], state[3], state[4]
        failure, characteristic = self.limits(stress, void_ratio)

        def potential(changed: np.ndarray) -> np.ndarray:
            p, q, _ = invariants(changed)
            return np.log(p) + np.log(1.0 + q**2 / (characteristic**2 * p**2))

        normal = gradient(lambda changed: self.f(changed, hardening), stress)
        flow = gradient(potential, stress)
        p, q, _ = invariants(stress)
        eta = q / p
        ratio = (failure**4 - eta**4) / (characteristic**4 - eta**4)
        trial = self.elastic_rate(stress, strain)
        modulus = (normal * self.elastic_rate(stress, flow)).sum(axis=0)
        modulus += ratio * flow.sum(axis=0) / self.c_p
        multiplier = np.maximum((normal * trial).sum(axis=0), 0.0) / modulus
        plastic = multiplier * flow
        return np.array(
            [
                *(trial - self.elastic_rate(stress, plastic)),
                ratio * plastic.sum(axis=0),
                -(1.0 + self.e0) * strain.sum(axis=0),
            ]
        )

    def plastic(self, state: np.ndarray, strain: np.ndarray, steps: int) -> np.ndarray:
        """States (5, point) after a straight strain (3, point), yielding all the way."""
        part = strain / steps
        for _ in range(steps):
            first = self.rate(state, part)
            second = self.rate(state + 0.5 * first, part)
            third = self.rate(state + 0.5 * second, part)
            fourth = self.rate(state + third, part)
            state = state + (first + 2.0 * second + 2.0 * third + fourth) / 6.0
        return state

    def elastic(self, state: np.ndarray, strain: np.ndarray) -> np.ndarray:
        """States after a straight strain without yielding: K and G grow with p + p_s alone."""
        volumetric = strain.sum(axis=0)
        v = (1.0 + self.e0) * volumetric / self.swelling
        growth = np.where(v == 0.0, 1.0, np.expm1(v) / np.where(v == 0.0, 1.0, v))
        # As if the stiffness were that of the middle: d(p + p_s) = K d eps_v, in closed form.
        stress = state[:3] + self.elastic_rate(state[:3], strain) * growth
        return np.array([*stress, state[3], state[4] - (1.0 + self.e0) * volumetric])

    def elastic_share(self, state: np.ndarray, strain: np.ndarray) -> np.ndarray:
        """How much of a straight strain is elastic, (point,), by bisection."""
        low, high = np.zeros_like(self.e0), np.ones_like(self.e0)
        for _ in range(60):
            middle = 0.5 * (low + high)
            trial = self.elastic(state, middle * strain)
            within = self.inside(trial[:3], trial[3])
            low, high = np.where(within, middle, low), np.where(within, high, middle)
        end = self.elastic(state, strain)
        return np.where(self.inside(end[:3], end[3]), 1.0, low)

    def advanced(self, state: np.ndarray, strain: np.ndarray, steps: int) -> np.ndarray:
        """States (5, point) after a straight strain (3, point): elastic first, then plastic."""
        share = self.elastic_share(state, strain)
        met = self.elastic(state, share * strain)
        return np.where(share == 1.0, met, self.plastic(met, (1.0 - share) * strain, steps))
