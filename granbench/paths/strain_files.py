"""Paths from CSV files.

One row a step, one column for each component of one order: ``eps_xx`` prescribes the cumulative
strain xx, and ``sig_xx`` in its place the stress. A file whose only column is ``eps_axial``
(``eps_shear``) is the history of a standard test's driving strain. Compression is positive,
strain has no unit (0.01 is one per cent) and stress is in Pa. Where semicolons or tabs separate
the columns, as spreadsheets of some languages write them, numbers may have decimal commas.
"""

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.errors import ConfigurationError
from granbench.paths.mixed_control import MixedControl
from granbench.paths.programme import Floats
from granbench.plausible import LARGEST_STRAIN, LARGEST_STRESS
from granbench.tensors import COMPONENT_ORDERS

STRAIN, STRESS = "eps_", "sig_"
DRIVING_COLUMNS = ("eps_axial", "eps_shear")
SAME_STRESS = 1e-9
"""Relative difference within which a prescribed stress is the one that a path starts from."""


@dataclass(frozen=True)
class PathTable:
    """The rows of a path file.

    Parameters
    ----------
    source : the file, as errors name it
    columns : names of the columns, in the file's order
    values : (row, column)
    lines : (row,), line of the file that each row stands on, from 1
    """

    source: str
    columns: tuple[str, ...]
    values: Floats
    lines: NDArray[np.int64]

    @property
    def driving_column(self) -> str | None:
        """The column of a standard test's driving strain, where the file holds that."""
        return self.columns[0] if self.columns[0] in DRIVING_COLUMNS else None

    @property
    def order(self) -> str:
        """Component order of the columns; the file must not hold a driving strain."""
        labels = {_label(name) for name in self.columns}
        return next(order for order, own in COMPONENT_ORDERS.items() if labels == set(own))

    @property
    def held(self) -> tuple[str, ...]:
        """Labels of the components whose stress is prescribed, in their order."""
        return tuple(
            label for label in COMPONENT_ORDERS[self.order] if STRESS + label in self.columns
        )

    def components(self, kind: str) -> Floats:
        """Strain or stress (`kind` is `STRAIN` or `STRESS`), (row, component); zero if absent."""
        zero = np.zeros(len(self.values))
        return np.stack(
            [
                self.values[:, self.columns.index(kind + label)]
                if kind + label in self.columns
                else zero
                for label in COMPONENT_ORDERS[self.order]
            ],
            axis=1,
        )

    def place(self, row: int) -> str:
        """A row, counted from 0, as an error names it."""
        return f"{self.source}: row {row + 1} (line {self.lines[row]})"

    def history(self) -> Floats:
        """The driving strain (step,) from zero on: a zero is put before rows that do not."""
        strain = self.values[:, 0]
        return strain if strain[0] == 0.0 else np.concatenate([[0.0], strain])

    def control(self, start: Floats) -> tuple[MixedControl, int]:
        """The path as control of one point, and how many steps were put before the rows.

        The first row is the reference where its strain is zero and its stress the one of the
        start; otherwise a reference is put before it.

        Parameters
        ----------
        start : (component,), stress that the path starts from, Pa
        """
        strain, stress = self.components(STRAIN), self.components(STRESS)
        places = [COMPONENT_ORDERS[self.order].index(label) for label in self.held]
        off = np.abs(stress[0] - start)[places].max(initial=0.0)
        added = int(strain[0].any() or off > SAME_STRESS * np.abs(start).max())
        strain = np.concatenate([np.zeros((added, len(start))), strain])
        stress = np.concatenate([np.tile(start, (added, 1)), stress])
        return MixedControl.of_components(self.order, self.held, strain, stress), added


