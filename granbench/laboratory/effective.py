"""Effective stresses of a test, from total or effective stresses and the pore pressure.

Effective stress is total stress minus pore pressure. Where a file does not say which of the two a
column is, and its other columns do not show it, an error asks the user: a total stress that is
taken as effective gives soil parameters that look plausible and are wrong.
"""

from dataclasses import replace

import numpy as np

from granbench.errors import DatasetError, Setting
from granbench.laboratory.measured import Measured
from granbench.laboratory.quantities import QUANTITIES
from granbench.laboratory.remedies import QUANTITY, column, ignore, pressure
from granbench.laboratory.remedies import stresses as stresses_are
from granbench.laboratory.settings import ImportSettings
from granbench.laboratory.stress_series import (
    BASES,
    KnownStresses,
    Series,
    Stresses,
    implied_lateral,
    names_of,
)
from granbench.laboratory.stress_state import SortedStresses
from granbench.laboratory.water import AGREEMENT, READING, Water, agree, pore_pressure
from granbench.tables.tables import Table


def effective_stresses(
    table: Table, measured: dict[str, Measured], settings: ImportSettings
) -> KnownStresses:
    """The effective stresses of a file.

    Raises
    ------
    DatasetError
        Naming the columns and the setting that answers, if a stress may be total or effective and
        the file does not show which, the pore pressure that total stresses need is missing, or
        columns contradict each other.
    """
    rows = len(table.places)
    water = pore_pressure(table.source, measured, settings, rows)
    q = measured.get("deviatoric_stress")
    deviatoric = None if q is None else Series.of_column(q)
    sorting = _Sorting(table.source, water, deviatoric)
    sorting.take_stated(measured, settings, rows)
    unstated = {name: Series.of_column(measured[name]) for name in BASES if name in measured}
    sorting.take_unstated(unstated, settings.stresses)
    return sorting.result()


