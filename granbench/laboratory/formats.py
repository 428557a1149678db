"""Reading of laboratory files, whose format is recognised from their content."""

import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.files.input_file import require_file
from granbench.laboratory import grainlearning, masi, soilmodels
from granbench.laboratory.array_file import read_arrays
from granbench.laboratory.conversion import from_records
from granbench.laboratory.headers import known_quantity
from granbench.laboratory.interpretation import laboratory_test_from
from granbench.laboratory.laboratory_test import LaboratoryTest
from granbench.laboratory.settings import ImportSettings
from granbench.records import open_records
from granbench.tables.table_files import MOST_BYTES, read_table
from granbench.tables.tables import Table
from granbench.tables.workbook import read_sheets

ArrayReader = Callable[[Path, Mapping[str, NDArray], ImportSettings], list[LaboratoryTest]]

SOILMODELS_KEYS = frozenset({"a0", "a1", "a2"})
WORKBOOKS = (".xlsx", ".xlsm")
MOST_BYTES_OF_RECORDS = 20_000_000_000
EXAMPLE = "a table with a header such as eps1 [%], q [kPa]"
KINDS_OF_FILES = "a CSV, .dat, .xlsx or .npz file"

KARLSRUHE_HEADERS = ("eps1", "epsv", "eps3", "epsq", "Void ratio", "q", "p", "eta = q/p")


def read_tests(path: Path | str, settings: ImportSettings | None = None) -> list[LaboratoryTest]:
    """Every test of a laboratory file.

    Parameters
    ----------
    path : a table as text or in the one sheet of a workbook (.xlsx), a SoilModels protocol
        (.xlsx) or its paths (.npz), GrainLearning's oedometer runs (.npz), Masi's paths (.npz),
        records (.nc)
    settings : of the import, for what the file does not say itself

    Returns
    -------
    The tests; a table holds one

    Raises
    ------
    DatasetError
        In one sentence, naming file, row and column: see `read_table`, `laboratory_test_from`.
    """
    path, settings = Path(path), settings or ImportSettings()
    if not path.exists():
        raise DatasetError(f"{path}: there is no such file; check the name")
    is_records = path.suffix.lower() == ".nc"
    require_file(path, DatasetError, MOST_BYTES_OF_RECORDS if is_records else MOST_BYTES)
    if is_records:
        with open_records(path) as records:
            return from_records(records, str(path))
    if path.suffix.lower() in WORKBOOKS:
        sheets = read_sheets(path, DatasetError)
        if soilmodels.is_protocol(sheets):
            return soilmodels.read_protocol(path, sheets, settings)
    elif zipfile.is_zipfile(path):
        arrays = read_arrays(path)
        return _array_reader(path, arrays)(path, arrays, settings)
    return [_table_test(path, settings)]


def read_selected(text: str, settings: ImportSettings | None = None) -> list[LaboratoryTest]:
    """The tests of a file, or one of them as ``FILE::TEST``.

    Raises
    ------
    DatasetError
        If there is no such test, or see `read_tests`.
    """
    file, sign, name = text.rpartition("::")
    tests = read_tests(file if sign else text, settings)
    chosen = [test for test in tests if not sign or test.name == name]
    if not chosen:
        known = ", ".join(test.name for test in tests[:8])
        raise DatasetError(f"{file}: has no test {name!r}; there are {known}")
    return chosen


def _array_reader(path: Path, arrays: Mapping[str, NDArray]) -> ArrayReader:
    """The reader of the .npz format that the names and shapes of the arrays show."""
    names = frozenset(arrays)
    if names >= grainlearning.KEYS:
        return grainlearning.read_oedometer
    if names >= masi.NAMED_KEYS or masi.is_nice(arrays):
        return masi.read_paths
    if names >= SOILMODELS_KEYS and arrays["a0"].ndim == 3:
        return soilmodels.read_paths
    raise DatasetError(
        f"{path}: its arrays {', '.join(sorted(names)[:6]) or '(none)'} belong to no known "
        "format; export the test as CSV with headers such as eps1 [%], q [kPa]"
    )


def _table_test(path: Path, settings: ImportSettings) -> LaboratoryTest:
    named = {header.strip().lower() for header in settings.columns.values()}

    def is_known(name: str) -> bool:
        return known_quantity(name) is not None or name.lower() in named

    table = read_table(path, DatasetError, is_known, EXAMPLE, KINDS_OF_FILES)
    names = tuple(column.name for column in table.columns)
    if names == KARLSRUHE_HEADERS:
        return laboratory_test_from(
            _with_void_ratio_as_ratio(table), settings, path.stem, "triaxial-drained"
        )
    if names == grainlearning.TABLE_HEADERS:
        units = {**grainlearning.TABLE_UNITS, **settings.units}
        settings = replace(settings, units=units)
        return laboratory_test_from(table, settings, path.stem, grainlearning.TABLE_KIND)
    return laboratory_test_from(table, settings, path.stem)


def _with_void_ratio_as_ratio(table: Table) -> Table:
    """The table with a void ratio as ratio: the files of the Karlsruhe sand wrongly state %."""
    columns = [
        replace(column, unit="-") if column.name == "Void ratio" else column
        for column in table.columns
    ]
    return replace(table, columns=columns)
