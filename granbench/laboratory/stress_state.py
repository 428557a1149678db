"""Deductions whether a stress is effective or total, from the other columns of its file."""

from dataclasses import dataclass, field

import numpy as np

from granbench.laboratory.stress_series import Floats, Series, Stresses, implied_lateral
from granbench.laboratory.water import AGREEMENT, READING, Water, agree

CLEAR_CHANGE = 0.05
"""Change of the pore pressure, as a share of the lateral stress, beyond which a constant stress can
be recognised as the total or the effective one."""

SAME = 0.1
"""Share of the change of the pore pressure within which a stress counts as constant."""


@dataclass
class SortedStresses:
    """Stresses of a test, sorted into effective and total ones as far as they are known.

    Parameters
    ----------
    water : the pore pressure
    deviatoric : axial minus lateral stress, None if the file does not have it
    effective, total : the stresses sorted so far
    """

    water: Water
    deviatoric: Series | None
    effective: Stresses = field(default_factory=dict)
    total: Stresses = field(default_factory=dict)

    @property
    def mentions_water(self) -> bool:
        """Whether the file or the user gives a pore pressure or its change."""
        return self.water.absolute is not None or self.water.change is not None

    @property
    def water_changes(self) -> bool:
        """Whether the measured pore pressure changes by more than a reading."""
        change = self.water.largest_change
        return change is not None and change > READING

    def lateral(self) -> tuple[Series | None, Series | None] | None:
        """Effective and total lateral stress, as far as they are known; None if neither is."""
        effective, total = (
            None if (found := implied_lateral(group, self.deviatoric)) is None else found[0]
            for group in (self.effective, self.total)
        )
        if effective is None and total is not None and self.water.absolute is not None:
            effective = total.minus(self.water)
        if total is None and effective is not None and self.water.absolute is not None:
            total = Series(
                f"{effective.name} plus {self.water.name}", effective.values + self.water.absolute
            )
        return None if effective is None and total is None else (effective, total)

    def state_by_water(self, lateral: Series) -> tuple[str | None, str]:
        """`effective` or `total`, and why, by the pore pressure; None if it is unclear.

        Parameters
        ----------
        lateral : lateral stress whose header names no state
        """
        change, absolute = self.water.change, self.water.absolute
        largest = float(np.abs(lateral.values).max())
        if change is not None and np.ptp(change) > CLEAR_CHANGE * largest:
            limit = SAME * np.ptp(change)
            if np.ptp(lateral.values) <= limit:
                return (
                    "total",
                    f"because {lateral.name} stays constant while {self.water.name} changes",
                )
            if np.ptp(lateral.values + change) <= limit:
                return "effective", (
                    f"because {lateral.name} falls as {self.water.name} rises, so that their sum "
                    "stays constant"
                )
        if absolute is not None and (lateral.values - absolute).min() < -AGREEMENT * largest:
            return "effective", f"because {self.water.name} exceeds {lateral.name}"
        return None, ""

    def state_by_agreement(self, name: str, series: Series) -> str | None:
        """`effective` or `total`, by the stresses that a stress agrees with.

        Parameters
        ----------
        name : of the quantity
        series : a stress whose header names no state

        Returns
        -------
        `neither` if it contradicts both; None if the columns do not show it
        """
        reference = self.lateral()
        assert reference is not None
        groups = (("effective", reference[0]), ("total", reference[1]))
        # Effective first: where both agree there is no pore pressure.
        compared = 0
        for state, lateral in groups:
            if lateral is None:
                continue
            expected = self._expected(name, lateral)
            if expected is None:
                # Without q the first row decides, at which specimens are mostly isotropic. Where
                # the pore pressure changes every row must agree: K0 tests are not isotropic.
                rows = slice(None) if self.water_changes else slice(1)
                expected, measured = lateral.values[rows], series.values[rows]
            else:
                measured = series.values
            compared += 1
            if agree(measured, expected):
                if state == "total" and reference[0] is None:
                    return None  # the effective stress is unknown and may be the same
                return state
        if self._expected(name, groups[0][1] or groups[1][1]) is None and self.water_changes:
            return None
        if compared == 2:
            return "neither"
        lateral = reference[1]
        if lateral is not None and reference[0] is None:
            expected = self._expected(name, lateral)
            # Apart from suction, a stress below the total one is effective.
            if expected is not None and (series.values <= expected + READING).all():
                return "effective"
        return None

    def _expected(self, name: str, lateral: Series | None) -> Floats | None:
        """The stress (row,) of the same state as a lateral stress; None if it does not follow."""
        if lateral is None:
            return None
        if name == "radial_stress":
            return lateral.values
        if self.deviatoric is None:
            return None
        share = {"axial_stress": 1.0, "mean_stress": 1.0 / 3.0}.get(name)
        return None if share is None else lateral.values + share * self.deviatoric.values
