"""The scorecard: scores and error curves of a model on a task, as they are written down."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

ALL = "all"


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Score(_Record):
    """One number of the board, or the reason why there is none."""

    axis: str = Field(description="benchmark axis")
    protocol: str = Field(
        description="how the predictions were made: the protocol, the check or the solver"
    )
    split: str = Field(
        description="the paths that were scored; 'all' for a score that belongs to no split"
    )
    group: str = Field(
        default=ALL,
        description="'all', or one loading family of the split, or one analysis",
    )
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
    n: int = Field(default=0, ge=0, description="number of paths or analyses, failed ones included")
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


def _headline_metric() -> str:
    from granbench.benchmark.registry import headline_axis

    headline = headline_axis().headline
    assert headline is not None  # that is what the axis was chosen by
    return headline.metric


class Curve(_Record):
    """An error against the horizon: steps since truth was given, or output steps of an analysis.

    Along paths it is the mean squared normalised stress error, in an analysis the share of error
    points.
    """

    protocol: str
    split: str
    group: str = Field(default=ALL, description="'all', or one analysis")
    metric: str = Field(
        default_factory=_headline_metric,
        description="what is drawn; where it is missing, the metric that models are ranked by",
    )
    unit: str = "1"
    n: int = Field(ge=1, description="number of paths or analyses")
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
    def key(self) -> tuple[str, str, str, str]:
        """What makes a curve unique within a submission."""
        return (self.protocol, self.split, self.group, self.metric)


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
        """Whether every error against the records is exactly zero, as only the truth can be.

        Axes that are not compared with the records say nothing of it (`Axis.against_records`):
        persistence breaks no law, and in an analysis the model that made the records is as good
        as they are.
        """
        from granbench.benchmark.registry import axes

        against_records = {name for axis in axes() if axis.against_records for name in axis.names}
        errors = [
            score.value
            for score in self.scores
            if score.axis in against_records and score.status == "scored"
        ]
        return bool(errors) and not any(errors)

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


def rounded(value: Any) -> float:
    """Nine significant digits: more than any meaning, fewer than differ between machines."""
    return float(f"{float(value):.9g}")
