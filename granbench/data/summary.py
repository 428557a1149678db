"""Summary of a dataset in numbers, for `granbench data info` and the dataset card."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granbench.data.replicates import replicate_pairs, replicate_scatter
from granbench.data.splits import leak_report, select_split, split_names
from granbench.data.strain_paths import strain_path_statistics
from granbench.records import open_records_here, verify
from granbench.tensors import component_order

QUALITY = {
    "servo_error_rms": "max",
    "stress_ratio_error_rms": "max",
    "peak_inertial_number": "max",
    "box_edge_ratio": "min",
}
"""Quality measures of paths, and which of their extremes is the worst."""


def summarise(ds: xr.Dataset) -> dict[str, Any]:
    """Counts, ranges, quality, leaks and replicate scatter, as plain values for JSON.

    Parameters
    ----------
    ds : the whole dataset

    Returns
    -------
    Entries without a coordinate in the dataset are left out; `replicate_scatter` is None if no
    packing was prepared twice. Drawn strain paths, in the `plane` order, are described by split in
    `strain_paths`.
    """
    summary: dict[str, Any] = {
        "dataset": str(ds.attrs["dataset"]),
        "version": str(ds.attrs["version"]),
        "licence": str(ds.attrs["licence"]),
        "thesis_section": str(ds.attrs["thesis_section"]),
        "generator": f"{ds.attrs['generator']} {ds.attrs['generator_version']}",
        "engine": f"{ds.attrs['engine']} {ds.attrs['engine_version']}",
        "content_sha256": str(ds.attrs.get("content_sha256", "")),
        "component_order": component_order(ds["component"].values),
        "variables": sorted(map(str, ds.data_vars)),
        "paths": ds.sizes["path"],
        "steps": ds.sizes["step"],
        "specimens": len(np.unique(ds["specimen"].values.astype(str))),
        "splits": _splits(ds),
        "families": _counts(ds, "loading_family"),
    }
    if "grading" in ds.coords:
        summary["gradings"] = _counts(ds, "grading")
    for name, key in (
        ("initial_mean_stress", "pressures"),
        ("preparation_friction", "preparation_frictions"),
    ):
        if name in ds.coords:
            summary[key] = [float(value) for value in np.unique(ds[name].values)]
    if "initial_void_ratio" in ds.coords:
        void_ratio = ds["initial_void_ratio"].values
        summary["initial_void_ratio"] = [float(void_ratio.min()), float(void_ratio.max())]
    summary["quality"] = {
        f"{worst}_{name}": float(getattr(np, f"nan{worst}")(ds[name].values))
        for name, worst in QUALITY.items()
        if name in ds.coords and not np.isnan(ds[name].values).all()
    }
    summary["leaks"] = leak_report(ds).as_dict()
    if "replicate" in ds.coords:
        has_floor = bool(replicate_pairs(ds)) and "train" in split_names(ds)
        summary["replicate_scatter"] = replicate_scatter(ds).as_dict() if has_floor else None
    if summary["component_order"] == "plane":
        summary["strain_paths"] = {
            name: strain_path_statistics(select_split(ds, name)).as_dict()
            for name in split_names(ds)
        }
    return summary


def summarise_file(path: Path) -> dict[str, Any]:
    """The summary of a file of records, read in this process.

    Raises
    ------
    DatasetError
        If it is not a file of records, or is sealed and differs from its hashes.
    """
    with open_records_here(path) as ds:
        _check_seal(ds, path)
        return summarise(ds)


def listed_paths(path: Path) -> list[dict[str, str]]:
    """Name, specimen, split and loading family of every path of a file of records.

    Raises
    ------
    DatasetError
        See `summarise_file`.
    """
    columns = ("path_id", "specimen", "split", "loading_family")
    with open_records_here(path) as ds:
        _check_seal(ds, path)
        rows = zip(*(ds[name].values.astype(str).tolist() for name in columns), strict=True)
        return [dict(zip(columns, row, strict=True)) for row in rows]


def draw_file(path: Path, out: Path, paths: list[str] | None = None) -> Path:
    """Draw a file of records: stress ratio and void ratio, or strain paths and stresses.

    Parameters
    ----------
    path : the file
    out : picture to write
    paths : names of the paths to draw; some of each family where None

    Returns
    -------
    The picture

    Raises
    ------
    DatasetError
        See `summarise_file`.
    ConfigurationError
        If there is no such path, or the picture cannot be written.
    """
    from granbench.plotting import dataset_figure, strain_path_figure
    from granbench.plotting.style import save_figure

    with open_records_here(path) as ds:
        _check_seal(ds, path)
        in_plane = component_order(ds["component"].values) == "plane"
        draw = strain_path_figure if in_plane else dataset_figure
        return save_figure(draw(ds, paths=paths), out)


def _check_seal(ds: xr.Dataset, path: Path) -> None:
    """Verify the hashes of a file, if it has any."""
    if "content_sha256" in ds.attrs:
        verify(ds, str(path))


def _counts(ds: xr.Dataset, name: str) -> dict[str, int]:
    labels, counts = np.unique(ds[name].values.astype(str), return_counts=True)
    return {str(label): int(count) for label, count in zip(labels, counts, strict=True)}


def _splits(ds: xr.Dataset) -> dict[str, dict[str, int]]:
    split = ds["split"].values.astype(str)
    specimen = ds["specimen"].values.astype(str)
    return {
        name: {
            "paths": int((split == name).sum()),
            "specimens": len(np.unique(specimen[split == name])),
        }
        for name in split_names(ds)
    }
