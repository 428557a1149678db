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
from granbench.laboratory.assembly import assemble
from granbench.laboratory.laboratory_test import LaboratoryTest
from granbench.laboratory.settings import ImportSettings
from granbench.laboratory.tables import Column, Table
from granbench.laboratory.units import split_header
from granbench.laboratory.workbook import Cell, read_workbook
from granbench.plausible import VOID_RATIOS

KIND = "triaxial-drained"
SHEETS = "CID"
PASCALS_PER_KILOPASCAL = 1e3
GRAIN_DENSITY = 2650.0
"""kg/m3: the protocol of the Dobrany sand gives a specific gravity of 2.65."""


def read_protocol(path: Path, settings: ImportSettings) -> list[LaboratoryTest]:
    """The drained triaxial tests of a protocol.

    Raises
    ------
    DatasetError
        If the file is damaged, has no sheet of such a test, or see `assemble`.
    """
    sheets = {name: rows for name, rows in read_workbook(path).items() if name.startswith(SHEETS)}
    if not sheets:
        raise DatasetError(
            f"{path}: has no sheet whose name begins with {SHEETS}; export the sheet of your test "
            "as CSV"
        )
    return [_sheet_test(path, name, rows, settings) for name, rows in sheets.items()]


def _sheet_test(
    path: Path, name: str, rows: Mapping[int, list[Cell]], settings: ImportSettings
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
            f"{source}: gives an initial void ratio of {value:g} ({place}); mend it, or give "
            "another with --e0"
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
        See `assemble`.

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
    tests = []
    for place in range(arrays["a0"].shape[1]):
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
            void_ratio = GRAIN_DENSITY / density - 1.0
            chosen = _with_void_ratio(settings, void_ratio, table.source, "from array a2")
        tests.append(assemble(table, chosen, f"{path.stem}-{place + 1}", KIND))
    return tests
