"""SoilModels: the laboratory protocol (.xlsx) and the smoothed or raw paths made from it (.npz).

The protocol has a sheet for each drained triaxial test, named CID-...: the initial void ratio in
B1, headers in row 2, numbers below. Sheets of oedometer tests (OED-...) give no lateral stress,
so that no stress path can be made of them; they are left out.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.laboratory.array_file import require_few, require_shape
from granbench.laboratory.assembly import assemble
from granbench.laboratory.laboratory_test import LaboratoryTest
from granbench.laboratory.settings import ImportSettings
from granbench.paths.sheet_cells import Rows
from granbench.paths.tables import Column, Table
from granbench.plausible import VOID_RATIOS
from granbench.units import split_header

KIND = "triaxial-drained"
SHEETS = "CID"
OEDOMETER_SHEETS = "OED"
PASCALS_PER_KILOPASCAL = 1e3
GRAIN_DENSITY = 2650.0
"""kg/m3: the protocol of the Dobrany sand gives a specific gravity of 2.65."""


def is_protocol(sheets: Mapping[str, Rows]) -> bool:
    """Whether a workbook is a protocol, by the names of its sheets."""
    return any(name.startswith((SHEETS, OEDOMETER_SHEETS)) for name in sheets)


def read_protocol(
    path: Path, sheets: Mapping[str, Rows], settings: ImportSettings
) -> list[LaboratoryTest]:
    """The drained triaxial tests of a protocol.

    Parameters
    ----------
    path : of the file
    sheets : of the workbook, see `granbench.paths.workbook.read_sheets`

    Raises
    ------
    DatasetError
        If there is no sheet of such a test, or see `assemble`.
    """
    tests = {name: rows for name, rows in sheets.items() if name.startswith(SHEETS)}
    if not tests:
        raise DatasetError(
            f"{path}: has no sheet whose name begins with {SHEETS}; export the sheet of your test "
            "as CSV"
        )
    return [_sheet_test(path, name, rows, settings) for name, rows in tests.items()]


def _sheet_test(path: Path, name: str, rows: Rows, settings: ImportSettings) -> LaboratoryTest:
    source = f"{path}, sheet {name}"
    headers = [str(header or "") for header in rows.get(2, [])]
    numbers = {n: cells for n, cells in rows.items() if n > 2 and any(c is not None for c in cells)}
    columns = []
    for at, header in enumerate(headers):
        cells = [row[at] if at < len(row) else None for row in numbers.values()]
        columns.append(Column(header, *split_header(header), cells))
    start = rows.get(1, [])
    void_ratio = start[1] if len(start) > 1 else None
    if settings.initial_void_ratio is None and isinstance(void_ratio, float):
        settings = _with_void_ratio(settings, void_ratio, source, "cell B1")
    table = Table(source, [f"row {number}" for number in numbers], columns)
    return assemble(table, settings, name, KIND)


def _with_void_ratio(
    settings: ImportSettings, value: float, source: str, place: str
) -> ImportSettings:
    least, greatest = VOID_RATIOS
    if not least <= value <= greatest:
        raise DatasetError(
            f"{source}: gives an initial void ratio of {value:g} ({place}); correct it, or "
            "give another with --e0"
        )
    return ImportSettings(**(vars(settings) | {"initial_void_ratio": value}))


def read_paths(
    path: Path, arrays: Mapping[str, NDArray], settings: ImportSettings
) -> list[LaboratoryTest]:
    """The paths that were made of a protocol.

    Parameters
    ----------
    path : of the file
    arrays : `a0` (step, path, 2), strain; `a1` (step, path, 2), stress in kPa; `a2`
        (step, path, 1), density, kg/m3

    Raises
    ------
    DatasetError
        If an array has another shape, a density is impossible, or see `assemble`.

    Notes
    -----
    Three things are not what one would think (compare them with the protocol):

    - `a0` holds the volumetric strain v counted *positive in dilation*, and for the deviatoric
      strain e1 - v/3 with that same v; so e1 = a0[1] + a0[0]/3;
    - `a1` holds the trace of the stress, 3 p, and q;
    - the density grows where the specimen dilates, so only its first value means something.

    The smoothed paths begin outside of the test, at negative strains and q: rows before the first
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
        if settings.initial_void_ratio is None:
            if not density > 0.0:
                raise DatasetError(
                    f"{table.source}: array 'a2' gives a density of {density:g} kg/m3; correct it, "
                    "or give the void ratio with --e0"
                )
            void_ratio = GRAIN_DENSITY / density - 1.0
            chosen = _with_void_ratio(settings, void_ratio, table.source, "from array a2")
        tests.append(assemble(table, chosen, f"{path.stem}-{place + 1}", KIND))
    return tests
