"""Files of SoilModels: the laboratory protocol (.xlsx) and the paths derived from it (.npz).

The protocol has a sheet for each drained triaxial test, named CID-..., and for each oedometer test,
named OED-...: the initial void ratio in B1, headers in row 2, numbers below.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError, Setting
from granbench.laboratory.array_file import require_few, require_shape
from granbench.laboratory.interpretation import laboratory_test_from
from granbench.laboratory.laboratory_test import LaboratoryTest
from granbench.laboratory.settings import ImportSettings
from granbench.tables.sheet_cells import Rows
from granbench.tables.tables import Column, Table
from granbench.units.known_units import split_header
from granbench.units.plausible import VOID_RATIOS

DRAINED = "triaxial-drained"
KINDS_BY_SHEET = {"CID": DRAINED, "OED": "oedometer"}
"""Kind of test by the first letters of the name of its sheet."""
SAME_VOID_RATIO = 5e-3
"""Difference of two void ratios that rounding explains."""
PASCALS_PER_KILOPASCAL = 1e3
GRAIN_DENSITY = 2650.0
"""kg/m3: the protocol of the Dobrany sand gives a specific gravity of 2.65."""


def is_protocol(sheets: Mapping[str, Rows]) -> bool:
    """Whether a workbook is a protocol, by the names of its sheets."""
    return any(_kind(name) is not None for name in sheets)


def _kind(sheet: str) -> str | None:
    return next((kind for start, kind in KINDS_BY_SHEET.items() if sheet.startswith(start)), None)


def read_protocol(
    path: Path, sheets: Mapping[str, Rows], settings: ImportSettings
) -> list[LaboratoryTest]:
    """Read the triaxial and oedometer tests of a protocol.

    Parameters
    ----------
    path : of the file
    sheets : of the workbook, see `granbench.tables.workbook.read_sheets`

    Raises
    ------
    DatasetError
        If a sheet contradicts the settings, or see `laboratory_test_from`.
    """
    return [
        _sheet_test(path, name, rows, settings, kind)
        for name, rows in sheets.items()
        if (kind := _kind(name)) is not None
    ]


def _sheet_test(
    path: Path, name: str, rows: Rows, settings: ImportSettings, kind: str
) -> LaboratoryTest:
    source = f"{path}, sheet {name}"
    headers = [str(header or "") for header in rows.get(2, [])]
    numbers = {n: cells for n, cells in rows.items() if n > 2 and any(c is not None for c in cells)}
    columns = []
    for at, header in enumerate(headers):
        cells = [row[at] if at < len(row) else None for row in numbers.values()]
        columns.append(Column(header, *split_header(header), cells))
    start = rows.get(1, [])
    void_ratio = start[1] if len(start) > 1 else None
    if isinstance(void_ratio, float):
        settings = _with_void_ratio(settings, void_ratio, source, "cell B1")
    table = Table(source, [f"row {number}" for number in numbers], columns)
    return laboratory_test_from(table, settings, name, kind)


def _with_void_ratio(
    settings: ImportSettings, value: float, source: str, place: str
) -> ImportSettings:
    least, greatest = VOID_RATIOS
    given = settings.initial_void_ratio
    if not least <= value <= greatest:
        if given is not None:
            return settings
        raise DatasetError(
            f"{source}: gives an initial void ratio of {value:g} ({place}); fix it, or give ",
            Setting("initial_void_ratio"),
        )
    if given is not None and abs(given - value) > SAME_VOID_RATIO:
        raise DatasetError(
            f"{source}: gives an initial void ratio of {value:.4g} ({place}), but ",
            Setting("initial_void_ratio"),
            f" is {given:g}; leave it out, or fix the file",
        )
    return replace(settings, initial_void_ratio=value)


def read_paths(
    path: Path, arrays: Mapping[str, NDArray], settings: ImportSettings
) -> list[LaboratoryTest]:
    """Read the paths derived from a protocol.

    Parameters
    ----------
    path : of the file
    arrays : `a0` (step, path, 2), strain; `a1` (step, path, 2), stress in kPa; `a2`
        (step, path, 1), density, kg/m3

    Raises
    ------
    DatasetError
        If an array has another shape, a density is impossible, or see `laboratory_test_from`.

    Notes
    -----
    Comparison with the protocol shows three peculiarities:

    - `a0` holds the volumetric strain v, *positive in dilation*, and the deviatoric strain
      e1 - v/3 with the same v; so e1 = a0[1] + a0[0]/3;
    - `a1` holds the trace of the stress, 3 p, and q;
    - the density increases where the specimen dilates, so only its first value is used.

    The smoothed paths begin before the test, at negative strains and q: rows before the first one
    with positive q and strain are left out.
    """
    steps, paths, _ = require_shape(path, arrays, "a0", ("steps", "paths", 2))
    require_shape(path, arrays, "a1", (steps, paths, 2))
    require_shape(path, arrays, "a2", (steps, paths, 1))
    require_few(path, paths)
    tests = []
    for place in range(paths):
        dilation, shear = np.asarray(arrays["a0"][:, place], dtype=float).T
        trace, q = PASCALS_PER_KILOPASCAL * np.asarray(arrays["a1"][:, place], dtype=float).T
        start = int(np.argmax((q > 0.0) & np.logical_not(np.isnan(q))))
        table = Table.of_arrays(
            f"{path}, path {place + 1}",
            {
                "axial_strain": (shear + dilation / 3.0)[start:],
                "volumetric_strain": -dilation[start:],
                "deviatoric_stress": q[start:],
                "mean_stress": trace[start:] / 3.0,
            },
            {
                "axial_strain": "-",
                "volumetric_strain": "-",
                "deviatoric_stress": "Pa",
                "mean_stress": "Pa",
            },
        )
        density = float(arrays["a2"][start, place, 0])
        chosen = settings
        if density > 0.0:
            void_ratio = GRAIN_DENSITY / density - 1.0
            chosen = _with_void_ratio(settings, void_ratio, table.source, "from array a2")
        elif settings.initial_void_ratio is None:
            raise DatasetError(
                f"{table.source}: array 'a2' gives a density of {density:g} kg/m3; fix it, or give "
                "the void ratio with ",
                Setting("initial_void_ratio"),
            )
        tests.append(laboratory_test_from(table, chosen, f"{path.stem}-{place + 1}", DRAINED))
    return tests
