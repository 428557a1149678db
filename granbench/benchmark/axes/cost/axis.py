"""The cost axis: parameters, time of training, and time for each stress update."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import xarray as xr

from granbench.benchmark.axes.cost.metrics import (
    METRICS,
    NAME,
    PARAMETERS,
    POINTS,
    TRAINING,
    TRUTH_UPDATE,
    UPDATE,
    Costs,
)
from granbench.benchmark.axis import Axis, Group, Part, Stored
from granbench.benchmark.presentation import (
    Block,
    BoardView,
    Column,
    ModelTable,
    ModelView,
    Section,
    TextTable,
    found_scores,
)
from granbench.benchmark.score_text import cell, written
from granbench.benchmark.scorecard import ALL
from granbench.benchmark.scored_task import ScoredPredictions
from granbench.benchmark.section_file import section_file
from granbench.benchmark.standard_tables import plugged_in_definitions
from granbench.data.markdown import table
from granbench.errors import SubmissionError

if TYPE_CHECKING:
    from granbench.benchmark.evaluation_run import EvaluationRun


class Cost(Axis):
    """What a model costs, whatever it is worth."""

    name = NAME
    title = "Cost"
    order = 40
    since = "1.1"
    parts = (Part(name=NAME, axis=NAME, title="Cost"),)
    own_metrics = METRICS
    layout: ClassVar[Mapping[str, Stored]] = {
        PARAMETERS: Stored(("seed",), "1", "trained or fitted parameters", exact=True),
        TRAINING: Stored(("seed",), "s", "time of training; NaN: not known"),
        UPDATE: Stored(("seed", "points"), "s", "CPU time of one update of one point"),
        TRUTH_UPDATE: Stored(
            ("seed", "points"), "s", "the same of the ground truth, in the same process"
        ),
    }

    def predict(self, run: "EvaluationRun") -> xr.Dataset:
        """See `Axis.predict`."""
        from granbench.benchmark.axes.cost.predict import cost

        truth = run.task.ground_truth
        found = run.for_each_cell(NAME, lambda cell: cost(cell, run.records, truth))
        times = [run.training_seconds.get(seed, np.nan) for seed in run.cells]
        counts = [cell.parameters_count() for cell in run.cells.values()]
        return found.assign(
            {
                TRAINING: ("seed", np.asarray(times, dtype=np.float64)),
                PARAMETERS: ("seed", np.asarray(counts, dtype=np.float64)),
            }
        )

    def was_run(self, predictions: xr.Dataset, part: Part) -> bool:
        """See `Axis.was_run`."""
        return PARAMETERS in predictions

    def check(self, scored: ScoredPredictions) -> None:
        """See `Axis.check`: a model that computes its answers has times."""
        predictions = scored.predictions
        if PARAMETERS not in predictions:
            return
        wanted = [TRAINING] if scored.reads_records else [TRAINING, UPDATE]
        for name in wanted:
            if name not in predictions:
                raise _lacks(name)
        for name in (UPDATE, TRUTH_UPDATE):
            if name in predictions and not set(POINTS) <= set(predictions["points"].values):
                raise _lacks(f"{name} of {POINTS[0]} and {POINTS[1]} points")

    def sample(self, scored: ScoredPredictions, part: Part) -> Costs:
        """See `Axis.sample`."""
        return Costs.of(scored)

    def places(self, scored: ScoredPredictions, split: str) -> Iterable[tuple[Part, Group]]:
        """See `Axis.places`: costs belong to no split and count no paths."""
        if split == ALL:
            yield self.parts[0], Group(ALL, ALL, 0, [0])

    def text_tables(self, model: ModelView, split: str) -> Iterator[TextTable | str]:
        """See `Axis.text_tables`: one row a metric, with the reason where there is no value."""
        found = found_scores(model, self.names, ALL)
        if split != ALL or not found:
            return
        columns = (
            Column("", left=True),
            Column("mean of\nseeds"),
            Column("", left=True, wraps=True),
        )
        yield TextTable(
            f"Cost of {model.name}",
            columns,
            tuple(
                (metric.title, written(score, metric.style), score.reason or "")
                for metric in self.metrics()
                if "terminal" in metric.shown
                and (score := found.get((NAME, ALL, metric.name))) is not None
            ),
        )

    def board_sections(self, board: BoardView) -> Iterator[Section]:
        """See `Axis.board_sections`: parameters and times, the fastest update first."""
        found = {model.name: found_scores(model, self.names, ALL) for model in board.models}
        if not any(found.values()):
            return
        shown = [metric for metric in self.metrics() if "board" in metric.shown]
        cells = {
            name: tuple(cell(scores.get((NAME, ALL, metric.name)), metric) for metric in shown)
            for name, scores in found.items()
        }
        timed = next(i for i, metric in enumerate(shown) if metric.tolerance.clock is not None)
        titles = tuple(metric.title for metric in shown)
        yield Section(
            "Cost",
            (Block(table=ModelTable("Cost", titles, cells, ordered_by=timed)),),
            "CPU time of one update of one point without gradients, on the submitter's machine; "
            "the ratio to the ground truth was measured in the same process.",
        )

    def glossary(self, board: BoardView) -> Iterator[tuple[str, str]]:
        """See `Axis.glossary`: titles say what is meant, but for metrics of other packages."""
        yield from plugged_in_definitions(self)

    def section(self) -> str:
        """See `Axis.section`."""
        return section_file(self, __file__)

    def measured_tables(self, models: Sequence[ModelView]) -> dict[str, str]:
        """See `Axis.measured_tables`: updates and their ratio to the ground truth."""
        header = (
            "model",
            "update, 100 points",
            "update, 10,000 points",
            "over ground truth, 100",
            "over ground truth, 10,000",
        )
        timed = [metric for metric in METRICS if metric.tolerance.clock is not None]
        rows = []
        for model in models:
            found = found_scores(model, self.names, ALL)
            cells = (written(found.get((NAME, ALL, m.name)), m.style) for m in timed)
            rows.append((f"`{model.name}` on `{model.task}`", *cells))
        return {NAME: table(header, rows)}


def _lacks(name: str) -> SubmissionError:
    return SubmissionError(f"the predictions lack {name!r}; run `granbench evaluate` again")


AXIS = Cost()