class _Sorting:
    """Sorts the stresses of a file into effective and total ones, and collects the reasons."""

    def __init__(self, source: str, water: Water, deviatoric: Series | None) -> None:
        self.source = source
        self.sorted = SortedStresses(water, deviatoric)
        self.reasons: list[str] = []
        self.assumed = self.from_cell_pressure = False

    def take_stated(
        self, measured: dict[str, Measured], settings: ImportSettings, rows: int
    ) -> None:
        """Sort the stresses whose header, or setting, says effective or total."""
        effective, total = self.sorted.effective, self.sorted.total
        for name in BASES:
            for state, group in (("effective", effective), ("total", total)):
                if (found := measured.get(f"{state}_{name}")) is not None:
                    group[name] = Series.of_column(found)
        if effective:
            self.reasons.append(f"{names_of(effective)} by the header")
        cell = None
        if (found := measured.get("cell_pressure")) is not None:
            cell = Series.of_column(found)
        if settings.cell_pressure is not None:
            given = Series(
                f"the given cell pressure of {settings.cell_pressure:g} Pa",
                np.full(rows, settings.cell_pressure),
            )
            if cell is not None:
                self._require_agreement(cell, given, "the cell pressure")
            cell = cell or given
        if cell is None:
            return
        if "radial_stress" in total:
            self._require_agreement(cell, total["radial_stress"], "the total lateral stress")
        elif settings.stresses == "effective" and not self.sorted.mentions_water:
            effective["radial_stress"] = cell
            self.reasons.append(f"{cell.name} effective as given")
        else:
            total["radial_stress"] = cell
            self.from_cell_pressure = True

    def _require_agreement(self, one: Series, other: Series, what: str) -> None:
        if not agree(one.values, other.values):
            raise DatasetError(
                f"{self.source}: {one.name} and {other.name} both give {what}, but differ by up to "
                f"{np.abs(one.values - other.values).max():g} Pa; leave one of them out"
            )

    def take_unstated(self, stresses: Stresses, given: str | None) -> None:
        """Sort the stresses whose headers say neither effective nor total."""
        if not stresses:
            return
        if given is not None:
            self._put(stresses, given, "as given")
        elif not self.sorted.mentions_water and not self.sorted.total:
            self._put(stresses, "effective", "")
            if not self.reasons or self.reasons == [""]:
                self.assumed = True
        else:
            self._compare(stresses)

    def _put(self, stresses: Stresses, state: str, reason: str) -> None:
        group = self.sorted.effective if state == "effective" else self.sorted.total
        for name, series in stresses.items():
            if name in group:
                what = f"the {state} {QUANTITIES[name].title}"
                self._require_agreement(series, group[name], what)
            group.setdefault(name, series)
        if reason:
            self.reasons.append(f"{names_of(stresses)} {state} {reason}")

    def _compare(self, stresses: Stresses) -> None:
        """Sort stresses by the other columns; ask where they do not show the state."""
        left = dict(stresses)
        if self.sorted.lateral() is None:
            used = implied_lateral(left, self.sorted.deviatoric)
            state, reason = self.sorted.state_by_water(used[0]) if used else (None, "")
            if used is None or state is None:
                raise self._question(left)
            # Axial and lateral stress are computed from one load cell, so they are of one state.
            pair = ("radial_stress", "axial_stress") if "radial_stress" in used[1] else used[1]
            self._put({name: left.pop(name) for name in pair if name in left}, state, reason)
        for name, series in left.items():
            state = self.sorted.state_by_agreement(name, series)
            if state is None:
                raise self._question({name: series})
            if state == "neither":
                reference = self.sorted.lateral()
                assert reference is not None
                raise self._contradiction(series, reference[0] or reference[1])
            self._put({name: series}, state, "as the other columns show")

    def _question(self, stresses: Stresses) -> DatasetError:
        names, water = names_of(stresses), self.sorted.water
        several = len(stresses) > 1
        about = f" The file also gives {water.name}." if water.name else ""
        return DatasetError(
            f"{self.source}: {'are columns' if several else 'is column'} {names} "
            f"{'total or effective stresses' if several else 'a total or effective stress'}?"
            f"{about} Give ",
            stresses_are("effective"),
            ", or ",
            stresses_are("total"),
            " with the pore pressure as a column or, if it was constant, with ",
            pressure("back_pressure"),
        )

    def _contradiction(self, one: Series, other: Series | None) -> DatasetError:
        compared = "the other stresses" if other is None else other.name
        return DatasetError(
            f"{self.source}: column {one.name} agrees with {compared} neither as an effective nor "
            "as a total stress; say what it is with ",
            column(QUANTITY),
            ", or leave one of them out with ",
            ignore(one.header or one.name),
        )

    def result(self) -> KnownStresses:
        """Everything as effective stresses."""
        effective, total = self.sorted.effective, self.sorted.total
        water = self._water_with_back_pressure()
        ways: dict[str, list[Series]] = {name: [series] for name, series in effective.items()}
        if total and water.absolute is not None:
            for name, series in total.items():
                ways.setdefault(name, []).append(series.minus(water))
            self.reasons.append(f"{names_of(total)} total, minus {water.name}")
        elif total and not effective:
            raise self._missing_pore_pressure(water)
        elif total:
            self.reasons.append(f"{names_of(total)} total, not needed")
        statement = "; ".join(filter(None, self.reasons))
        if self.assumed:
            statement = "taken as effective because the file has no pore pressure"
        return KnownStresses(ways, self.sorted.deviatoric, statement, self.assumed, water)

    def _missing_pore_pressure(self, water: Water) -> DatasetError:
        names = names_of(self.sorted.total)
        if water.question:
            return DatasetError(f"{self.source}: {names} are total stresses, but ", *water.question)
        already: tuple[str | Setting, ...] = ()
        if self.from_cell_pressure:
            already = ("; give ", stresses_are("effective"), " if it is effective already")
        return DatasetError(
            f"{self.source}: are {names} total or effective stresses, and what was the pore "
            "pressure? No column gives it: name one with ",
            column("pore_pressure"),
            ", or give a constant one with ",
            pressure("back_pressure"),
            " (0 for a dry specimen)",
            *already,
        )

    def _water_with_back_pressure(self) -> Water:
        """The pore pressure, with the back pressure that total and effective stresses imply."""
        water = self.sorted.water
        if water.absolute is not None or not (self.sorted.total and self.sorted.effective):
            return water
        effective, total = self.sorted.lateral() or (None, None)
        if effective is None or total is None:
            return water
        implied = total.values - effective.values
        if water.change is None:
            # Nothing was measured to compare it with.
            moved = implied - implied[0]
            return replace(water, change=moved, name="the pore pressure between them")
        base = implied - water.change
        if np.ptp(base) > AGREEMENT * np.abs(total.values).max() + READING:
            raise DatasetError(
                f"{self.source}: {total.name} and {effective.name} differ by a pore pressure that "
                f"does not change as {water.name} does; leave out the wrong one with ",
                Setting("ignore"),
            )
        name = f"{water.name} plus the {float(base.mean()):.6g} Pa implied by {effective.name}"
        return Water(water.change + base.mean(), water.change, name)
