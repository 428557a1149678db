"""The scorecard: every score of a model, from its predictions and the truth alone."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any, Literal

import numpy as np
import xarray as xr
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from granbench.data.normalisation import Normalisation
from granbench.predictions import PROTOCOLS, ProtocolSpec
from granbench.scoring.bootstrap import Resampling, weighted_mean
from granbench.scoring.metrics import METRIC_VERSION, Metric, metrics
from granbench.scoring.statistics import horizon_means, path_statistics

ALL = "all"
UNMEASURED = {
    "embedded": "this task has no boundary-value problem with a ground-truth cell",
    "physics": f"metric version {METRIC_VERSION} does not measure the physics axis",
    "cost": "this task has no ground-truth cell to compare the cost with",
}
CURVE_HORIZONS = 61


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Score(_Record):
    """One number of the board, or the reason why there is none."""

    axis: str = Field(description="benchmark axis")
    protocol: str = Field(description="how the predictions were made")
    split: str = Field(description="the paths that were scored")
    group: str = Field(default=ALL, description="'all', or one loading family of the split")
    metric: str
    status: Literal["scored", "not_applicable", "not_run"]
    value: FiniteFloat | None = Field(default=None, description="mean over seeds; worst: largest")
    low: FiniteFloat | None = Field(
        default=None, description="lower end of the 95 % bootstrap interval; null: none"
    )
    high: FiniteFloat | None = Field(
        default=None, description="upper end of the 95 % bootstrap interval; null: none"
    )
    unit: str = "1"
    n: int = Field(default=0, ge=0, description="number of paths, failed ones included")
    by_seed: tuple[FiniteFloat, ...] = Field(default=(), description="the value of each seed")
    reason: str | None = Field(default=None, description="why there is no value")

    @model_validator(mode="after")
    def _value_or_reason(self) -> "Score":
        if (self.status == "scored") == (self.value is None):
            raise ValueError("a value is needed if and only if the status is 'scored'")
        if self.status != "scored" and not self.reason:
            raise ValueError("a reason is needed where there is no value")
        return self

    @property
    def key(self) -> tuple[str, str, str, str, str]:
        """What makes a score unique within a submission."""
        return (self.axis, self.protocol, self.split, self.group, self.metric)


class Curve(_Record):
    """Mean squared normalised stress error against the horizon: steps since truth was given."""

    protocol: str
    split: str
    metric: Literal["stress_mse_mean"] = "stress_mse_mean"
    unit: str = "1"
    n: int = Field(ge=1, description="number of paths")
    horizon: tuple[int, ...]
    value: tuple[FiniteFloat, ...]
    low: tuple[FiniteFloat, ...] = Field(default=(), description="empty for one specimen alone")
    high: tuple[FiniteFloat, ...] = ()

    @model_validator(mode="after")
    def _same_length(self) -> "Curve":
        ends = {len(self.low), len(self.high)}
        if len(self.horizon) != len(self.value) or ends not in ({0}, {len(self.value)}):
            raise ValueError("horizon, value, low and high differ in length")
        return self

    @property
    def key(self) -> tuple[str, str, str]:
        """What makes a curve unique within a submission."""
        return (self.protocol, self.split, self.metric)


class Scales(_Record):
    """Standard deviations of the training split that errors were divided by."""

    stress: dict[str, FiniteFloat] = Field(description="by component, Pa")
    void_ratio: FiniteFloat | None = None


class Scorecard(_Record):
    """Scores and error curves of one model on one task."""

    metric_version: str
    normalisation: Scales
    scores: tuple[Score, ...]
    curves: tuple[Curve, ...]

    @property
    def perfect(self) -> bool:
        """Whether every score is exactly zero, as only the truth itself can be."""
        return not any(score.value for score in self.scores)

    def find(self, protocol: str, split: str, metric: str, group: str = ALL) -> Score:
        """One score.

        Raises
        ------
        KeyError
            If the card has none of that name.
        """
        for score in self.scores:
            if (score.protocol, score.split, score.group, score.metric) == (
                protocol, split, group, metric,
            ):  # fmt: skip
                return score
        raise KeyError(f"no score {metric} for {protocol} on {split}, {group}")


def score(predictions: xr.Dataset, truth: xr.Dataset, normalisation: Normalisation) -> Scorecard:
    """Score predictions against the records.

    Parameters
    ----------
    predictions : see `granbench.predictions`
    truth : the records of exactly the predicted paths
    normalisation : training standard deviations

    Raises
    ------
    SubmissionError
        If the predictions do not fit the records.
    """
    statistics = path_statistics(predictions, truth, normalisation)
    scores = list(_every_score(statistics))
    curves = list(_every_curve(statistics))
    components = [str(label) for label in truth["component"].values]
    std = normalisation.std
    return Scorecard(
        metric_version=METRIC_VERSION,
        normalisation=Scales(
            stress=dict(zip(components, map(_digits, std["stress"]), strict=True)),
            void_ratio=_digits(std["void_ratio"]) if "void_ratio" in std else None,
        ),
        scores=tuple(scores),
        curves=tuple(curves),
    )


def _every_score(statistics: xr.Dataset) -> Iterator[Score]:
    splits = statistics["split"].values.astype(str)
    families = statistics["loading_family"].values.astype(str)
    for split in _split_order(splits):
        yield from _scores_of(statistics, splits == split, split, ALL)
        for family in sorted(set(families[splits == split])):
            yield from _scores_of(
                statistics, (splits == split) & (families == family), split, family
            )
        for axis, reason in UNMEASURED.items():
            yield Score(
                axis=axis, protocol=axis, split=split, metric=ALL, status="not_applicable",
                reason=reason,
            )  # fmt: skip


def _scores_of(
    statistics: xr.Dataset, chosen: np.ndarray, split: str, group: str
) -> Iterator[Score]:
    member = statistics.isel(path=np.flatnonzero(chosen))
    resampling = Resampling.by_specimen(member["specimen"].values)
    table = metrics([str(label) for label in statistics["component"].values])
    shown = [metric for metric in table if group == ALL or metric.by_family]
    present = list(member["protocol"].values)
    for spec in PROTOCOLS.values():
        found = member.isel(protocol=present.index(spec.name)) if spec.name in present else None
        columns = (
            {str(name): found[name].values for name in found.data_vars}
            if found is not None
            else None
        )
        for metric in shown:
            yield _one_score(
                columns, resampling, spec, metric, split=split, group=group,
                n=member.sizes["path"],
            )  # fmt: skip


def _one_score(
    columns: dict[str, np.ndarray] | None,
    resampling: Resampling,
    spec: ProtocolSpec,
    metric: Metric,
    **place: Any,
) -> Score:
    place |= {
        "axis": spec.axis, "protocol": spec.name, "metric": metric.name, "unit": metric.unit,
    }  # fmt: skip
    if columns is None:
        reason = f"axis {spec.axis} was left out of the evaluation"
        return Score(**place, status="not_run", reason=reason)
    obstacle = metric.obstacle(spec, list(columns))
    if obstacle is not None:
        return Score(**place, status="not_applicable", reason=obstacle)
    values = columns[metric.statistic]
    if metric.component is not None:
        values = values[..., metric.component]
    value = metric.estimate(values)
    if not math.isfinite(value):
        reason = "in some seed fewer than half of the paths diverge"
        return Score(**place, status="not_applicable", reason=reason)
    resampled = metric.resampled(values)
    interval = resampling.interval(resampled) if resampled else None
    low, high = interval or (math.inf, math.inf)
    return Score(
        **place,
        status="scored",
        value=_digits(value),
        low=_digits(low) if math.isfinite(low) else None,
        high=_digits(high) if math.isfinite(high) else None,
        by_seed=tuple(_digits(single) for single in metric.by_seed(values)),
    )


def _every_curve(statistics: xr.Dataset) -> Iterator[Curve]:
    splits = statistics["split"].values.astype(str)
    for split in _split_order(splits):
        member = statistics.isel(path=np.flatnonzero(splits == split))
        resampling = Resampling.by_specimen(member["specimen"].values)
        for spec in PROTOCOLS.values():
            if spec.restart == 1 or spec.name not in member["protocol"].values:
                continue
            step_error = member["step_squared_error"].sel(protocol=spec.name).mean("seed").values
            horizon, errors = horizon_means(step_error, spec.name)
            shown = np.unique(np.linspace(0, len(horizon) - 1, CURVE_HORIZONS).round().astype(int))
            errors = errors[:, shown]
            low, high = resampling.interval(partial(weighted_mean, errors)) or ((), ())
            yield Curve(
                protocol=spec.name,
                split=split,
                n=member.sizes["path"],
                horizon=tuple(int(value) for value in horizon[shown]),
                value=tuple(_digits(value) for value in errors.mean(axis=0)),
                low=tuple(_digits(value) for value in low),
                high=tuple(_digits(value) for value in high),
            )


def _split_order(splits: np.ndarray) -> list[str]:
    return sorted(set(splits), key=lambda name: (name != "test", name))


def _digits(value: Any) -> float:
    """Nine significant digits: more than any meaning, fewer than differ between machines."""
    return float(f"{float(value):.9g}")
