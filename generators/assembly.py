"""Make a dataset of stress-strain records from the arrays of a finished campaign.

`granbench.records.schema.SCHEMA` alone says which dimensions a variable has. A job names what it
records after the schema, and the assembly takes whatever was recorded.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from granbench.records.schema import SCHEMA
from granbench.tensors import COMPONENT_ORDERS, SHEAR_COMPONENTS

SERIES_DIMENSIONS = ("path", "step", "component")
"""Dimensions of a variable that the schema does not know."""


@dataclass(frozen=True)
class Assembled:
    """The content of a dataset, without what all generated datasets have in common.

    Parameters
    ----------
    order : component order of stress and strain, a key of `granbench.tensors.COMPONENT_ORDERS`
    series : recorded variables by name, (path, step, ...)
    paths : one value for each path, by name, (path,)
    title : one line that says what the records are
    engine, engine_version : program that made the stresses
    thesis_section : where the thesis describes the tests
    configuration : JSON values; everything that the records depend on, except preset and seed
    attributes : further global attributes
    variable_attributes : attributes of variables, by name, besides or in place of those of the
        schema
    """

    order: str
    series: Mapping[str, np.ndarray]
    paths: Mapping[str, ArrayLike]
    title: str
    engine: str
    engine_version: str
    thesis_section: str
    configuration: Mapping[str, Any]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    variable_attributes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def dataset(self) -> xr.Dataset:
        """The records, without global attributes; units are added on writing."""
        series = {name: _dimensions(name, values) for name, values in self.series.items()}
        used = {dimension for dimensions in series.values() for dimension in dimensions}
        labels = {
            "component": COMPONENT_ORDERS[self.order],
            "strain_component": COMPONENT_ORDERS[self.order],
            "shear_component": SHEAR_COMPONENTS,
            "fabric_component": COMPONENT_ORDERS["full"],
        }
        paths = {name: np.asarray(values) for name, values in self.paths.items()}
        if "void_ratio" in self.series and "initial_void_ratio" not in paths:
            paths["initial_void_ratio"] = self.series["void_ratio"][:, 0].astype(np.float64)
        about = self.variable_attributes
        return xr.Dataset(
            {
                name: (dimensions, self.series[name], about.get(name, {}))
                for name, dimensions in series.items()
            },
            coords={
                **{name: list(order) for name, order in labels.items() if name in used},
                **{name: ("path", values, about.get(name, {})) for name, values in paths.items()},
            },
        )


def _dimensions(name: str, values: np.ndarray) -> tuple[str, ...]:
    return SCHEMA[name].dims if name in SCHEMA else SERIES_DIMENSIONS[: values.ndim]


def read_arrays(file: Path) -> dict[str, np.ndarray]:
    """Arrays of a file that `numpy.savez` wrote, by name, in the order of writing."""
    with np.load(file) as arrays:
        return dict(arrays)


def with_attributes(records: xr.Dataset, attributes: Mapping[str, Any]) -> xr.Dataset:
    """Records with global attributes, those that are mappings as JSON."""
    plain = {
        name: json.dumps(value, sort_keys=True) if isinstance(value, Mapping) else value
        for name, value in attributes.items()
    }
    return records.assign_attrs(plain)