def read_path(path: Path | str) -> PathTable:
    """Read a path file.

    Parameters
    ----------
    path : CSV file, see the module

    Raises
    ------
    ConfigurationError
        Naming the file, and where there is one the row and column: it is missing or empty, a
        column is unknown, missing or double, a cell is blank or no finite number, a row is too
        short or too long, a strain or a stress is as large as only a wrong unit makes it, or
        there is no step.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ConfigurationError(
            f"{path}: cannot be read ({error.strerror}); give a CSV file of strains"
        ) from error
    except UnicodeDecodeError as error:
        raise _no_text(path) from error
    if text.startswith("\0"):
        raise _no_text(path)
    separator = _separator(text)
    reader = csv.reader(
        io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True, strict=True
    )
    rows: list[tuple[int, list[str]]] = []
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if any(stripped):
                if separator != ",":
                    stripped = [cell.replace(",", ".") for cell in stripped]
                rows.append((reader.line_num, stripped))
    except csv.Error as error:
        raise ConfigurationError(
            f"{path}: line {reader.line_num}: {error}; mend the line"
        ) from error
    if not rows:
        raise ConfigurationError(f"{path}: is empty; give columns such as {_known_columns()}")
    columns = _checked_columns(rows[0][1], str(path))
    values = [
        _numbers(cells, columns, f"{path}: row {number} (line {line})")
        for number, (line, cells) in enumerate(rows[1:], start=1)
    ]
    lines = np.array([line for line, _ in rows[1:]], dtype=np.int64)
    table = PathTable(str(path), columns, np.reshape(values, (-1, len(columns))), lines)
    if not len(values) or (len(values) == 1 and not np.any(values)):
        raise ConfigurationError(
            f"{path}: has no step; give at least one row of strains that are not zero"
        )
    _check_sizes(table)
    return table


def _no_text(path: Path) -> ConfigurationError:
    return ConfigurationError(
        f"{path}: is not a text file in UTF-8; give a CSV file of strains, or records in netCDF "
        "(.nc)"
    )


def _separator(text: str) -> str:
    """What separates the columns: a semicolon or a tab where the first line has that alone."""
    header = text.lstrip().partition("\n")[0]
    return next((mark for mark in (";", "\t") if mark in header and "," not in header), ",")


def _check_sizes(table: PathTable) -> None:
    """Refuse the first row that holds what only a wrong unit explains."""
    stress = np.array([name.startswith(STRESS) for name in table.columns])
    beyond = np.abs(table.values) > np.where(stress, LARGEST_STRESS, LARGEST_STRAIN)
    if not beyond.any():
        return
    row, at = (int(place[0]) for place in beyond.nonzero())
    found = f"{table.place(row)}, column {table.columns[at]} holds {table.values[row, at]:g}"
    if stress[at]:
        raise ConfigurationError(
            f"{found}, a stress beyond {LARGEST_STRESS / 1e9:g} GPa; give it in Pa (1e5 is 100 kPa)"
        )
    raise ConfigurationError(
        f"{found}, a strain beyond {100.0 * LARGEST_STRAIN:g} %; strain has no unit: if the column "
        "is in %, divide it by 100"
    )


def _label(column: str) -> str:
    return column.removeprefix(STRAIN).removeprefix(STRESS)


def _known_columns() -> str:
    return " or ".join(
        ",".join(STRAIN + label for label in labels) for labels in COMPONENT_ORDERS.values()
    )


def _hint(name: str, known: Sequence[str]) -> str:
    """What an unknown column may be meant as."""
    label = name.lower().removeprefix("gamma").lstrip("_")
    if name.lower().startswith("gamma") and STRAIN + label in known:
        return f"give the tensor component {STRAIN}{label}, which is half of {name}: "
    if re.fullmatch(r"[-+.\deE]+", name):
        return "it is a number, so the names of the columns are missing above it: "
    near = get_close_matches(name.lower(), known, n=1)
    return f"did you mean {near[0]}? " if near else ""


def _checked_columns(names: Sequence[str], source: str) -> tuple[str, ...]:
    labels = {label for own in COMPONENT_ORDERS.values() for label in own}
    known = [prefix + label for prefix in (STRAIN, STRESS) for label in sorted(labels)]
    known += DRIVING_COLUMNS
    for number, name in enumerate(names, start=1):
        if name not in known:
            hint = _hint(name, known)
            raise ConfigurationError(
                f"{source}: column {number} of the header is {name!r}, which is unknown: {hint}"
                f"name the columns {_known_columns()}, separated by commas or semicolons"
            )
    if driving := [name for name in names if name in DRIVING_COLUMNS]:
        if len(names) > 1:
            raise ConfigurationError(
                f"{source}: column {driving[0]} drives a standard test and must be the only "
                "column; remove the others, or name the strain components"
            )
        return tuple(names)
    found = [_label(name) for name in names]
    for label in found:
        if found.count(label) > 1:
            twice = [name for name in names if _label(name) == label]
            raise ConfigurationError(
                f"{source}: columns {' and '.join(twice)} prescribe one component twice; keep one"
            )
    # `plane` is a part of `full`: the smallest order that holds all labels is meant.
    orders = [own for own in COMPONENT_ORDERS.values() if set(found) <= set(own)]
    if not orders:
        raise ConfigurationError(
            f"{source}: columns {','.join(names)} mix component orders; name them "
            f"{_known_columns()}"
        )
    if missing := [label for label in min(orders, key=len) if label not in found]:
        raise ConfigurationError(
            f"{source}: column {STRAIN}{missing[0]} (or {STRESS}{missing[0]}) is missing; name the "
            f"columns {_known_columns()}"
        )
    return tuple(names)


def _numbers(cells: Sequence[str], columns: Sequence[str], place: str) -> list[float]:
    if len(cells) != len(columns):
        raise ConfigurationError(
            f"{place} has {len(cells)} cells for {len(columns)} columns; mend the row, or separate "
            "columns by semicolons if commas are decimal"
        )
    numbers = []
    for cell, column in zip(cells, columns, strict=True):
        try:
            # Python reads 1_000 as a number, nobody else does.
            number = float(cell.replace("_", " "))
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            what = f"holds {cell!r}, which is not a finite number" if cell else "is blank"
            raise ConfigurationError(f"{place}, column {column} {what}; mend the cell")
        numbers.append(number)
    return numbers
