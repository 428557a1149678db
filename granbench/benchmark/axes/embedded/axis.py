"""The embedded axis: a model in place of the ground truth, in boundary-value problems."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import xarray as xr

from granbench.benchmark.axes.embedded.analysis_errors import AnalysisErrors
from granbench.benchmark.axes.embedded.metrics import (
    ERROR_POINTS,
    METRICS,
    NAME,
    REACHED,
    REACTION,
)
from granbench.benchmark.axis import Axis, Group, Highlight, Part, Stored
from granbench.benchmark.metric import NotApplicable
from granbench.benchmark.presentation import BoardView, ModelView, Section, TextTable
from granbench.benchmark.scorecard import ALL, Curve, Score, rounded
from granbench.benchmark.scored_task import ScoredPredictions, ScoredTask
from granbench.benchmark.section_file import section_file
from granbench.benchmark.tolerance import CLOCK_FACTOR, TRUTH_TOLERANCE
from granbench.errors import SubmissionError
from granbench.fem.statement import NOT_IN_THE_PLANE, READS_RECORDS, SOLVERS
from granbench.tensors import COMPONENT_ORDERS

if TYPE_CHECKING:
    from granbench.benchmark.evaluation_run import EvaluationRun
    from granbench.cells.contract import Conditions, MaterialCell

NO_ANALYSES = "this task has no boundary-value problem with a ground-truth cell"

EMBEDDED_OBSTACLE = "embedded_not_applicable"
"""Global attribute where the axis was run: why it does not apply, "" where it does."""

EMBEDDED_FAILURES = "embedded_failures"
"""Global attribute: JSON, why analyses ended early, by SEED/SOLVER/ANALYSIS."""

LOST = 0.2
"""Error of the reaction, with any seed, beyond which a model has lost an analysis. It is chaotic
then: rounding decides at which step it fails, and whether. `gru-change` on fem-ime, evaluated again
with the same weights and its sums in another order, failed elsewhere: implicit errors of the
reaction of 1.80 (biaxial) and 4.33 (wall) became 0.87 and 2.51."""

RESPONSES = ("reaction", "volumetric_strain", "acceleration", "stress")
TIMES = ("seconds", "cell_seconds")

_ANALYSES = ("solver", "analysis")
_CURVE = (*_ANALYSES, "output")
_POINTS = (*_CURVE, "gauss_point", "component")


@dataclass(frozen=True, kw_only=True)
class SolverPart(Part):
    """The analyses that are made with one solver.

    Parameters
    ----------
    solver : its name
    """

    solver: str


PARTS = tuple(
    SolverPart(name=f"{NAME}-{solver}", axis=NAME, title=f"Embedded, {solver}", solver=solver)
    for solver in SOLVERS
)


class Embedded(Axis):
    """Whole finite-element analyses with the model at every Gauss point."""

    name = NAME
    title = "Embedded: in place of the ground truth"
    order = 30
    since = "1.2"
    parts = PARTS
    own_metrics = METRICS
    tells_models_apart = True
    needs_analyses = True
    labels: ClassVar[Mapping[str, Sequence[str]]] = {"solver": SOLVERS}
    json_attributes = (EMBEDDED_FAILURES,)
    highlights = (
        *(Highlight(part.name, ALL, REACTION, f"reaction, {part.solver}") for part in PARTS),
        *(Highlight(part.name, ALL, REACHED, f"steps before failure, {part.solver}")
          for part in PARTS),
    )  # fmt: skip
    layout: ClassVar[Mapping[str, Stored]] = {
        "embedded_reaction": Stored(("seed", *_CURVE), "N/m", "reaction of an analysis"),
        "embedded_volumetric_strain": Stored(
            ("seed", *_CURVE), "1", "its global volumetric strain"
        ),
        "embedded_acceleration": Stored(
            ("seed", *_CURVE), "m/s2", "its largest nodal acceleration since the last output"
        ),
        "embedded_stress": Stored(("seed", *_POINTS), "Pa", "its stress at some Gauss points"),
        "embedded_seconds": Stored(("seed", *_ANALYSES), "s", "CPU time of the whole analysis"),
        "embedded_cell_seconds": Stored(("seed", *_ANALYSES), "s", "CPU time in the model alone"),
        "embedded_truth_reaction": Stored(_CURVE, "N/m", "reaction with the ground truth"),
        "embedded_truth_volumetric_strain": Stored(
            _CURVE, "1", "global volumetric strain with the ground truth"
        ),
        "embedded_truth_acceleration": Stored(
            _CURVE, "m/s2", "largest nodal acceleration with the ground truth since the last output"
        ),
        "embedded_truth_stress": Stored(
            _POINTS, "Pa", "stress at some Gauss points with the ground truth"
        ),
        "embedded_truth_seconds": Stored(_ANALYSES, "s", "CPU time with the ground truth"),
        "embedded_truth_cell_seconds": Stored(_ANALYSES, "s", "CPU time in the ground truth alone"),
    }

    def obstacle(self, task: ScoredTask, reads_records: bool = False) -> str | None:
        """See `Axis.obstacle`."""
        if not task.analyses:
            return NO_ANALYSES
        if tuple(task.components) != COMPONENT_ORDERS["plane"]:
            return NOT_IN_THE_PLANE
        return READS_RECORDS if reads_records else None

    def predict(self, run: "EvaluationRun") -> xr.Dataset:
        """See `Axis.predict`."""
        if obstacle := self.obstacle(run.task, run.reads_records):
            return xr.Dataset(attrs={EMBEDDED_OBSTACLE: obstacle})
        run.task.require_ground_truth()
        from granbench.benchmark.axes.embedded.predict import FAILURE, embedded, embedded_truth

        found = run.for_each_cell(NAME, lambda cell: embedded(cell, run.task))
        failures = found[FAILURE].assign_coords(seed=list(run.cells)).to_series()
        reasons = {"/".join(map(str, place)): text for place, text in failures.items() if text}
        return xr.merge([found.drop_vars(FAILURE), embedded_truth(run.task)]).assign_attrs(
            {EMBEDDED_OBSTACLE: "", EMBEDDED_FAILURES: json.dumps(reasons, sort_keys=True)}
        )

    def start(self, cell: "MaterialCell", task: ScoredTask) -> "tuple[Conditions] | None":
        """See `Axis.start`: Gauss points start where the first analysis does."""
        if self.obstacle(task, cell.reads_records):
            return None
        from granbench.benchmark.axes.embedded.predict import analysis_start

        return (analysis_start(cell, task),)

    def was_run(self, predictions: xr.Dataset, part: Part) -> bool:
        """See `Axis.was_run`."""
        return EMBEDDED_OBSTACLE in predictions.attrs

    def check(self, scored: ScoredPredictions) -> None:
        """See `Axis.check`: other analyses than those of the task, and what is missing of them."""
        predictions, task = scored.predictions, scored.task
        if EMBEDDED_OBSTACLE not in predictions.attrs:
            return
        if self.obstacle(task, scored.reads_records) is not None:
            return
        if predictions.attrs[EMBEDDED_OBSTACLE] != "":
            raise SubmissionError(
                f"the predictions say that the embedded axis does not apply ({EMBEDDED_OBSTACLE}), "
                "but it applies to every model that computes its answers; run `granbench evaluate` "
                "again"
            )
        expected: dict[str, list[Any]] = {
            "solver": list(SOLVERS),
            "analysis": [analysis.name for analysis in task.analyses],
            "output": list(range(task.analyses[0].outputs + 1)),
            "gauss_point": list(range(task.analyses[0].points)),
            "component": list(task.records["component"].values),
        }
        for label, wanted in expected.items():
            if label not in predictions.coords or list(predictions[label].values) != wanted:
                raise SubmissionError(
                    f"the predictions' {label} labels are not those of the embedded analyses of "
                    f"{task.name}; run `granbench evaluate` again"
                )
        for variable in self.layout:
            if variable not in predictions:
                raise SubmissionError(
                    f"the predictions lack {variable!r}; run `granbench evaluate` again"
                )

    def check_ground_truth(self, scored: ScoredPredictions) -> None:
        """See `Axis.check_ground_truth`: the analyses are made again with the ground truth.

        Machines differ in their times, but not by more than `CLOCK_FACTOR`.
        """
        predictions = scored.predictions
        if "embedded_truth_reaction" not in predictions:
            return
        from granbench.benchmark.axes.embedded.predict import embedded_truth

        again = embedded_truth(scored.task)
        for name in RESPONSES:
            variable = f"embedded_truth_{name}"
            mine, theirs = again[variable], predictions[variable]
            same_gaps = (np.isnan(mine) == np.isnan(theirs)).all()
            over = [dim for dim in mine.dims if dim not in _ANALYSES]
            size = np.sqrt((mine**2).mean(over))
            difference = np.sqrt(((mine - theirs) ** 2).mean(over))
            if not same_gaps or (difference > TRUTH_TOLERANCE * size).any():
                raise _another_truth(variable)
        for name in TIMES:
            variable = f"embedded_truth_{name}"
            ratio = predictions[variable] / again[variable]
            off = (ratio > CLOCK_FACTOR) | (ratio < 1.0 / CLOCK_FACTOR)
            if off.any() or (np.isnan(again[variable]) != np.isnan(predictions[variable])).any():
                raise _another_truth(variable)

    def sample(self, scored: ScoredPredictions, part: Part) -> AnalysisErrors:
        """See `Axis.sample`."""
        assert isinstance(part, SolverPart)
        if reason := self.obstacle(scored.task, scored.reads_records):
            raise NotApplicable(reason)
        chosen = scored.predictions.sel(
            solver=part.solver, analysis=_analyses(scored.task, part.solver)
        )
        return AnalysisErrors(chosen, part.solver, scored.normalisation.std["stress"])

    def places(self, scored: ScoredPredictions, split: str) -> Iterable[tuple[Part, Group]]:
        """See `Axis.places`: all analyses of a solver, then each of them; they have no split."""
        if split != ALL:
            return
        for part in PARTS:
            names = _analyses(scored.task, part.solver)
            if names:
                yield part, Group(ALL, ALL, len(names), range(len(names)))
            for row, name in enumerate(names):
                yield part, Group(ALL, name, 1, [row])

    def scores(self, scored: ScoredPredictions, split: str) -> Iterator[Score]:
        """See `Axis.scores`: on a task without analyses one for each split, that says so."""
        if split != ALL and not scored.task.analyses:
            yield Score(
                axis=NAME, protocol=NAME, split=split, metric=ALL, status="not_applicable",
                reason=NO_ANALYSES,
            )  # fmt: skip
        yield from super().scores(scored, split)

    def curves(self, scored: ScoredPredictions) -> Iterator[Curve]:
        """See `Axis.curves`: error points against the output step, mean over seeds."""
        if EMBEDDED_OBSTACLE not in scored.predictions.attrs:
            return
        if self.obstacle(scored.task, scored.reads_records):
            return
        for part in PARTS:
            for row, name in enumerate(_analyses(scored.task, part.solver)):
                share = scored.sample(self, part).error_points[:, row].mean(axis=0)
                yield Curve(
                    protocol=part.name,
                    split=ALL,
                    group=name,
                    metric=ERROR_POINTS,
                    n=1,
                    horizon=tuple(range(1, len(share) + 1)),
                    value=tuple(rounded(value) for value in share),
                )

    def lost_results(self, scores: Sequence[Score]) -> set[tuple[str, str]]:
        """See `Axis.lost_results`: analyses that a model has lost, and means over such."""
        lost = {
            (score.protocol, score.group)
            for score in scores
            if score.axis == NAME
            and score.metric == REACTION
            and max((score.value or 0.0, *score.by_seed)) > LOST
        }
        return lost | {(protocol, ALL) for protocol, _ in lost}

    def text_tables(self, model: ModelView, split: str) -> Iterator[TextTable | str]:
        """See `Axis.text_tables`."""
        from granbench.benchmark.axes.embedded.tables import text_tables

        if split == ALL:
            yield from text_tables(self, model)

    def board_sections(self, board: BoardView) -> Iterator[Section]:
        """See `Axis.board_sections`."""
        from granbench.benchmark.axes.embedded.tables import board_sections

        yield from board_sections(self, board)

    def glossary(self, board: BoardView) -> Iterator[tuple[str, str]]:
        """See `Axis.glossary`: the metrics, where there are analyses."""
        if any(
            score.axis == NAME and score.split == ALL for m in board.models for score in m.scores
        ):
            for metric in self.metrics():
                yield metric.title, metric.definition

    def section(self) -> str:
        """See `Axis.section`."""
        return section_file(self, __file__)


def _analyses(task: ScoredTask, solver: str) -> list[str]:
    """Names of the analyses of a task that are made with a solver."""
    return [analysis.name for analysis in task.analyses if solver in analysis.solvers]


def _another_truth(variable: str) -> SubmissionError:
    return SubmissionError(
        f"the predictions' {variable} is not what the ground truth gives; run `granbench evaluate` "
        "again"
    )


AXIS = Embedded()
