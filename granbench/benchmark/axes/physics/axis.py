"""The physics axis: laws that any material obeys, checked on a model's own answers."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import xarray as xr

from granbench.benchmark.axes.physics.applicability import physics_obstacles
from granbench.benchmark.axes.physics.checks import (
    CHECKED_STRAIN,
    CHECKS,
    NAME,
    PHYSICS_OBSTACLES,
    STRESS_CHECKS,
    TANGENT,
    Check,
    checked_paths,
)
from granbench.benchmark.axes.physics.metrics import METRICS, Violations
from granbench.benchmark.axis import Axis, Group, Part, Stored
from granbench.benchmark.bootstrap import Resampling
from granbench.benchmark.comparison import clipped
from granbench.benchmark.metric import NotApplicable
from granbench.benchmark.presentation import BoardView, ModelView, Section, TextTable
from granbench.benchmark.scorecard import ALL
from granbench.benchmark.scored_task import ScoredPredictions
from granbench.benchmark.section_file import section_file
from granbench.data.markdown import table
from granbench.errors import SubmissionError
from granbench.tensors import component_order, contraction_weights

if TYPE_CHECKING:
    from granbench.benchmark.evaluation_run import EvaluationRun

STRESS_CHANGE, KINK_SHARE = "stress_change", "kink_share"
DISSIPATION = "dissipation"
RESPONSE = {
    TANGENT: "tangent_error", DISSIPATION: "cycle_work", "compression": "tension_share",
}  # fmt: skip
"""Variable that holds the response to a check; that of the others is `STRESS_CHANGE`."""
_CHECKED = ("seed", "checked_path")


class Physics(Axis):
    """Laws of any isotropic, rate-independent material, checked along recorded strain."""

    name = NAME
    title = "Physics"
    order = 20
    since = "1.1"
    parts = tuple(CHECKS.values())
    own_metrics = METRICS
    labels: ClassVar[Mapping[str, Sequence[str]]] = {"check": STRESS_CHECKS}
    json_attributes = (PHYSICS_OBSTACLES,)
    layout: ClassVar[Mapping[str, Stored]] = {
        STRESS_CHANGE: Stored(
            ("seed", "check", "checked_path", "component"), "Pa", "largest violation of a check"
        ),
        "tangent_error": Stored(_CHECKED, "1", "largest relative error of the tangent"),
        KINK_SHARE: Stored(_CHECKED, "1", "share of the checked points without a derivative"),
        "cycle_work": Stored(_CHECKED, "Pa", "work that a closed strain cycle consumes, J/m3"),
        "tension_share": Stored(_CHECKED, "1", "share of steps with a tensile mean stress"),
    }

    def predict(self, run: "EvaluationRun") -> xr.Dataset:
        """See `Axis.predict`."""
        from granbench.benchmark.axes.physics.predict import physics

        return run.for_each_cell(NAME, lambda cell: physics(cell, run.records))

    def was_run(self, predictions: xr.Dataset, part: Part) -> bool:
        """See `Axis.was_run`."""
        return PHYSICS_OBSTACLES in predictions.attrs

    def check(self, scored: ScoredPredictions) -> None:
        """See `Axis.check`: other paths, missing responses, checks that were left out."""
        predictions = scored.predictions
        if PHYSICS_OBSTACLES not in predictions.attrs:
            return
        obstacles = physics_obstacles(scored)
        applicable = [name for name in CHECKS if name not in obstacles]
        if applicable:
            _check_paths(predictions, scored.records.isel(path=checked_paths(scored.records)))
        for name in applicable:
            variable = RESPONSE.get(name, STRESS_CHANGE)
            missing = variable not in predictions or (
                variable == STRESS_CHANGE and name not in predictions["check"].values
            )
            if missing:
                raise SubmissionError(
                    f"the predictions lack the response to the check {name!r} ({variable!r}); run "
                    "`granbench evaluate` again"
                )
        if TANGENT in applicable and KINK_SHARE not in predictions:
            raise SubmissionError(
                f"the predictions lack {KINK_SHARE!r}; run `granbench evaluate` again"
            )

    def sample(self, scored: ScoredPredictions, part: Part) -> Violations:
        """See `Axis.sample`."""
        assert isinstance(part, Check)
        if reason := physics_obstacles(scored).get(part.name):
            raise NotApplicable(reason)
        others = {KINK_SHARE: scored.predictions[KINK_SHARE]} if part.name == TANGENT else {}
        return Violations(
            part,
            clipped(_violation(part.name, scored)),
            {name: clipped(values.values) for name, values in others.items()},
        )

    def places(self, scored: ScoredPredictions, split: str) -> Iterable[tuple[Part, Group]]:
        """See `Axis.places`: every check on the checked paths of a split."""
        records = scored.records.isel(path=checked_paths(scored.records))
        rows = np.flatnonzero(records["split"].values.astype(str) == split)
        if not len(rows):
            return
        resampling = Resampling.by_specimen(records["specimen"].values[rows])
        group = Group(split, ALL, len(rows), rows, resampling)
        for check in CHECKS.values():
            yield check, group

    def text_tables(self, model: ModelView, split: str) -> Iterator[TextTable | str]:
        """See `Axis.text_tables`."""
        from granbench.benchmark.axes.physics.tables import text_tables

        yield from text_tables(self, model, split)

    def board_sections(self, board: BoardView) -> Iterator[Section]:
        """See `Axis.board_sections`."""
        from granbench.benchmark.axes.physics.tables import board_sections

        yield from board_sections(self, board)

    def glossary(self, board: BoardView) -> Iterator[tuple[str, str]]:
        """See `Axis.glossary`."""
        from granbench.benchmark.axes.physics.tables import glossary

        yield from glossary(self, board)

    def section(self) -> str:
        """See `Axis.section`."""
        rows = [
            (f"`{check.name}`", check.definition, f"{check.tolerance:g}", check.reason)
            for check in CHECKS.values()
        ]
        header = ("check", "violation of a path", "allowed", "reason of the tolerance")
        return section_file(self, __file__, checks=table(header, rows))

    def measured_tables(self, models: Sequence[ModelView]) -> dict[str, str]:
        """See `Axis.measured_tables`."""
        from granbench.benchmark.axes.physics.tables import measured_table

        return {NAME: measured_table(models)}


def _check_paths(predictions: xr.Dataset, records: xr.Dataset) -> None:
    expected = [str(name) for name in records["path_id"].values]
    if "checked_path" not in predictions.coords or expected != [
        str(name) for name in predictions["checked_path"].values
    ]:
        raise SubmissionError(
            "the physics checks were not made on the paths that the benchmark checks "
            "(checked_path); run `granbench evaluate` again"
        )


def _violation(name: str, scored: ScoredPredictions) -> np.ndarray:
    """Violations (seed, path), NaN where the model broke down."""
    records = scored.records.isel(path=checked_paths(scored.records))
    normalisation = scored.normalisation
    response = scored.predictions[RESPONSE.get(name, STRESS_CHANGE)]
    order = component_order(tuple(scored.task.components))
    count = np.asarray(contraction_weights(order))
    if response.name == STRESS_CHANGE:
        change = response.sel(check=name).values.astype(np.float64)
        if name.startswith("substeps"):
            std = normalisation.std
            stiffness = _norm(std["stress"], count) / _norm(std["strain"], count)
            return _norm(change, count) / (stiffness * CHECKED_STRAIN)
        return np.max(np.abs(change) / normalisation.std["stress"], axis=-1)
    if name == DISSIPATION:
        # Against a stress of one standard deviation along the path and back.
        strain = records["strain"].values.astype(np.float64)
        length = 2.0 * np.abs(np.diff(strain, axis=1)).sum(axis=1)
        scale = (count * normalisation.std["stress"] * length).sum(axis=-1)
        return np.maximum(-response.values.astype(np.float64), 0.0) / scale
    return response.values.astype(np.float64)


def _norm(components: np.ndarray, count: np.ndarray) -> np.ndarray:
    return np.sqrt((count * components**2).sum(axis=-1))


AXIS = Physics()
