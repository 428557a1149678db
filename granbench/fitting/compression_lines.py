"""Starting values of the compression lines, read from oedometer tests.

A search that starts from another soil often stays on the swelling line: the specimen counts as so
heavily overconsolidated that it never yields, and nothing changes the virgin compression line.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from granbench.fitting.test_batch import TestBatch

LAMBDA, KAPPA = "compression_slope", "swelling_slope"
INTERCEPTS = ("compression_intercept", "low_pressure_intercept")

YIELD_OVER_MEAN = 1.36
"""Size of the yield surface of modified Cam-Clay over p along K0 = 0.5, with M = 1.25."""

LEAST_KAPPA = 0.15
GREATEST_KAPPA = 0.8
"""Bounds of kappa as a share of lambda: without lateral strain the first unloading is stiffer than
kappa, because q decreases with p, and a start that is too stiff fails."""


def compression_lines(batches: Sequence[TestBatch], names: Sequence[str]) -> dict[str, float]:
    """Lambda, kappa and the intercept at 1 kPa from the first oedometer test; empty without one.

    Parameters
    ----------
    batches : of the fit
    names : free parameters; a model that has no compression lines gets none
    """
    if LAMBDA not in names or KAPPA not in names:
        return {}
    for batch in batches:
        ratio = batch.conditions.scalars.get("initial_void_ratio")
        if batch.kind == "oedometer" and ratio is not None:
            found = _lines(batch, float(ratio[0]))
            return {name: value for name, value in found.items() if name in names}
    return {}


def _lines(batch: TestBatch, first_void_ratio: float) -> Mapping[str, float]:
    rows = np.flatnonzero(batch.weight[0, :, 0].numpy() > 0.0)
    rows = np.concatenate([[0], rows])
    stress = batch.control.targets[0, rows, 0]
    void_ratio = (1.0 + first_void_ratio) * np.exp(-batch.observed[0, rows, 0].numpy()) - 1.0
    logarithm = np.log(stress)
    moved = np.abs(np.diff(logarithm)) > 1e-3
    slopes = -np.diff(void_ratio)[moved] / np.diff(logarithm)[moved]
    largest = np.maximum.accumulate(stress)
    virgin = (stress[1:] >= largest[1:])[moved]
    steepest = float(slopes[virgin].max(initial=0.0))
    if not steepest > 0.0:
        return {}
    swelling = float(np.median(slopes[~virgin])) if (~virgin).any() else 0.2 * steepest
    kappa = min(max(swelling, LEAST_KAPPA * steepest), GREATEST_KAPPA * steepest)
    top = int(stress.argmax())
    k0 = float(batch.conditions.stress[0, 2] / batch.conditions.stress[0, 0])
    p = stress[top] * (1.0 + 2.0 * k0) / 3.0 / 1e3
    size = np.log(YIELD_OVER_MEAN)
    intercept = float(void_ratio[top] + steepest * (np.log(p) + size) - kappa * size)
    # No start may be looser than the line.
    first = stress[0] * (1.0 + 2.0 * k0) / 3.0 / 1e3
    loosest = first_void_ratio + steepest * (np.log(first) + size) - kappa * size
    intercept = max(intercept, float(loosest) + 0.1 * steepest)
    return {LAMBDA: steepest, KAPPA: kappa, **dict.fromkeys(INTERCEPTS, intercept)}
