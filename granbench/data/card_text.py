"""The text of a dataset's card, in Markdown, computed from the records."""

import contextlib
import json
from collections.abc import Mapping

import numpy as np
import xarray as xr

from granbench.data.markdown import table
from granbench.data.plane_card import plane_sections
from granbench.data.replicates import replicate_scatter
from granbench.data.splits import leak_report, split_hash, split_names
from granbench.errors import DatasetError
from granbench.plotting.quality import QUALITY_LIMITS
from granbench.records.observations import MONOTONIC_FAMILIES, select
from granbench.tensors import component_order

ABBREVIATIONS = (
    "Abbreviations: DEM, discrete element method; RMS, root mean square over a path; MSE, mean "
    "squared error."
)


def card_text(
    records: xr.Dataset,
    figures: Mapping[str, str],
    undrawn: Mapping[str, str] | None = None,
) -> str:
    """The page in Markdown.

    Parameters
    ----------
    records : stress-strain records
    figures : caption of each figure by its address relative to the page
    undrawn : reason for each figure that does not apply, by title
    """
    attributes = records.attrs
    sections = [
        f"# {attributes['dataset']} {attributes['version']}",
        str(attributes.get("title", "")),
        "" if _in_plane(records) else ABBREVIATIONS,
        _identity(records),
        "## Design\n\n" + _design(records),
        *(f"![]({address})\n\n*{caption}*" for address, caption in figures.items()),
        *(f"The figure *{title}* is left out: {why}." for title, why in (undrawn or {}).items()),
        *_about_tests(records),
        "## Splits\n\n" + _splits(records),
        "## Variables\n\n" + _variables(records),
        "## Configuration\n\n" + _configuration(records),
    ]
    return "\n\n".join(section for section in sections if section) + "\n"


def _about_tests(records: xr.Dataset) -> list[str]:
    """Sections on drawn strain paths, or on tests on packings of grains."""
    if _in_plane(records):
        return plane_sections(records)
    return [
        "## How well the tests were controlled\n\n" + _quality(records),
        "## Scatter between packings\n\n" + _scatter(records),
    ]


def _in_plane(records: xr.Dataset) -> bool:
    return component_order(records["component"].values) == "plane"


def _identity(records: xr.Dataset) -> str:
    attributes = records.attrs
    rows = [
        ("paths × steps", f"{records.sizes['path']} × {records.sizes['step']}"),
        ("specimens", len(np.unique(records["specimen"].values.astype(str)))),
        ("conventions", attributes["conventions"]),
        ("generator", f"`{attributes['generator']}` {attributes['generator_version']}"),
        ("engine", f"{attributes['engine']} {attributes['engine_version']}"),
        ("thesis section", attributes["thesis_section"]),
        ("licence", attributes["licence"]),
        ("content SHA-256", f"`{attributes.get('content_sha256', 'not sealed')}`"),
        ("split SHA-256", f"`{split_hash(records)}`"),
    ]
    return table(("", ""), rows)


def _levels(records: xr.Dataset, name: str, scale: float = 1.0) -> str:
    values = np.unique(records[name].values)
    if values.dtype.kind == "f":
        values = np.unique(np.round(values[np.isfinite(values)] * scale, 6))
        return ", ".join(f"{value:g}" for value in values)
    return ", ".join(map(str, values))


def _design(records: xr.Dataset) -> str:
    factors = [
        ("grading", "gradings", 1.0),
        ("preparation_friction", "preparation frictions μ₀", 1.0),
        ("initial_mean_stress", "initial mean stresses p₀ [MPa]", 1e-6),
        ("intermediate_stress_ratio", "intermediate stress ratios b", 1.0),
        ("loading_family", "loading families", 1.0),
    ]
    present = [factor for factor in factors if factor[0] in records.coords]
    parts = [table(("factor", "levels"), ((t, _levels(records, n, s)) for n, t, s in present))]
    families = np.unique(records["loading_family"].values.astype(str))
    if "initial_mean_stress" in records.coords and not _in_plane(records):
        pressures = np.unique(records["initial_mean_stress"].values)
        parts.append(
            "Tests by family and pressure:\n\n"
            + _counts(records, "loading_family", families, "initial_mean_stress", pressures, 1e-6)
        )
        monotonic = select(records, loading_family=MONOTONIC_FAMILIES)
        if "intermediate_stress_ratio" in records.coords and monotonic.sizes["path"]:
            ratios = np.unique(monotonic["intermediate_stress_ratio"].values)
            parts.append(
                "Monotonic tests by intermediate stress ratio and pressure:\n\n"
                + _counts(
                    monotonic,
                    "intermediate_stress_ratio",
                    ratios,
                    "initial_mean_stress",
                    pressures,
                    1e-6,
                )
            )
    return "\n\n".join(parts)


