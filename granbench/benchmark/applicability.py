"""Which axes and checks apply: it follows from the task and the kind of model.

A predictions file says what was left out and why. That is believed only where the task, or what
the predictions themselves show of the model, allows it; whatever else a file says of itself is
refused.
"""

import json
from collections.abc import Mapping

import xarray as xr

from granbench.benchmark.axes.physics.checks import (
    CARRIES_TENSION,
    CHECKS,
    NO_STRESS_OUT_OF_PLANE,
    NO_TANGENT,
    PRINCIPAL,
    READS_RECORDS,
)
from granbench.benchmark.predictions import PHYSICS_OBSTACLES
from granbench.errors import SubmissionError
from granbench.fem.statement import NOT_IN_THE_PLANE
from granbench.fem.statement import READS_RECORDS as NONE_IN_AN_ANALYSIS
from granbench.tensors import COMPONENT_ORDERS

OUT_OF_PLANE = "out_of_plane_stress"
LONGEST_REASON = 400
ERRORS = ("stress_squared_error", "void_ratio_squared_error")


def reads_records(predictions: xr.Dataset, statistics: xr.Dataset) -> bool:
    """Whether the model looks its answers up in the records, as a ceiling does.

    Parameters
    ----------
    predictions : see `granbench.benchmark.predictions`
    statistics : of every path, see `granbench.benchmark.statistics.path_statistics`

    Raises
    ------
    SubmissionError
        If the predictions say so, but are not the records.
    """
    if not predictions.attrs.get("reads_records"):
        return False
    if any(bool((statistics[name] != 0.0).any()) for name in ERRORS if name in statistics):
        raise SubmissionError(
            "the predictions say that the model reads its answers from the records, but they are "
            "not the records; only a ceiling, whose errors are zero, is excused from the axes that "
            "need a model: run `granbench evaluate` again"
        )
    return True


def embedded_obstacle(truth: xr.Dataset, reads: bool) -> str | None:
    """Why the analyses that a dataset states do not apply, or None.

    Parameters
    ----------
    truth : the scored records
    reads : see `reads_records`
    """
    if tuple(map(str, truth["component"].values)) != COMPONENT_ORDERS["plane"]:
        return NOT_IN_THE_PLANE
    return NONE_IN_AN_ANALYSIS if reads else None


def physics_obstacles(predictions: xr.Dataset, truth: xr.Dataset, reads: bool) -> dict[str, str]:
    """Why checks were left out, by name of the check.

    Parameters
    ----------
    predictions : see `granbench.benchmark.predictions`; with the attribute `PHYSICS_OBSTACLES`
    truth : the scored records
    reads : see `reads_records`

    Raises
    ------
    SubmissionError
        If a check was left out that applies, or the attribute is damaged.
    """
    stated = _stated(predictions)
    if reads:
        return dict.fromkeys(CHECKS, READS_RECORDS)
    found = {}
    for name, reason in stated.items():
        known = _known_reason(name, reason, truth)
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


def _known_reason(name: str, reason: str, truth: xr.Dataset) -> str | None:
    """Why a check does not apply to the task, or to such a kind of model; None if it applies."""
    if (
        name == "rotation"
        and tuple(map(str, truth["component"].values)) == (COMPONENT_ORDERS["principal"])
    ):
        return PRINCIPAL
    if name == "compression":
        # Scoring needs no torch, but which laws depend on pressure only the laws themselves know.
        from granbench.models.ground_truth import holds_no_tension

        if not holds_no_tension(truth):
            return CARRIES_TENSION
        if OUT_OF_PLANE in truth and reason == NO_STRESS_OUT_OF_PLANE:
            return NO_STRESS_OUT_OF_PLANE
    if name == "tangent" and reason.startswith(NO_TANGENT) and reason.isprintable():
        return reason[:LONGEST_REASON]
    return None
