"""Files of GrainLearning: simulated oedometer tests (.npz), compression positive, stresses in MPa.

The drained laboratory test of the same study is a text table without units; `TABLE_UNITS` are its
units.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.laboratory.array_file import require_few, require_shape
from granbench.laboratory.interpretation import laboratory_test_from
from granbench.laboratory.laboratory_test import LaboratoryTest
from granbench.laboratory.settings import ImportSettings
from granbench.tables.tables import Table

KEYS = frozenset({"data", "keys", "params"})
TABLE_HEADERS = ("epsilon_axial", "e", "p", "q")
TABLE_KIND = "triaxial-drained"
"""According to the name of the file, although its lateral stress falls from 0.2 to 0.16 MPa."""
TABLE_UNITS: Mapping[str, str] = {"strain": "-", "stress": "MPa"}
NEEDED = ("e_x", "e_z", "n", "p", "q")


def read_oedometer(
    path: Path, arrays: Mapping[str, NDArray], settings: ImportSettings
) -> list[LaboratoryTest]:
    """Read the oedometer runs of a file.

    Parameters
    ----------
    path : of the file
    arrays : `data` (run, quantity, step) and `keys` (quantity,), its names: strains `e_x`, `e_y`,
        `e_z` (axial), porosity `n`, `p` and `q` = s1 - s3 in MPa

    Raises
    ------
    DatasetError
        If an array has another shape, a quantity is missing, or see `laboratory_test_from`.

    Notes
    -----
    The strains are logarithmic: the void ratio follows exp(-e_z) to five digits.
    """
    runs, quantities, _ = require_shape(path, arrays, "data", ("runs", "quantities", "steps"))
    require_few(path, runs)
    if arrays["keys"].shape != (quantities,):
        raise DatasetError(
            f"{path}: its array 'keys' has the shape {arrays['keys'].shape}, but 'data' has "
            f"{quantities} quantities; give one key for each"
        )
    keys = [str(key) for key in arrays["keys"]]
    if lost := [name for name in NEEDED if name not in keys]:
        raise DatasetError(f"{path}: has no quantity {lost[0]!r} among its keys; export it as well")
    settings = replace(settings, strain_measure="logarithmic")
    tests = []
    for run, series in enumerate(np.asarray(arrays["data"], dtype=float)):
        by_name = dict(zip(keys, series, strict=True))
        # A porosity of 1 or more has no void ratio; its row is refused below.
        porosity = np.where(by_name["n"] < 1.0, by_name["n"], np.nan)
        table = Table.of_arrays(
            f"{path}, run {run + 1}",
            {
                "axial_strain": by_name["e_z"],
                "radial_strain": by_name["e_x"],
                "deviatoric_stress": by_name["q"],
                "mean_stress": by_name["p"],
                "void_ratio": porosity / (1.0 - porosity),
            },
            {
                "axial_strain": "-",
                "radial_strain": "-",
                "deviatoric_stress": "MPa",
                "mean_stress": "MPa",
                "void_ratio": "-",
            },
        )
        tests.append(laboratory_test_from(table, settings, f"{path.stem}-{run + 1}", "oedometer"))
    return tests
