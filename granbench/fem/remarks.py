"""Remarks on an analysis: conditions that do not stop it but limit its results."""

from __future__ import annotations

import json
import math

import numpy as np
import xarray as xr

from granbench.fem.gauss_points import UNSTRESSED
from granbench.fem.operators import ORDER
from granbench.tensors import volumetric_strain

LARGEST_VOLUMETRIC_STRAIN = 0.5
"""Largest credible volumetric strain: no soil changes its volume by more than half."""

LARGEST_IMBALANCE = 0.01
"""Largest imbalance that is tolerated, relative to the stress at the start."""


def remarks(dataset: xr.Dataset) -> list[str]:
    """Sentences about an analysis, finished or not; empty if there is nothing to remark.

    Parameters
    ----------
    dataset : of an analysis, as it is in its file
    """
    about_mesh = [
        f"mesh {dataset.attrs['mesh']}: {note}"
        for note in json.loads(dataset.attrs.get("mesh_notes", "[]"))
    ]
    about_model = str(dataset.attrs.get("notes", "")).splitlines()
    found = _imbalance(dataset), _volume(dataset), _turned(dataset)
    return [*about_mesh, *about_model, *(sentence for sentence in found if sentence is not None)]


def first_implausible_step(dataset: xr.Dataset) -> int | None:
    """The first output step with a volumetric strain that no soil has; None if there is none."""
    steps = np.flatnonzero(_largest_volumetric_strain(dataset) > LARGEST_VOLUMETRIC_STRAIN)
    return int(steps[0]) if steps.size else None


def _largest_volumetric_strain(dataset: xr.Dataset) -> np.ndarray:
    """Largest absolute value at any Gauss point, (step,)."""
    strain = dataset["strain"].values
    return np.asarray(np.abs(volumetric_strain(strain, ORDER)).max(axis=1, initial=0.0))


def first_turned_step(dataset: xr.Dataset) -> int | None:
    """The first output step at which an element has turned over; None if none has."""
    turned = np.flatnonzero(dataset["turned_elements"].values)
    return int(turned[0]) if turned.size else None


def _imbalance(dataset: xr.Dataset) -> str | None:
    share = float(dataset.attrs["initial_imbalance"])
    if share <= LARGEST_IMBALANCE:
        return None
    model = dataset.attrs["cell"]
    if math.isinf(share):
        return (
            f"{model} gives no finite stress at the start, at zero strain; choose another start or "
            "another model"
        )
    imposed = float(np.abs(dataset["stress"].values[0]).max()) or UNSTRESSED
    return (
        f"the analysis starts out of balance: at zero strain, {model} changes the imposed stress "
        f"by up to {100.0 * share:.3g} % of {imposed / 1e3:.4g} kPa; choose a confinement at which "
        "the model was trained"
    )


def _volume(dataset: xr.Dataset) -> str | None:
    step = first_implausible_step(dataset)
    if step is None:
        return None
    largest = _largest_volumetric_strain(dataset)
    mean = dataset["volumetric_strain"].values
    worst = float(mean[np.abs(mean).argmax()])
    return (
        f"the volumetric strain is not credible: {100.0 * largest[step]:.3g} % at a Gauss point by "
        f"output step {step}, at driving strain {float(dataset['driving_strain'][step]):.4g}, "
        f"{100.0 * largest.max():.3g} % at most, and {100.0 * worst:.3g} % in the mean over the "
        f"body; the loading goes beyond small strains, or {dataset.attrs['cell']} is outside of "
        "its range: do not use the results from that step on"
    )


def _turned(dataset: xr.Dataset) -> str | None:
    step = first_turned_step(dataset)
    if step is None:
        return None
    counts = dataset["turned_elements"].values
    strain = float(dataset["driving_strain"][step])
    return (
        f"elements have turned over, {int(counts[step])} by output step {step} at driving strain "
        f"{strain:.4g} and {int(counts.max())} at most, which no body can do: small-strain theory "
        "does not apply; end the loading earlier"
    )
