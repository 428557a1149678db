"""Load paths from CSV files: the driving displacement of a problem against time."""

from __future__ import annotations

import csv
from pathlib import Path

from granbench.errors import ConfigurationError
from granbench.fem.loading import LoadingHistory

COLUMNS = {"time": "s", "displacement": "m"}
"""Names of the columns, and their units."""


def read_load_path(file: Path | str) -> LoadingHistory:
    """The driving displacement from a file with the columns `time` (s) and `displacement` (m).

    It is linear between the rows, which begin at time 0.

    Raises
    ------
    ConfigurationError
        Naming the file, and the row where there is one: it is missing, lacks a column or has
        another one, a cell is no number, the times do not rise from 0, or nothing moves.
    """
    path = Path(file)
    times, values = _columns(path)
    try:
        history = LoadingHistory(times, values)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error
    if values[0] != 0.0 or not any(values):
        raise ConfigurationError(
            f"load path {path}: begins at a displacement of {values[0]:g} m and ends at "
            f"{values[-1]:g} m; let it begin at 0 and move"
        )
    return history


def _columns(path: Path) -> tuple[tuple[float, ...], ...]:
    """The columns of the file, in the order of `COLUMNS`."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            names = [name.strip() for name in reader.fieldnames or ()]
            if sorted(names) != sorted(COLUMNS):
                wanted = " and ".join(f"{name} (in {unit})" for name, unit in COLUMNS.items())
                raise ConfigurationError(
                    f"load path {path}: has the columns {', '.join(names) or 'none'}; give {wanted}"
                )
            reader.fieldnames = names
            rows = [
                tuple(_number(path, reader.line_num, name, row[name]) for name in COLUMNS)
                for row in reader
            ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigurationError(f"load path {path}: cannot be read ({reason})") from error
    return tuple(zip(*rows, strict=True)) or ((), ())


def _number(path: Path, line: int, name: str, cell: str | None) -> float:
    try:
        return float(cell or "")
    except ValueError:
        raise ConfigurationError(
            f"load path {path}, line {line}: {name} is {cell or 'missing'!r}, which is no number"
        ) from None
