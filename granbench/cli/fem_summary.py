"""Output of `granbench fem`: a sentence or JSON about an analysis."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from granbench.fem import Analysis


def output_steps(analysis: "Analysis") -> int:
    """Number of output steps that were reached after the start."""
    return max(0, analysis.dataset.sizes.get("step", 0) - 1)


def summary(
    analysis: "Analysis", out: Path, series: Path | None, plot: Path | None
) -> dict[str, object]:
    """The result of an analysis and its files, for --json."""
    from granbench.fem.remarks import first_implausible_step, first_turned_step, remarks

    found = analysis.dataset
    imbalance = float(found.attrs["initial_imbalance"])
    attributes = found.attrs
    last = found.isel(step=-1)
    result: dict[str, object] = {
        **{name: attributes[name] for name in ("problem", "cell", "solver", "mesh", "element")},
        "choices": json.loads(attributes["choices"]),
        "settings": json.loads(attributes["settings"]),
        "gauss_points": found.sizes["point"],
        "nodes": found.sizes["node"],
        "output_steps": output_steps(analysis),
        "driving_strain": float(last["driving_strain"]),
        "reaction": float(last["reaction"]),
        "largest_reaction": float(found["reaction"].max()),
        "volumetric_strain": float(last["volumetric_strain"]),
        "energy_error": float(abs(found["energy_error"]).max()),
        "initial_imbalance": imbalance if math.isfinite(imbalance) else None,
        "first_turned_step": first_turned_step(found),
        "first_implausible_step": first_implausible_step(found),
        "turned_elements": int(found["turned_elements"].max()),
        "warnings": remarks(found),
        "cell_seconds": float(last["cell_seconds"]),
        "solver_seconds": float(last["solver_seconds"]),
    }
    if "iterations" in found:
        result["iterations"] = int(found["iterations"].sum())
    else:
        result["maximum_acceleration"] = float(found["maximum_acceleration"].max())
    files = {"out": out, "vtu": series, "plot": plot}
    return result | {name: None if file is None else str(file) for name, file in files.items()}


def sentence(analysis: "Analysis", out: Path) -> str:
    """The result of an analysis, for people."""
    found = analysis.dataset
    last = found.isel(step=-1)
    cell_seconds = float(last["cell_seconds"])
    seconds = cell_seconds + float(last["solver_seconds"])
    points = f"{found.sizes['point']} Gauss points of {found.attrs['element']} elements"
    return (
        f"{out}: {found.attrs['problem']} with {found.attrs['cell']}, {found.attrs['solver']}, "
        f"{points}, {seconds:.3g} s ({cell_seconds:.3g} s in the model); reaction at the end "
        f"{float(last['reaction']) / 1e3:.4g} kN/m, largest "
        f"{float(found['reaction'].max()) / 1e3:.4g} kN/m; volumetric strain "
        f"{100.0 * float(last['volumetric_strain']):.3g} %"
    )
