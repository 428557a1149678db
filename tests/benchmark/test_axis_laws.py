"""What holds for every registered axis and metric."""

from collections.abc import Iterator

import numpy as np
import pytest
import xarray as xr
from embedded_tasks import Elastic, cell, embedding_records, task_of

from granbench.baselines.oracle import OracleCell
from granbench.benchmark.axis import Axis
from granbench.benchmark.evaluation import predict, progress_parts
from granbench.benchmark.metric import Metric
from granbench.benchmark.predictions import evaluated, read_predictions_here, write_predictions
from granbench.benchmark.registry import axes, axis_names, chosen_axes, find_axis, find_metric
from granbench.benchmark.scorecard import ALL, Scorecard
from granbench.benchmark.scoring import score
from granbench.benchmark.tolerance import Tolerance
from granbench.data.normalisation import Normalisation
from granbench.errors import ConfigurationError, SubmissionError

each_axis = pytest.mark.parametrize("axis", axes(), ids=lambda axis: axis.name)
each_metric = pytest.mark.parametrize(
    "metric",
    [metric for axis in axes() for metric in axis.metrics()],
    ids=lambda metric: f"{metric.axis}:{metric.name}",
)
OPTIONAL = {"void_ratio", "truth_update_seconds"}
"""Variables that a model or a task may lack."""


@pytest.fixture(scope="module")
def task_records() -> xr.Dataset:
    """Records of a task to which every axis applies."""
    return embedding_records()


def card(predictions: xr.Dataset, records: xr.Dataset) -> Scorecard:
    normalisation = Normalisation.from_training(records)
    return score(predictions, evaluated(records), normalisation, task_of(records))


@pytest.fixture(scope="module", autouse=True)
def _short_timings() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("granbench.benchmark.axes.cost.predict.SECONDS", 1e-3)
        patch.setattr("granbench.benchmark.axes.cost.predict.ROUNDS", 1)
        yield


@pytest.fixture(scope="module")
def _predictions(task_records: xr.Dataset, _short_timings: None) -> xr.Dataset:
    cells = {0: cell(Elastic(0.9)), 1: cell(Elastic(0.8))}
    return predict(cells, evaluated(task_records), task=task_of(task_records))


@pytest.fixture
def predictions(_predictions: xr.Dataset) -> xr.Dataset:
    return _predictions.copy(deep=True)


@pytest.fixture(scope="module")
def _oracle(task_records: xr.Dataset, _short_timings: None) -> xr.Dataset:
    return predict(
        {0: OracleCell(task_records)}, evaluated(task_records), task=task_of(task_records)
    )


def written(axis: Axis, predictions: xr.Dataset) -> list[str]:
    """Variables of an axis in a predictions file."""
    return [name for name in axis.layout if name in predictions]


@each_axis
def test_every_axis_is_evaluated_and_scored(axis: Axis, predictions, task_records) -> None:
    found = [s for s in card(predictions, task_records).scores if s.axis in axis.names]
    assert {s.axis for s in found} == set(axis.names)
    assert any(s.status == "scored" for s in found)
    assert {s.status for s in found} <= {"scored", "not_applicable"}
    assert all(s.reason for s in found if s.status != "scored")
    named = {part.name for part in axis.parts}
    assert {s.protocol for s in found} <= named


@each_axis
def test_the_records_themselves_score_what_the_truth_has(axis: Axis, _oracle, task_records) -> None:
    """A model that reads the records scores what a metric says the truth has, or nothing."""
    for found in card(_oracle, task_records).scores:
        metric = find_metric(found.axis, found.metric)
        if found.axis in axis.names and found.status == "scored":
            assert metric is not None
            assert metric.of_truth is None or found.value == metric.of_truth, found.key
    assert card(_oracle, task_records).perfect


@each_axis
def test_a_missing_variable_is_refused_by_its_name(axis: Axis, predictions, task_records) -> None:
    names = written(axis, predictions)
    assert names
    for name in names:
        if name in OPTIONAL:
            continue
        without = predictions.drop_vars(name)
        if axis.was_run(without, axis.parts[0]):
            with pytest.raises(SubmissionError, match=name):
                card(without, task_records)
        else:  # this variable shows that the axis was run
            found = [s for s in card(without, task_records).scores if s.axis in axis.names]
            assert {s.status for s in found} == {"not_run"}


