"""Effective stresses of a test, from total or effective ones and the pore pressure.

Effective is total less pore pressure. Where a file leaves open which of the two a column is, and
its own redundancy does not tell, the question is raised as an error: a total stress that is taken
for an effective one makes soil parameters that look right and are wrong.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.laboratory.measured import Measured
from granbench.laboratory.quantities import QUANTITIES
from granbench.laboratory.settings import ImportSettings
from granbench.laboratory.water import AGREEMENT, READING, Water, agree, pore_pressure
from granbench.tables.tables import Table

Floats = NDArray[np.float64]

BASES = ("radial_stress", "axial_stress", "mean_stress", "intermediate_stress")

CLEAR_CHANGE = 0.05
"""Change of the pore pressure, as a share of the lateral stress, beyond which a stress that stays
the same beside it tells whether it is the total or the effective one."""

SAME = 0.1
"""Share of the change of the pore pressure within which a stress counts as constant."""


@dataclass(frozen=True)
class Series:
    """A stress and where it comes from.

    Parameters
    ----------
    name : column, option, or what it follows from, for messages
    values : (row,), Pa
    """

    name: str
    values: Floats

    def less(self, water: Water) -> "Series":
        """The effective stress of a total one."""
        assert water.absolute is not None
        return Series(f"{self.name} minus {water.name}", self.values - water.absolute)


Stresses = dict[str, Series]
"""Stresses by the name of the quantity, without `effective` or `total`."""


@dataclass(frozen=True)
class KnownStresses:
    """What a file says of effective stresses.

    Parameters
    ----------
    effective : by quantity, every way that leads to each
    deviatoric : axial less lateral stress, where the file has it
    statement : how the stresses came to be effective, for the user
    assumed : whether they only count as effective because nothing speaks of pore pressure
    water : the pore pressure
    """

    effective: Mapping[str, list[Series]]
    deviatoric: Series | None
    statement: str
    assumed: bool
    water: Water


def effective_stresses(
    table: Table, measured: dict[str, Measured], settings: ImportSettings
) -> KnownStresses:
    """The effective stresses that a file states.

    Raises
    ------
    DatasetError
        If a stress may be total or effective and nothing tells which, the pore pressure that
        total ones need is missing, or columns contradict each other: naming them and the option
        that answers.
    """
    rows = len(table.places)
    water = pore_pressure(table.source, measured, settings, rows)
    q = measured.get("deviatoric_stress")
    deviatoric = None if q is None else Series(repr(q.header), q.values)
    known = _Known(table.source, water, deviatoric)
    known.take(measured, settings, rows)
    unmarked = {
        name: Series(repr(measured[name].header), measured[name].values)
        for name in BASES
        if name in measured
    }
    known.decide(unmarked, settings.stresses)
    return known.result()


class _Known:
    """Stresses sorted into effective and total ones."""

    def __init__(self, source: str, water: Water, deviatoric: Series | None) -> None:
        self.source, self.water, self.deviatoric = source, water, deviatoric
        self.effective: Stresses = {}
        self.total: Stresses = {}
        self.reasons: list[str] = []
        self.assumed = self.cell = False

    def take(self, measured: dict[str, Measured], settings: ImportSettings, rows: int) -> None:
        """Sort in what its header, or an option, says to be effective or total."""
        for name in BASES:
            for state, group in (("effective", self.effective), ("total", self.total)):
                if (column := measured.get(f"{state}_{name}")) is not None:
                    group[name] = Series(repr(column.header), column.values)
        if self.effective:
            self.reasons.append(f"{_names(self.effective)} by the header")
        cell = None
        if (column := measured.get("cell_pressure")) is not None:
            cell = Series(repr(column.header), column.values)
        if settings.cell_pressure is not None:
            given = Series(
                f"--cell-pressure {settings.cell_pressure:g} Pa",
                np.full(rows, settings.cell_pressure),
            )
            if cell is not None:
                self._require_agreement(cell, given, "the cell pressure")
            cell = cell or given
        if cell is None:
            return
        if "radial_stress" in self.total:
            self._require_agreement(cell, self.total["radial_stress"], "the total lateral stress")
        elif settings.stresses == "effective" and not self._wet:
            self.effective["radial_stress"] = cell
            self.reasons.append(f"{cell.name} by --stresses effective")
        else:
            self.total["radial_stress"] = cell
            self.cell = True

    @property
    def _wet(self) -> bool:
        """Whether the file or the user speaks of a pore pressure."""
        return self.water.absolute is not None or self.water.change is not None

    def _require_agreement(self, one: Series, other: Series, what: str) -> None:
        if not agree(one.values, other.values):
            raise DatasetError(
                f"{self.source}: {one.name} and {other.name} both give {what}, but differ by up to "
                f"{np.abs(one.values - other.values).max():g} Pa; leave one of them out"
            )

    def decide(self, unmarked: Stresses, stated: str | None) -> None:
        """Sort in the stresses that the headers call neither effective nor total."""
        if not unmarked:
            return
        if stated is not None:
            self._put(unmarked, stated, f"by --stresses {stated}")
        elif not self._wet and not self.total:
            self._put(unmarked, "effective", "")
            if not self.reasons or self.reasons == [""]:
                self.assumed = True
        else:
            self._compare(unmarked)

    def _put(self, stresses: Stresses, state: str, reason: str) -> None:
        group = self.effective if state == "effective" else self.total
        for name, series in stresses.items():
            if name in group:
                what = f"the {state} {QUANTITIES[name].title}"
                self._require_agreement(series, group[name], what)
            group.setdefault(name, series)
        if reason:
            self.reasons.append(f"{_names(stresses)} {state} {reason}")

    def _compare(self, unmarked: Stresses) -> None:
        """Sort in by what the other columns say; ask where they do not."""
        left = dict(unmarked)
        if self._reference() is None:
            used = _lateral(left, self.deviatoric)
            state, reason = self._deduced(used[0]) if used else (None, "")
            if used is None or state is None:
                raise self._question(left)
            # Axial and lateral stress are worked out together, so they are of one state.
            pair = ("radial_stress", "axial_stress") if "radial_stress" in used[1] else used[1]
            self._put({name: left.pop(name) for name in pair if name in left}, state, reason)
        for name, series in left.items():
            state = self._alike(name, series)
            if state is None:
                raise self._question({name: series})
            if state == "neither":
                reference = self._reference()
                assert reference is not None
                raise self._contradiction(series, reference[0] or reference[1])
            self._put({name: series}, state, "as the other columns show")

    def _reference(self) -> tuple[Series | None, Series | None] | None:
        """Effective and total lateral stress, as far as both are settled."""
        effective, total = (
            None if (found := _lateral(group, self.deviatoric)) is None else found[0]
            for group in (self.effective, self.total)
        )
        if effective is None and total is not None and self.water.absolute is not None:
            effective = total.less(self.water)
        if total is None and effective is not None and self.water.absolute is not None:
            total = Series(
                f"{effective.name} plus {self.water.name}", effective.values + self.water.absolute
            )
        return None if effective is None and total is None else (effective, total)

    def _deduced(self, lateral: Series) -> tuple[str | None, str]:
        """Whether an unmarked lateral stress is total or effective, and why; None if unclear."""
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

    def _alike(self, name: str, series: Series) -> str | None:
        """Whether a stress agrees with the effective or the total ones; None if it cannot say."""
        reference = self._reference()
        assert reference is not None
        groups = (("effective", reference[0]), ("total", reference[1]))
        # Effective first: where both agree there is no pore pressure to speak of.
        compared = 0
        for state, lateral in groups:
            if lateral is None:
                continue
            expected = self._expected(name, lateral)
            if expected is None:
                # Without q the first row decides, at which specimens are mostly isotropic. Beside
                # a pore pressure that changes every row must agree: K0 tests are not isotropic.
                rows = slice(None) if self._water_changes else slice(1)
                expected, measured = lateral.values[rows], series.values[rows]
            else:
                measured = series.values
            compared += 1
            if agree(measured, expected):
                if state == "total" and reference[0] is None:
                    return None  # of the effective one nothing is known, it may be the same
                return state
        if self._expected(name, groups[0][1] or groups[1][1]) is None and self._water_changes:
            return None
        if compared == 2:
            return "neither"
        lateral = reference[1]
        if lateral is not None and reference[0] is None:
            expected = self._expected(name, lateral)
            # A pore pressure below zero aside, what lies below the total stress is effective.
            if expected is not None and (series.values <= expected + READING).all():
                return "effective"
        return None

    @property
    def _water_changes(self) -> bool:
        change = self.water.largest_change
        return change is not None and change > READING

    def _expected(self, name: str, lateral: Series | None) -> Floats | None:
        if lateral is None:
            return None
        if name == "radial_stress":
            return lateral.values
        if self.deviatoric is None:
            return None
        share = {"axial_stress": 1.0, "mean_stress": 1.0 / 3.0}.get(name)
        return None if share is None else lateral.values + share * self.deviatoric.values

    def _question(self, stresses: Stresses) -> DatasetError:
        names = _names(stresses)
        several = len(stresses) > 1
        about = f" The file gives {self.water.name} beside." if self.water.name else ""
        return DatasetError(
            f"{self.source}: {'are columns' if several else 'is column'} {names} "
            f"{'total or effective stresses' if several else 'a total or effective stress'}?"
            f"{about} Give --stresses effective, or --stresses total with the pore "
            "pressure as a column or, where it was constant, with --back-pressure PA"
        )

    def _contradiction(self, one: Series, other: Series | None) -> DatasetError:
        beside = "the other stresses" if other is None else other.name
        return DatasetError(
            f"{self.source}: column {one.name} agrees with {beside} neither as an effective nor "
            f"as a total stress; say what it is with --column QUANTITY=HEADER, or leave one "
            f"of them out with --ignore {one.name}"
        )

    def result(self) -> KnownStresses:
        """Everything as effective stresses."""
        water = self._with_deduced_pressure()
        ways: dict[str, list[Series]] = {name: [series] for name, series in self.effective.items()}
        if self.total and water.absolute is not None:
            for name, series in self.total.items():
                ways.setdefault(name, []).append(series.less(water))
            self.reasons.append(f"{_names(self.total)} total, minus {water.name}")
        elif self.total and not self.effective:
            names = _names(self.total)
            if water.question:
                raise DatasetError(
                    f"{self.source}: {names} are total stresses, but {water.question}"
                )
            raise DatasetError(
                f"{self.source}: are {names} total or effective stresses, and what was the pore "
                "pressure? No column gives it: name one with --column pore_pressure=HEADER, or "
                "give a constant one with --back-pressure PA (0 for a dry specimen)"
                + ("; --stresses effective says that it is effective already" if self.cell else "")
            )
        elif self.total:
            self.reasons.append(f"{_names(self.total)} total, not needed")
        statement = "; ".join(filter(None, self.reasons))
        if self.assumed:
            statement = "taken as effective because the file has no pore pressure"
        return KnownStresses(ways, self.deviatoric, statement, self.assumed, water)

    def _with_deduced_pressure(self) -> Water:
        """The water, with the back pressure that total and effective stresses imply."""
        change = self.water.change
        if self.water.absolute is not None or not (self.total and self.effective):
            return self.water
        reference = self._reference()
        effective, total = reference or (None, None)
        if effective is None or total is None:
            return self.water
        pressure = total.values - effective.values
        if change is None:
            # Nothing to compare with: it is what they say that it is.
            moved = pressure - pressure[0]
            return replace(self.water, change=moved, name="the pore pressure between them")
        base = pressure - change
        if np.ptp(base) > AGREEMENT * np.abs(total.values).max() + READING:
            raise DatasetError(
                f"{self.source}: {total.name} and {effective.name} differ by a pore pressure that "
                f"does not change as {self.water.name} does; leave out the wrong one with --ignore"
            )
        name = f"{self.water.name} plus the {float(base.mean()):.6g} Pa implied by {effective.name}"
        return Water(change + base.mean(), change, name)


def _names(stresses: Mapping[str, Series]) -> str:
    return ", ".join(series.name for series in stresses.values())


def _lateral(
    stresses: Stresses, deviatoric: Series | None
) -> tuple[Series, tuple[str, ...]] | None:
    """The lateral stress that some stresses of one state imply, and which of them; None if none."""
    radial, axial, mean = (
        stresses.get(name) for name in ("radial_stress", "axial_stress", "mean_stress")
    )
    if radial is not None:
        return radial, ("radial_stress",)
    if mean is not None and deviatoric is not None:
        values = mean.values - deviatoric.values / 3.0
        return Series(f"{mean.name} and {deviatoric.name}", values), ("mean_stress",)
    if axial is not None and deviatoric is not None:
        values = axial.values - deviatoric.values
        return Series(f"{axial.name} and {deviatoric.name}", values), ("axial_stress",)
    if axial is not None and mean is not None:
        values = (3.0 * mean.values - axial.values) / 2.0
        return Series(f"{axial.name} and {mean.name}", values), ("axial_stress", "mean_stress")
    return None
