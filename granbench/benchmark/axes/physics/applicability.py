"""Which checks apply: it follows from the task and the kind of model.

A predictions file says what was left out and why. That is believed only where the task, or what
the predictions themselves show of the model, allows it; any other reason is refused.
"""

import json
from collections.abc import Mapping

import xarray as xr

from granbench.benchmark.axes.physics.checks import (
    CARRIES_TENSION,
    CHECKS,
    COMPRESSION,
    NO_STRESS_OUT_OF_PLANE,
    NO_TANGENT,
    PHYSICS_OBSTACLES,
    PRINCIPAL,
    READS_RECORDS,
    ROTATION,
    TANGENT,
)
from granbench.benchmark.scored_task import ScoredPredictions
from granbench.errors import SubmissionError
from granbench.tensors import COMPONENT_ORDERS

OUT_OF_PLANE = "out_of_plane_stress"
LONGEST_REASON = 400


def physics_obstacles(scored: ScoredPredictions) -> dict[str, str]:
    """Why checks were left out, by name of the check.

    Parameters
    ----------
    scored : predictions with the attribute `PHYSICS_OBSTACLES`

    Raises
    ------
    SubmissionError
        If a check was left out that applies, or the attribute is damaged.
    """
    stated = _stated(scored.predictions)
    if scored.reads_records:
        return dict.fromkeys(CHECKS, READS_RECORDS)
    found = {}
    for name, reason in stated.items():
        known = _known_reason(name, reason, scored.records)
        if known is None:
            raise SubmissionError(
                f"the predictions say that the check {name!r} does not apply ({reason[:80]!r}), "
                "but on this task it applies to every model; run `granbench evaluate` again"
            )
        found[name] = known
    return found


def _stated(predictions: xr.Dataset) -> Mapping[str, str]:
    try:
        stated = json.loads(predictions.attrs[PHYSICS_OBSTACLES])
        if set(stated) <= set(CHECKS) and all(map(str.strip, stated.values())):
            return stated
    except (ValueError, TypeError, AttributeError, RecursionError):
        pass
    raise SubmissionError(
        f"the predictions' attribute {PHYSICS_OBSTACLES!r} does not say why which checks do not "
        "apply; run `granbench evaluate` again"
    )


def _known_reason(name: str, reason: str, records: xr.Dataset) -> str | None:
    """Why a check does not apply to the task, or to such a kind of model; None if it applies."""
    components = tuple(map(str, records["component"].values))
    if name == ROTATION and components == COMPONENT_ORDERS["principal"]:
        return PRINCIPAL
    if name == COMPRESSION:
        # Scoring needs no torch, but which laws depend on pressure only the laws themselves know.
        from granbench.models.ground_truth import holds_no_tension

        if not holds_no_tension(records):
            return CARRIES_TENSION
        if OUT_OF_PLANE in records and reason == NO_STRESS_OUT_OF_PLANE:
            return NO_STRESS_OUT_OF_PLANE
    if name == TANGENT and reason.startswith(NO_TANGENT) and reason.isprintable():
        return reason[:LONGEST_REASON]
    return None
