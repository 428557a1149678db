"""Checks before and after a fit, and the warnings that come with its parameters."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from granbench.errors import ConfigurationError, ModelError
from granbench.fitting.curves import TestError
from granbench.fitting.least_squares import LeastSquares
from granbench.fitting.optimisation import (
    FARTHEST,
    Minimum,
)
from granbench.fitting.parameter_space import ParameterSpace
from granbench.fitting.uncertainty import (
    Identifiability,
    Uncertainty,
)
from granbench.laboratory import LaboratoryTest
from granbench.models import ClassicalCell

LEAST_FOLLOWED = 0.5
"""Share of the fitted points that the model must reach."""


POOR = 0.3
"""Error of a test, as a share of the range of what was measured, above which a fit is poor."""


AT_BOUND = 1e-3
"""Distance from a bound, as a share of the parameter's range, that counts as at the bound."""


LEAST_CHANGE = 1e-3
"""Change of the stresses of a test, as a share of the largest, below which they are constant."""


TINY = 1e-6

SAME_COST = 1e-3
"""Relative difference of two sums of squares below which two starts found the same minimum."""


def require_change(test: LaboratoryTest) -> None:
    """Refuse a test without change: any parameters would fit it."""
    largest = float(np.nanmax(np.abs(test.stress)))
    if not np.nanmax(np.ptp(test.stress, axis=0)) > LEAST_CHANGE * largest and (
        test.lateral_stress_known or not np.ptp(test.stress[:, 0]) > LEAST_CHANGE * largest
    ):
        raise ConfigurationError(
            f"{test.source}: its stresses stay constant, so nothing can be fitted to it; "
            "give a test in which they change"
        )
    if not np.nanmax(np.ptp(test.strain, axis=0)) > 0.0:
        raise ConfigurationError(
            f"{test.source}: its strains stay constant, so nothing can be fitted to it; give "
            "a test in which they change"
        )


def require_followed(cell: ClassicalCell, errors: Sequence[TestError]) -> None:
    """Refuse parameters with which the model reaches less than half of the fitted points."""
    fitted = [error for error in errors if error.role == "fitted"]
    points, lost = sum(error.points for error in fitted), sum(error.lost for error in fitted)
    if points - lost >= LEAST_FOLLOWED * points:
        return
    names = ", ".join(error.name for error in fitted if error.lost)
    raise ModelError(
        f"{cell.name} cannot follow {names}: with the best parameters that were found it reaches "
        f"{points - lost} of {points} points; start from other parameters, take more starts, check "
        "the stresses of the test, or fit another model"
    )


def unknown_correlations(uncertainty: Uncertainty) -> list[str]:
    """A warning if a correlation of the parameters is not known."""
    if np.isfinite(uncertainty.correlation).all():
        return []
    return [
        "the correlations of some parameters are not known, because the tests hardly depend on "
        "them; fit fewer parameters"
    ]


def warnings_of(
    problem: LeastSquares,
    vector: Tensor,
    minimum: Minimum,
    identifiability: Identifiability,
    errors: Sequence[TestError],
) -> list[str]:
    """What a user should know before using the parameters, one sentence each."""
    found, space = [], problem.space
    if not problem.can_start(torch.zeros_like(vector[None])).all():
        found.append("the model cannot start all tests with the first values; others were taken")
    if space.cell.dimension == 2:
        found.append(
            f"{space.cell.name} was fitted in three dimensions; in the plane, as on the gp tasks "
            "and in finite elements, the same parameters give a different law"
        )
    if lost := [name for name, known in identifiability.identifiable.items() if not known]:
        found.append(
            f"the tests do not identify {', '.join(lost)}: other values fit as well; hold "
            f"{'some of them' if len(lost) > 1 else 'it'} fixed, or add tests"
        )
    for error in errors:
        if error.role == "fitted" and error.total > POOR:
            found.append(
                f"test {error.name} is off by {100.0 * error.total:.3g} % of its range: the model "
                "does not fit it, and the parameters say little about the soil"
            )
    best = int(minimum.cost.argmin())
    if not bool(minimum.converged[best]):
        found.append("the search ended before it converged; allow more iterations")
    stopped = [
        name
        for name, number in zip(space.names, vector.tolist(), strict=True)
        if abs(number) >= FARTHEST
    ]
    if stopped:
        found.append(f"{', '.join(stopped)} reached the end of the searched range")
    found += [text for name in space.names if (text := _at_bound(space, vector, name))]
    same = minimum.cost <= minimum.cost[best] * (1.0 + SAME_COST) + torch.finfo(torch.float64).eps
    if len(same) > 1 and int(same.sum()) == 1:
        found.append(
            f"only one of {len(same)} starts found the best fit; take more starts to confirm it"
        )
    for error in errors:
        if error.lost:
            found.append(
                f"the model cannot follow test {error.name} to its end: it does not reach "
                f"{error.lost} of {error.points} points, and its parameters are not reliable"
            )
    return found


def _at_bound(space: ParameterSpace, vector: Tensor, name: str) -> str:
    """A warning if a parameter is at a bound of its range; empty if it is not."""
    parameter = next(one for one in space.parameters if one.name == name)
    value = float(space.values(vector)[name])
    width = parameter.upper - parameter.lower
    size = width if np.isfinite(width) else max(abs(float(space.cell.reference[name])), TINY)
    for bound in (parameter.lower, parameter.upper):
        if np.isfinite(bound) and abs(value - bound) <= AT_BOUND * size:
            return f"{name} is {value:.6g}, at the bound {bound:g} of its range"
    return ""