def _counts(
    records: xr.Dataset,
    by: str,
    rows: np.ndarray,
    across: str,
    columns: np.ndarray,
    scale: float = 1.0,
) -> str:
    """Number of paths for each pair of levels."""
    down, along = records[by].values, records[across].values
    labels = [f"{value * scale:g}" if columns.dtype.kind == "f" else value for value in columns]
    title = {"initial_mean_stress": "p₀ [MPa]", "intermediate_stress_ratio": "b"}
    corner = " / ".join(title.get(name, name.replace("_", " ")) for name in (by, across))
    return table(
        (corner, *labels, "all"),
        (
            (
                f"{row:g}" if rows.dtype.kind == "f" else row,
                *(int(((down == row) & (along == column)).sum()) for column in columns),
                int((down == row).sum()),
            )
            for row in rows
        ),
    )


def _quality(records: xr.Dataset) -> str:
    rows = []
    for name, limit in QUALITY_LIMITS.items():
        if name in records.coords:
            values = records[name].values
            values = values[np.isfinite(values)]
            if values.size:
                median, high = np.quantile(values, (0.5, 0.95))
                shown = (f"{v:.2e}" for v in (median, high, values.max(), limit))
                rows.append((records[name].attrs.get("long_name", name), *shown))
    if not rows:
        return "The file records no control errors."
    return table(("measure, per path", "median", "95 %", "largest", "limit"), rows)


def _scatter(records: xr.Dataset) -> str:
    try:
        scatter = replicate_scatter(records)
    except DatasetError as error:
        return f"{error}."
    lateral = ", ".join(
        f"{component}: {rms:.4f}"
        for component, rms in zip(records["component"].values, scatter.stress_rms, strict=True)
    )
    rows = [
        ("specimens prepared a second time, with another seed", scatter.specimens),
        ("pairs of paths", scatter.pairs),
        ("RMS difference of stress / training standard deviation", lateral),
        ("normalised MSE between two packings", f"{scatter.stress_mse:.2e}"),
        ("normalised MSE of a model that predicts their mean", f"{scatter.floor_mse:.2e}"),
        ("the same for the median pair", f"{scatter.floor_median:.2e}"),
    ]
    if scatter.void_ratio_rms is not None:
        rows.append(("RMS difference of void ratio", f"{scatter.void_ratio_rms:.5f}"))
    return (
        "Two packings with the same grading and preparation, loaded in the same way, give "
        "different stresses; their strain and initial void ratio also differ slightly. The scatter "
        "over whole paths, from pairs in all splits, shows how close to the truth a model can be "
        "expected to come:\n\n" + table(("", ""), rows)
    )


def _splits(records: xr.Dataset) -> str:
    names = np.array(split_names(records))
    families = np.unique(records["loading_family"].values.astype(str))
    report = leak_report(records)
    distances = ", ".join(
        f"{pair} {distance:.3f}" for pair, distance in report.nearest_path_distance.items()
    )
    verdict = (
        "No specimen, preparation or path is in two splits."
        if report.clean
        else "**Splits share** "
        + "; ".join(
            [*report.shared_specimens, *report.shared_preparations]
            + [" = ".join(pair) for pair in report.identical_paths]
        )
        + "."
    )
    return (
        _counts(records, "split", names, "loading_family", families)
        + f"\n\n{verdict} Distance between the nearest paths of two splits, in standard "
        f"deviations: {distances}."
    )


def _variables(records: xr.Dataset) -> str:
    rows = (
        (
            f"`{name}`",
            ", ".join(map(str, variable.dims)),
            variable.attrs.get("units", "") or "–",
            variable.attrs.get("long_name", ""),
        )
        for name, variable in records.variables.items()
    )
    return table(("name", "dimensions", "units", "meaning"), rows)


def _configuration(records: xr.Dataset) -> str:
    """The configuration that the file carries, pretty-printed."""
    text = str(records.attrs["configuration"])
    with contextlib.suppress(ValueError):  # free text of a dataset that another program made
        text = json.dumps(json.loads(text), indent=1, ensure_ascii=False)
    return f"```json\n{text}\n```"
