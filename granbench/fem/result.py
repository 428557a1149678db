"""Result of an analysis: curves, Gauss-point histories and energies as one dataset."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from granbench import __version__
from granbench.errors import AnalysisError
from granbench.fem.gauss_points import COMPONENTS, GaussPoints
from granbench.fem.mesh import Floats
from granbench.fem.operators import ORDER, Operators
from granbench.files.whole_file import whole_file
from granbench.tensors import COMPONENT_ORDERS

DESCRIPTIONS: Mapping[str, tuple[str, str]] = {
    "time": ("s", "time"),
    "time_steps": ("1", "time steps since the last output"),
    "driving_displacement": ("m", "driving displacement"),
    "driving_strain": ("1", "driving displacement over its reference length"),
    "reaction": ("N/m", "reaction conjugate to the driving displacement, per unit thickness"),
    "turned_elements": ("1", "elements that have turned over at the displaced nodes"),
    "volumetric_strain": ("1", "global volumetric strain, compression positive"),
    "maximum_acceleration": ("m/s2", "largest nodal acceleration since the last output"),
    "kinetic_energy": ("J/m", "kinetic energy"),
    "internal_energy": ("J/m", "work of the stresses"),
    "damping_work": (
        "J/m",
        "work of damping, which acts on the motion relative to the prescribed one",
    ),
    "external_work": ("J/m", "work of reactions, loads and weight"),
    "energy_error": ("1", "energy that is missing, relative to the largest of the parts"),
    "iterations": ("1", "iterations of the load step, those of its pieces added up"),
    "pieces": ("1", "increments in which the load step was taken"),
    "residual": ("1", "force out of balance over the reference force, by iteration"),
    "cell_seconds": ("s", "wall-clock time spent in the material cell so far"),
    "solver_seconds": ("s", "wall-clock time spent elsewhere so far"),
    "strain": ("1", "strain at the Gauss points, compression positive"),
    "stress": ("Pa", "stress at the Gauss points, compression positive"),
    "displacement": ("m", "displacement of the nodes along the axes"),
    "point_position": ("m", "coordinates of the Gauss points"),
    "point_volume": ("m2", "area that a Gauss point stands for"),
    "node_position": ("m", "coordinates of the nodes"),
    "element_nodes": ("1", "nodes of each element, corners first; -1 where it has fewer"),
}
"""Units and long names of the variables."""


@dataclass(frozen=True)
class Analysis:
    """Result of an analysis, and the reason if it ended early.

    Parameters
    ----------
    dataset : everything up to the last output step that was reached
    failure : an `AnalysisError`, or the KeyboardInterrupt that stopped the run; None at its end
    """

    dataset: xr.Dataset
    failure: AnalysisError | KeyboardInterrupt | None = None

    def check(self) -> xr.Dataset:
        """The dataset of a finished analysis.

        Raises
        ------
        AnalysisError, KeyboardInterrupt
            Why it did not come to its end.
        """
        if self.failure is not None:
            raise self.failure
        return self.dataset

    def write(self, path: Path | str) -> Path:
        """Write the dataset to netCDF, whole or not at all.

        Raises
        ------
        AnalysisError
            If the file cannot be written.
        """
        path = Path(path)
        encoding = {
            str(name): {"zlib": True, "complevel": 4}
            for name in ("strain", "stress", "displacement")
        }
        with whole_file(path, AnalysisError, RuntimeError, size=self.dataset.nbytes) as partial:
            self.dataset.to_netcdf(partial, engine="netcdf4", encoding=encoding)
        return path


class Recorder:
    """Collects output steps.

    Parameters
    ----------
    operators : of the mesh
    points : the material, whose kept state is recorded
    drive_length : reference length of the driving displacement, m
    """

    def __init__(self, operators: Operators, points: GaussPoints, drive_length: float) -> None:
        self.operators, self.points, self.drive_length = operators, points, drive_length
        self._rows: list[dict[str, float]] = []
        self._residuals: list[tuple[float, ...]] = []
        self._fields: dict[str, list[Floats]] = {"strain": [], "stress": [], "displacement": []}
        self._internals: dict[str, list[Floats]] = {name: [] for name in points.cell.internals}

    def add(
        self,
        displacement: Floats,
        *,
        driving_displacement: float,
        residuals: tuple[float, ...] = (),
        **numbers: float,
    ) -> None:
        """One output step: nodal displacement (2 node,), m, and numbers of `DESCRIPTIONS`."""
        points = self.points
        strain, stress = (
            vector.reshape(COMPONENTS, -1).T.copy() for vector in (points.strain, points.stress)
        )
        moved = displacement.reshape(2, -1).T.copy()
        self._rows.append(
            {
                **numbers,
                "driving_displacement": driving_displacement,
                "driving_strain": driving_displacement / self.drive_length,
                "volumetric_strain": self.operators.volumetric_strain(strain.T),
                "turned_elements": int(self.operators.mesh.turned(moved).sum()),
            }
        )
        self._residuals.append(residuals)
        self._fields["strain"].append(strain)
        self._fields["stress"].append(stress)
        self._fields["displacement"].append(moved)
        for name, values in points.internals().items():
            self._internals[name].append(values.copy())

    def dataset(self, attributes: Mapping[str, object]) -> xr.Dataset:
        """The output steps so far, with attributes; mappings among them become JSON."""
        operators, mesh = self.operators, self.operators.mesh
        names = list(self._rows[0]) if self._rows else []
        variables: dict[str, tuple[tuple[str, ...], np.ndarray]] = {
            name: (("step",), np.array([row[name] for row in self._rows])) for name in names
        }
        if any(self._residuals):
            longest = max(map(len, self._residuals))
            filled = [[*row, *[np.nan] * (longest - len(row))] for row in self._residuals]
            variables["residual"] = (("step", "iteration"), np.array(filled))
        if self._rows:
            for name in ("strain", "stress"):
                variables[name] = (("step", "point", "component"), np.stack(self._fields[name]))
            moved = np.stack(self._fields["displacement"])
            variables["displacement"] = (("step", "node", "direction"), moved)
            for name, series in self._internals.items():
                variables[name] = (("step", "point"), np.stack(series))
        variables["point_position"] = (("point", "direction"), operators.points)
        variables["point_volume"] = (("point",), operators.volumes)
        variables["node_position"] = (("node", "direction"), mesh.nodes)
        variables["element_nodes"] = (("element", "local_node"), mesh.element_nodes)
        dataset = xr.Dataset(
            variables,
            coords={"component": list(COMPONENT_ORDERS[ORDER]), "direction": ["x", "y"]},
            attrs={
                "granbench_version": __version__,
                "element": mesh.element,
                "sign": "compression positive",
                **{
                    name: json.dumps(value) if isinstance(value, Mapping) else value
                    for name, value in attributes.items()
                },
            },
        )
        for name, (units, long_name) in DESCRIPTIONS.items():
            if name in dataset:
                dataset[name].attrs = {"units": units, "long_name": long_name}
        for name in self._internals:
            if name in dataset:
                dataset[name].attrs = {"long_name": name.replace("_", " ")}
        place = ["time", "driving_displacement", "driving_strain", "point_position", "point_volume"]
        return dataset.set_coords([name for name in place if name in dataset])
