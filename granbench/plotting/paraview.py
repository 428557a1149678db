"""An analysis as a series of VTU files, which ParaView opens by its `.pvd` file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

import meshio
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from granbench.errors import AnalysisError
from granbench.files.whole_file import whole_file
from granbench.tensors import COMPONENT_ORDERS

CELL_TYPES = {"quad8": "quad8", "quad4": "quad", "tri3": "triangle", "tri6": "triangle6"}
"""meshio's name of each element; corners come first in both, then the middles of the edges."""


def element_means(dataset: xr.Dataset, name: str) -> NDArray[np.float64]:
    """A Gauss-point variable averaged over each element, (step, element, ...).

    Parameters
    ----------
    dataset : of an analysis
    name : of a variable (step, point, ...)
    """
    values = dataset[name].values
    elements = dataset.sizes["element"]
    steps, points, *rest = values.shape
    by_element = values.reshape(steps, elements, points // elements, *rest)
    volume = dataset["point_volume"].values.reshape(elements, -1)
    weights = volume / volume.sum(axis=1, keepdims=True)
    return np.einsum("seg...,eg->se...", by_element, weights)


def write_series(dataset: xr.Dataset, folder: Path | str) -> Path:
    """Write one VTU file for each output step, and the index that gives them their times.

    Nodes carry the displacement, elements their mean stress and strain (compression positive) and
    the model's internal variables.

    Parameters
    ----------
    dataset : of an analysis
    folder : made where it is absent

    Returns
    -------
    The index (.pvd)

    Raises
    ------
    AnalysisError
        If the folder cannot be written.
    """
    folder = Path(folder)
    name = str(dataset.attrs["problem"])
    nodes = np.pad(dataset["node_position"].values, ((0, 0), (0, 1)))
    cells = [(CELL_TYPES[dataset.attrs["element"]], dataset["element_nodes"].values)]
    files = []
    fields = dict(_element_fields(dataset))
    for step, displacement in enumerate(dataset["displacement"].values):
        mesh = meshio.Mesh(
            nodes,
            cells,
            point_data={"displacement": np.pad(displacement, ((0, 0), (0, 1)))},
            cell_data={field: [series[step]] for field, series in fields.items()},
        )
        file = folder / f"{name}-{step:04d}.vtu"
        with whole_file(file, AnalysisError, ValueError) as partial:
            mesh.write(partial, file_format="vtu")
        files.append(file.name)
    index = folder / f"{name}.pvd"
    with whole_file(index, AnalysisError) as partial:
        partial.write_text(_index(files, dataset["time"].values), encoding="utf-8")
    return index


def _element_fields(dataset: xr.Dataset) -> Iterator[tuple[str, NDArray[np.float64]]]:
    for name in ("stress", "strain"):
        means = element_means(dataset, name)
        for number, label in enumerate(COMPONENT_ORDERS["plane"]):
            yield f"{name}_{label}", means[..., number]
    for internal, variable in dataset.data_vars.items():
        if variable.dims == ("step", "point"):
            yield str(internal), element_means(dataset, str(internal))


def _index(files: Iterable[str], times: Iterable[float]) -> str:
    entries = [
        f'    <DataSet timestep="{time:.17g}" file={quoteattr(file)}/>'
        for file, time in zip(files, times, strict=True)
    ]
    return "\n".join(
        [
            '<?xml version="1.0"?>',
            '<VTKFile type="Collection" version="0.1">',
            "  <Collection>",
            *entries,
            "  </Collection>",
            "</VTKFile>",
            "",
        ]
    )
