"""Sections of the card of drawn strain paths, in Markdown."""

import json

import xarray as xr

from granbench.data.markdown import table
from granbench.data.splits import select_split, split_names
from granbench.data.strain_paths import StrainPathStatistics, strain_path_statistics


def plane_sections(records: xr.Dataset) -> list[str]:
    """Sections on model, strain paths, scaling and rounding, as far as the attributes give them.

    Parameters
    ----------
    records : in the `plane` order
    """
    titled = {
        "Ground truth": _ground_truth(records),
        "Strain paths": _strain_paths(records),
        "Admissible paths": records.attrs.get("admissible_scaling"),
        "Rounding": _sentence(records.attrs.get("rounding")),
        "Tangents": _sentence(records.attrs.get("tangents")),
        "Steps": _sentence(records.attrs.get("thinning")),
    }
    return [f"## {title}\n\n{text}" for title, text in titled.items() if text]


def _sentence(text: str | None) -> str | None:
    return f"{text[0].upper()}{text[1:]}." if text else None


def _ground_truth(records: xr.Dataset) -> str | None:
    if "ground_truth" not in records.attrs:
        return None
    truth = json.loads(records.attrs["ground_truth"])
    rows = [
        (name.replace("_", " "), f"{value:g}", truth["units"].get(name, ""))
        for name, value in truth["parameters"].items()
    ]
    return f"Every path is the response of the model `{truth['model']}`.\n\n" + table(
        ("parameter", "value", "unit"), rows
    )


def _strain_paths(records: xr.Dataset) -> str:
    components = ", ".join(map(str, records["component"].values))
    header = (
        "split",
        "paths",
        "median norm of an increment",
        f"standard deviation of strain {components}",
        "largest strain",
        f"standard deviation of stress {components} [kPa]",
        "median volumetric factor",
        "steps with a tensile principal stress [%]",
    )
    rows = [
        (split, *_row(strain_path_statistics(select_split(records, split))))
        for split in split_names(records)
    ]
    # Columns that do not apply to the dataset are left out.
    shown = [number for number in range(len(header)) if any(row[number] for row in rows)]
    return table([header[i] for i in shown], ([row[i] for i in shown] for row in rows))


def _row(found: StrainPathStatistics) -> tuple[str, ...]:
    factor, share = found.median_volumetric_factor, found.tensile_share
    return (
        str(found.paths),
        f"{found.median_increment:.2e}",
        ", ".join(f"{value:.3f}" for value in found.strain_std.values()),
        f"{found.largest_strain:.3f}",
        ", ".join(f"{1e-3 * value:.0f}" for value in found.stress_std.values()),
        "" if factor is None else f"{factor:.2f}",
        "" if share is None else f"{100.0 * share:.1f}",
    )
