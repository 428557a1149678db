"""Responses of a model to paths, as a CSV file with the columns of a path file, and as records."""

import csv
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from granbench.errors import ConfigurationError
from granbench.files.whole_file import whole_file
from granbench.paths.path_columns import STRAIN, STRESS
from granbench.paths.programme import Floats
from granbench.records.schema import SCHEMA
from granbench.tensors import COMPONENT_ORDERS


def write_response(
    path: Path, order: str, strain: Floats, stress: Floats, internals: Mapping[str, Floats]
) -> None:
    """Write the response of a model to a path as a CSV file, whole or not at all.

    Parameters
    ----------
    path : file to write
    order : component order
    strain, stress : (row, component), cumulative and Pa, compression positive
    internals : (row,) under their dataset names

    Raises
    ------
    ConfigurationError
        If the file cannot be written.
    """
    labels = COMPONENT_ORDERS[order]
    names = [prefix + label for prefix in (STRAIN, STRESS) for label in labels]
    table = np.column_stack([strain, stress, *internals.values()])
    with (
        whole_file(path, ConfigurationError) as partial,
        partial.open("w", encoding="utf-8", newline="") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*names, *internals])
        # The shortest text that gives each number back to the last bit.
        writer.writerows(table.tolist())


def response_records(
    order: str,
    strain: Floats,
    stress: Floats,
    internals: Mapping[str, Floats],
    *,
    family: str,
    configuration: Mapping[str, object],
    version: str,
) -> xr.Dataset:
    """Responses of a model to paths, as stress-strain records.

    Parameters
    ----------
    order : component order
    strain, stress : (path, step, component)
    internals : (path, step) under their dataset names
    family : loading family
    configuration : what made them, for the attributes
    version : of GranBench

    Returns
    -------
    Dataset in the schema of `granbench.records`, float64 until it is written
    """
    paths = len(strain)
    series = ("path", "step")
    names = [f"{family}/{number}" for number in range(paths)]
    variables = {
        "strain": ((*series, "component"), strain),
        "stress": ((*series, "component"), stress),
    }
    answer = xr.Dataset(
        variables,
        coords={
            "component": ("component", np.array(COMPONENT_ORDERS[order], dtype=object)),
            "path_id": ("path", np.array(names, dtype=object)),
            "specimen": ("path", np.array(names, dtype=object)),
            "split": ("path", np.full(paths, "test", dtype=object)),
            "loading_family": ("path", np.full(paths, family, dtype=object)),
            "seed": ("path", np.zeros(paths, dtype=np.int64)),
        },
        attrs={
            "dataset": "element-test",
            "version": "1.0.0",
            "generator": "granbench drive",
            "generator_version": version,
            "engine": str(configuration.get("model", "")),
            "engine_version": version,
            "configuration": json.dumps(configuration, sort_keys=True),
            "licence": "not stated",
            "thesis_section": "none",
        },
    )
    for name, values in internals.items():
        answer[name] = (series, values)
        if name not in SCHEMA:
            units = "Pa" if "stress" in name or "pressure" in name else "1"
            answer[name].attrs = {"units": units, "long_name": name.replace("_", " ")}
    return answer
