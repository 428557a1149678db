"""How far two computations of one number may differ: what a metric says of its own accuracy.

The same model on another machine gives other last digits: 1e-16 in double and 1e-7 in single
precision a step, which error control and recurrent networks enlarge. What that does to a score
depends on what the score counts, so each metric names its class of tolerance.
"""

from dataclasses import dataclass

TRUTH_TOLERANCE = 1e-3
"""Largest difference of a recomputed ground truth, in training standard deviations or relative to a
larger stress: machines round differently, and error control then takes other steps. For the curves
and stresses of an analysis it is relative to their root mean square."""

CLOCK_FACTOR = 10.0
"""Largest quotient of two CPU times of one computation. Clocks of machines, and of one machine on a
busy day, differ by a few times; ten is a claim about another model."""


@dataclass(frozen=True)
class LostTolerance:
    """How far a number may differ where rounding decides the result, see `Axis.lost_results`.

    Parameters
    ----------
    absolute : largest difference of two shares, which must lie between 0 and 1; None: no share
    factor : largest quotient of two values; None: they are not compared
    """

    absolute: float | None = None
    factor: float | None = None


@dataclass(frozen=True)
class Tolerance:
    """Largest difference between two values of a score, beyond a thousandth of the value.

    Parameters
    ----------
    title : name of the class
    absolute : in the unit of the metric
    relative : share of the value
    paths : number of paths that may count in one computation and not in the other
    of_limit : share of the largest value that passes, for what has such a limit (`Part.limit`)
    clock : largest quotient of two values, for what is measured with a clock
    lost : how far it may differ instead where rounding decides the result
    """

    title: str
    absolute: float = 0.0
    relative: float = 0.0
    paths: int = 0
    of_limit: float = 0.0
    clock: float | None = None
    lost: LostTolerance = LostTolerance()

    def slack(self, value: float, n: int, limit: float | None) -> float:
        """Largest difference from a value, in the unit of the metric.

        Parameters
        ----------
        value : of the maintainers' computation
        n : number of paths that it is the mean of
        limit : largest value that passes; None or zero where there is none: a tenth counts then,
            because a few steps of a path are counted
        """
        return max(
            self.absolute,
            self.relative * abs(value),
            self.paths / max(n, 1),
            self.of_limit * (limit or 0.1),
        )


VALUE = Tolerance("value")
"""A mean of many numbers, none of which decides it."""

SHARE_OF_STEPS = Tolerance("share of steps", absolute=1e-3)
"""Steps that lie on a limit may fall on its other side."""

SHARE_OF_PATHS = Tolerance("share of paths", paths=1)
"""A path counts or does not."""

STEP = Tolerance("step", absolute=1.0)
"""The number of a step."""

VIOLATION = Tolerance("violation of a law", of_limit=0.1)

CLOCK = Tolerance("clock", clock=CLOCK_FACTOR)
"""CPU times, and quotients of them."""