@pytest.mark.parametrize("name", axis_names())
def test_an_axis_that_is_left_out_is_not_run(name: str, task_records) -> None:
    others = [other for other in ("single-step", "rollout") if other != name][:1]
    made = predict(
        {0: cell(Elastic())}, evaluated(task_records), others, task=task_of(task_records)
    )
    found = [s for s in card(made, task_records).scores if s.axis == name]
    assert found and {s.status for s in found} == {"not_run"}
    assert all(name in (s.reason or "") for s in found)


def test_scores_do_not_depend_on_the_order_of_paths(predictions, task_records) -> None:
    turned = predictions.isel(path=slice(None, None, -1))
    if "checked_path" in turned.dims:  # the order of these is that of the records
        turned = turned.isel(checked_path=slice(None, None, -1))
    one, other = card(predictions, task_records), card(turned, task_records)
    assert [s.key for s in one.scores] == [s.key for s in other.scores]
    for first, second in zip(one.scores, other.scores, strict=True):
        assert first.status == second.status
        assert first.status != "scored" or first.value == pytest.approx(second.value, rel=1e-8)


@each_axis
def test_what_an_axis_writes_is_what_it_declares(axis: Axis, task_records, tmp_path) -> None:
    made = predict(
        {0: cell(Elastic())}, evaluated(task_records), axis.names, task=task_of(task_records)
    )
    assert set(made.data_vars) <= set(axis.layout)
    assert set(axis.labels) <= set(made.coords)
    write_predictions(made, tmp_path / "p.nc")
    again = read_predictions_here(tmp_path / "p.nc")
    assert all(axis.was_run(again, part) for part in axis.parts)
    for name in axis.layout:
        assert [other for other in axes() if name in other.layout] == [axis]


@each_axis
def test_progress_is_reported_as_announced(axis: Axis, task_records) -> None:
    reported: list[int] = []
    predict(
        {4: cell(Elastic())}, evaluated(task_records), axis.names, task=task_of(task_records),
        progress=lambda seed, done: reported.append(seed),
    )  # fmt: skip
    assert reported == [4] * progress_parts(axis.names)


@each_axis
def test_an_axis_says_what_people_read(axis: Axis) -> None:
    assert axis.section().startswith(f"## {axis.title}\n")
    assert all(part.title and part.axis in axis.names for part in axis.parts)
    assert all(find_axis(name) is axis for name in axis.names)
    assert len({metric.name for metric in axis.metrics()}) == len(axis.metrics())
    by_name = {metric.statistic.name: metric.statistic for metric in axis.metrics()}
    assert all(by_name[m.statistic.name] is m.statistic for m in axis.metrics())


@each_metric
def test_every_metric_declares_what_it_is(metric: Metric) -> None:
    assert metric.unit and metric.title and metric.definition
    assert metric.direction in ("lower", "higher", "target 1")
    assert isinstance(metric.tolerance, Tolerance) and metric.tolerance.title
    if metric.direction == "lower" and metric.of_truth is not None and metric.axis != "cost":
        assert metric.of_truth == 0.0
    if metric.direction == "target 1":
        assert metric.of_truth == 1.0


@each_metric
def test_a_score_of_every_metric_is_there(metric: Metric, predictions, task_records) -> None:
    found = [s for s in card(predictions, task_records).scores if metric.is_named(s.metric)]
    assert any(find_metric(s.axis, s.metric) is metric and s.group == ALL for s in found)
    assert {s.unit for s in found if find_metric(s.axis, s.metric) is metric} == {metric.unit}


def test_statistics_are_computed_once(predictions, task_records, monkeypatch) -> None:
    from granbench.benchmark.axes.along_paths.axis import AXIS
    from granbench.benchmark.axes.along_paths.path_errors import PathErrors

    made: list[str] = []
    original = PathErrors.of.__func__  # type: ignore[attr-defined]

    def counted(cls, scored, protocol):
        made.append(protocol.name)
        return original(cls, scored, protocol)

    monkeypatch.setattr(PathErrors, "of", classmethod(counted))
    card(predictions, task_records)
    assert sorted(made) == sorted(part.name for part in AXIS.parts)


def test_axes_are_chosen_once_and_in_order() -> None:
    names = axis_names()
    assert chosen_axes(None) == names == chosen_axes([*reversed(names), names[0]])
    with pytest.raises(ConfigurationError, match="'rolout'"):
        chosen_axes(["rolout"])
    with pytest.raises(ConfigurationError, match="no axis"):
        chosen_axes([])


def test_a_nan_is_never_a_score(predictions, task_records) -> None:
    for name in written(axes()[0], predictions):
        predictions[name][..., -1] = np.nan
    for found in card(predictions, task_records).scores:
        assert found.value is None or np.isfinite(found.value)
