r"""Random strain paths from a Gaussian process that starts at zero (thesis, Sec 6.2.3).

The process has the kernel k(t, t') = s^2 exp(-(t - t')^2 / 2 l^2) (Eq 6.14). Conditioned on the
value 0 at t = 0 without noise, its covariance is (Eq 6.25)

    C(t, t') = k(t, t') - k(t, 0) k(0, t') / s^2
             = s^2 exp(-t^2 / 2 l^2) exp(-t'^2 / 2 l^2) (exp(t t' / l^2) - 1).

With x = t/l, the exponential series of the last bracket makes this a sum of products,

    C(t, t') = sum_{n >= 1} phi_n(t) phi_n(t'),   phi_n(t) = s exp(-x^2 / 2) x^n / sqrt(n!),

so f(t) = sum z_n phi_n(t) with independent standard normal z_n has exactly this covariance.
Conditioning leaves out the term n = 0 and nothing else. The matrix of a few hundred points is
singular in double precision (its eigenvalues fall below 1e-16 of the largest after some twenty),
which is why a Cholesky factor needs a jitter that makes paths rough and start beside zero; no
matrix is factored here, all terms of C are positive, and f(0) = 0 to the last bit. Moreover f is
known between the points: the same path can be sampled more finely.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from scipy.special import gammaln

from granbench.paths.drawn import DrawnPaths, PathFamily, require_range, uniform
from granbench.paths.programme import Floats
from granbench.tensors import plane_components

VALUES_AT_A_TIME = 1_000_000
"""Entries of the factors of some paths in memory together: 8 MB, which stay in the cache."""

SHORTEST_LENGTH = 0.02
"""Below it, exp(-1/2 l^2) vanishes in double precision before the series sums it up."""


class GaussianStrain(PathFamily):
    """Two principal strains and their angle as smooth random functions of pseudo-time.

    Both principal strains have the standard deviation v/2 and the correlation length l; the
    angle is theta0 plus a process with v_theta/2 and the same l. The halves are not in the
    thesis: its published paths have them, and only with them is its median increment met.

    Parameters
    ----------
    v : range of v, strain
    l : range of l, relative to the length of the path
    v_theta : range of v_theta, rad

    Raises
    ------
    ConfigurationError : a range does not rise or is out of bounds

    References
    ----------
    Guan (2023), Sec 6.2.3, Eq 6.13, 6.14, 6.25, 6.35.
    """

    loading_family: ClassVar[str] = "gaussian"

    v: tuple[float, float] = (0.1, 0.18)
    l: tuple[float, float] = (0.1, 0.5)  # noqa: E741 - the symbol of Eq 6.14
    v_theta: tuple[float, float] = (0.0, math.pi / 4)

    def model_post_init(self, _context: object) -> None:
        """Raise ConfigurationError for ranges that nothing can be drawn from."""
        require_range(self, "v", 0.0)
        require_range(self, "l", SHORTEST_LENGTH)
        require_range(self, "v_theta", 0.0)

    def draw(self, rng: np.random.Generator, count: int, steps: int) -> DrawnPaths:
        """See `PathFamily.draw`."""
        of_paths, of_terms = rng.spawn(2)
        ranges = (self.v, self.l, self.v_theta, (-math.pi, math.pi))
        v, length, v_theta, start = uniform(of_paths, count, *ranges)
        normals = of_terms.standard_normal((count, 3, term_count(self.l[0])))
        time = np.linspace(0.0, 1.0, steps + 1)
        first, second, turn = np.moveaxis(conditioned_process(normals, length, time), 1, 0)
        angle = start[:, None] + 0.5 * v_theta[:, None] * turn
        amplitude = 0.5 * v[:, None]
        strain = plane_components(
            amplitude * first, amplitude * second, np.cos(angle), np.sin(angle)
        )
        return DrawnPaths(
            np.stack(strain, axis=-1),
            {
                "strain_deviation": 0.5 * v,
                "correlation_length": length,
                "rotation_deviation": 0.5 * v_theta,
                "initial_angle": start,
            },
        )


def term_count(shortest: float) -> int:
    """Number of terms with which the variance of every path is complete in double precision.

    The terms' shares of the variance at x = t/l are those of a Poisson distribution with mean
    x^2; the rest behind ten of its standard deviations and thirty terms is below 1e-20.

    Parameters
    ----------
    shortest : the smallest correlation length, for t up to 1
    """
    mean = 1.0 / shortest**2
    return math.ceil(mean + 10.0 * math.sqrt(mean) + 30.0)


def conditioned_factor(length: Floats, time: Floats, terms: int) -> Floats:
    """The functions phi_n of unit variance, n = 1, 2, ...: a factor of the covariance.

    Parameters
    ----------
    length : (path,), correlation lengths
    time : (point,), pseudo-time from 0 to 1
    terms : how many functions

    Returns
    -------
    (path, terms, point)
    """
    x = time / length[:, None]
    n = np.arange(1, terms + 1)
    with np.errstate(divide="ignore"):
        logarithm = np.log(x)  # minus infinity at the start, where every phi_n is then zero
    exponent = n[:, None] * logarithm[:, None, :] - 0.5 * (x**2)[:, None, :]
    return np.exp(exponent - 0.5 * gammaln(n + 1.0)[:, None])


def conditioned_process(normals: Floats, length: Floats, time: Floats) -> Floats:
    """Gaussian processes of unit variance that are zero at time 0.

    Parameters
    ----------
    normals : (path, process, term), standard normal numbers; `term_count` says how many terms
    length : (path,), correlation lengths
    time : (point,), pseudo-time from 0 to 1

    Returns
    -------
    (path, process, point)
    """
    paths, _, terms = normals.shape
    together = max(1, VALUES_AT_A_TIME // (terms * len(time)))
    blocks = [slice(start, start + together) for start in range(0, paths, together)]
    return np.concatenate(
        [normals[block] @ conditioned_factor(length[block], time, terms) for block in blocks]
    )
