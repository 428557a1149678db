"""The axes whose predictions are compared with recorded paths: one family of four.

They differ in how much of the truth a model is given (`protocols`), and share their variables in
the predictions file and their metrics.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import xarray as xr

from granbench.benchmark.axes.along_paths.metrics import HEADLINE, METRICS, NAME
from granbench.benchmark.axes.along_paths.path_errors import (
    PathErrors,
    horizon_means,
    no_noised_truth,
)
from granbench.benchmark.axes.along_paths.protocols import (
    AXES,
    NOISE_PROTOCOLS,
    PROTOCOLS,
    ROLLOUT,
    ProtocolSpec,
)
from granbench.benchmark.axis import Axis, Group, Highlight, Part, Stored
from granbench.benchmark.bootstrap import Resampling, weighted_mean
from granbench.benchmark.presentation import BoardView, ModelView, Section, TextTable
from granbench.benchmark.scorecard import ALL, Curve, rounded
from granbench.benchmark.scored_task import ScoredPredictions
from granbench.benchmark.section_file import section_file
from granbench.benchmark.tolerance import TRUTH_TOLERANCE
from granbench.data.splits import split_names
from granbench.errors import SubmissionError

if TYPE_CHECKING:
    from granbench.benchmark.evaluation_run import EvaluationRun

CURVE_HORIZONS = 61
"""Largest number of steps that a curve has."""


class AlongPaths(Axis):
    """Single steps, windows, whole paths and noised whole paths, compared with the records."""

    name = NAME
    title = "Along recorded paths"
    order = 10
    parts = tuple(PROTOCOLS.values())
    own_metrics = METRICS
    against_records = True
    tells_models_apart = True
    headline = Highlight(ROLLOUT, "test", HEADLINE, "rollout, test paths")
    labels: ClassVar[Mapping[str, Sequence[str]]] = {"noise": NOISE_PROTOCOLS}
    layout: ClassVar[Mapping[str, Stored]] = {
        "stress": Stored(
            ("seed", "protocol", "path", "step", "component"),
            "Pa",
            "predicted stress, compression positive",
        ),
        "void_ratio": Stored(("seed", "protocol", "path", "step"), "1", "predicted void ratio"),
        "noised_truth": Stored(
            ("seed", "noise", "path", "step", "component"),
            "Pa",
            "stress of the ground truth along the noised strain, compression positive",
        ),
    }

    @property
    def names(self) -> tuple[str, ...]:
        """See `Axis`."""
        return AXES

    def predict(self, run: "EvaluationRun") -> xr.Dataset:
        """See `Axis.predict`."""
        from granbench.benchmark.axes.along_paths.predict import path_predictions

        return path_predictions(run)

    def rounds(self, chosen: Sequence[str]) -> int:
        """See `Axis.rounds`."""
        return sum(spec.axis in chosen for spec in PROTOCOLS.values())

    def answers(self, predicted: xr.Dataset) -> list[np.ndarray] | None:
        """See `Axis.answers`: the stresses of the protocols that draw no noise."""
        if "stress" not in predicted or "protocol" not in predicted.dims:
            return None
        drawn = np.isin(predicted["protocol"].values.astype(str), NOISE_PROTOCOLS)
        if drawn.all():
            return None
        return [stress[~drawn] for stress in predicted["stress"].values]

    def file_complaints(self, predictions: xr.Dataset) -> Iterator[str]:
        """See `Axis.file_complaints`."""
        if "protocol" not in predictions.dims:
            return
        if "stress" not in predictions.data_vars:
            yield "lacks the variable 'stress'"
        if "first_predicted_step" not in predictions.coords:
            yield "lacks the coordinate 'first_predicted_step'"
            return
        first = predictions["first_predicted_step"]
        if first.dtype.kind not in "iu":
            yield "'first_predicted_step' does not hold integers"
        if first.dims != ("protocol",):
            yield "'first_predicted_step' must have the dimension 'protocol' alone"

    def label_complaints(self, predictions: xr.Dataset) -> Iterator[str]:
        """See `Axis.label_complaints`."""
        if "protocol" not in predictions.dims:
            return
        labels = predictions["protocol"].values
        for label, first in zip(labels, predictions["first_predicted_step"].values, strict=True):
            if label not in PROTOCOLS:
                yield f"unknown protocol {label!r}; known are {', '.join(PROTOCOLS)}"
            elif first != PROTOCOLS[label].first_predicted_step:
                yield (
                    f"protocol {label} counts from step {first}, but the benchmark counts from "
                    f"step {PROTOCOLS[label].first_predicted_step} (first_predicted_step)"
                )

    def was_run(self, predictions: xr.Dataset, part: Part) -> bool:
        """See `Axis.was_run`."""
        return "protocol" in predictions.coords and part.name in predictions["protocol"].values

    def check(self, scored: ScoredPredictions) -> None:
        """See `Axis.check`: every noised prediction needs the truth along the same strain."""
        predictions = scored.predictions
        predicted = set(predictions["protocol"].values) if "protocol" in predictions.coords else ()
        if predicted and "stress" not in predictions:
            raise SubmissionError("the predictions lack 'stress'; run `granbench evaluate` again")
        noised = set(predictions["noise"].values) if "noised_truth" in predictions else set()
        if noised - set(predicted):
            raise SubmissionError(
                "the predictions hold a truth for noise (noised_truth) that they do not hold a "
                "prediction for; run `granbench evaluate` again"
            )
        missing = set(predicted) & set(NOISE_PROTOCOLS) - noised
        if missing and no_noised_truth(scored) is None:
            raise SubmissionError(
                f"the predictions lack the ground truth along the strain of {min(missing)} "
                "(noised_truth); run `granbench evaluate` again"
            )

    def is_truth(self, scored: ScoredPredictions) -> bool:
        """See `Axis.is_truth`."""
        for spec in PROTOCOLS.values():
            if self.was_run(scored.predictions, spec):
                errors = self.sample(scored, spec)
                if errors.by_component.any():
                    return False
                if errors.void_ratio is not None and errors.void_ratio_error.any():
                    return False
        return True

    def check_ground_truth(self, scored: ScoredPredictions) -> None:
        """See `Axis.check_ground_truth`: `noised_truth` is computed again."""
        predictions = scored.predictions
        if "noised_truth" not in predictions:
            return
        from granbench.benchmark.axes.along_paths.predict import noised_truth

        for seed in predictions["seed"].values:
            for name in predictions["noise"].values:
                stored = predictions["noised_truth"].sel(seed=seed, noise=name).values
                again = noised_truth(scored.task, PROTOCOLS[name], int(seed))
                scale = np.maximum(np.abs(again), scored.normalisation.std["stress"])
                difference = np.abs(stored - again) / scale
                same = np.isnan(stored) == np.isnan(again)
                if not same.all() or np.nanmax(difference, initial=0.0) > TRUTH_TOLERANCE:
                    raise SubmissionError(
                        f"the predictions' ground truth (noised_truth) for {name}, seed {seed}, is "
                        "not what the ground truth gives; run `granbench evaluate` again"
                    )

    def sample(self, scored: ScoredPredictions, part: Part) -> PathErrors:
        """See `Axis.sample`."""
        assert isinstance(part, ProtocolSpec)
        return PathErrors.of(scored, part)

    def places(self, scored: ScoredPredictions, split: str) -> Iterable[tuple[Part, Group]]:
        """See `Axis.places`: every protocol of the whole split, then of each loading family."""
        records = scored.records
        inside = records["split"].values.astype(str) == split
        if not inside.any():
            return
        families = records["loading_family"].values.astype(str)
        groups = {ALL: inside} | {
            family: inside & (families == family) for family in sorted(set(families[inside]))
        }
        specimens = records["specimen"].values
        for name, chosen in groups.items():
            rows = np.flatnonzero(chosen)
            group = Group(split, name, len(rows), rows, Resampling.by_specimen(specimens[rows]))
            for spec in PROTOCOLS.values():
                yield spec, group

    def curves(self, scored: ScoredPredictions) -> Iterator[Curve]:
        """See `Axis.curves`: the headline error against the steps since truth was given."""
        splits = scored.records["split"].values.astype(str)
        specimens = scored.records["specimen"].values
        for split in split_names(scored.records):
            rows = np.flatnonzero(splits == split)
            resampling = Resampling.by_specimen(specimens[rows])
            for spec in PROTOCOLS.values():
                if spec.restart == 1 or not self.was_run(scored.predictions, spec):
                    continue
                step_error = scored.sample(self, spec).step_error.mean(axis=0)[rows]
                horizon, errors = horizon_means(step_error, spec.name)
                last = len(horizon) - 1
                shown = np.unique(np.linspace(0, last, CURVE_HORIZONS).round().astype(int))
                errors = errors[:, shown]
                low, high = resampling.interval(partial(weighted_mean, errors)) or ((), ())
                yield Curve(
                    protocol=spec.name,
                    split=split,
                    metric=HEADLINE,
                    n=len(rows),
                    horizon=tuple(int(value) for value in horizon[shown]),
                    value=tuple(rounded(value) for value in errors.mean(axis=0)),
                    low=tuple(rounded(value) for value in low),
                    high=tuple(rounded(value) for value in high),
                )

    def text_tables(self, model: ModelView, split: str) -> Iterator[TextTable | str]:
        """See `Axis.text_tables`."""
        from granbench.benchmark.axes.along_paths.tables import text_tables

        yield from text_tables(self, model, split)

    def board_sections(self, board: BoardView) -> Iterator[Section]:
        """See `Axis.board_sections`."""
        from granbench.benchmark.axes.along_paths.tables import board_sections

        yield from board_sections(self, board)

    def glossary(self, board: BoardView) -> Iterator[tuple[str, str]]:
        """See `Axis.glossary`."""
        from granbench.benchmark.axes.along_paths.tables import glossary

        yield from glossary(self, board)

    def section(self) -> str:
        """See `Axis.section`."""
        return section_file(self, __file__)


AXIS = AlongPaths()
