"""Scores and curves of the protocols whose predictions are compared with records."""

from collections.abc import Iterator
from functools import partial

import numpy as np
import xarray as xr

from granbench.benchmark.bootstrap import Resampling, weighted_mean
from granbench.benchmark.metrics import Metric, metrics
from granbench.benchmark.protocols import PROTOCOLS, ProtocolSpec
from granbench.benchmark.reduction import Paths, not_applicable, not_run, reduced, split_order
from granbench.benchmark.scorecard import ALL, Curve, Score, rounded
from granbench.benchmark.statistics import horizon_means

CURVE_HORIZONS = 61


def scores_of_split(statistics: xr.Dataset, split: str, no_noised_truth: str | None) -> list[Score]:
    """Every score of one split, as a whole and by loading family.

    Parameters
    ----------
    statistics : of every path, see `path_statistics`
    split : one of theirs
    no_noised_truth : why there is no truth for noised strain, or None
    """
    inside = statistics["split"].values.astype(str) == split
    families = statistics["loading_family"].values.astype(str)
    groups = {ALL: inside} | {
        family: inside & (families == family) for family in sorted(set(families[inside]))
    }
    return [
        score
        for group, chosen in groups.items()
        for score in _scores(
            statistics.isel(path=np.flatnonzero(chosen)), split, group, no_noised_truth
        )
    ]


def _scores(
    member: xr.Dataset, split: str, group: str, no_noised_truth: str | None
) -> Iterator[Score]:
    paths = Paths(
        split, group, member.sizes["path"], Resampling.by_specimen(member["specimen"].values)
    )
    components = [str(label) for label in member["component"].values]
    for spec in PROTOCOLS.values():
        columns = _columns(member, spec)
        for metric in metrics(components, spec.axis):
            if group == ALL or metric.by_family:
                yield _score(columns, spec, metric, paths, no_noised_truth)


def _score(
    columns: dict[str, np.ndarray],
    spec: ProtocolSpec,
    metric: Metric,
    paths: Paths,
    no_noised_truth: str | None,
) -> Score:
    if not columns:
        return not_run(spec, metric, paths)
    obstacle = metric.obstacle(spec, list(columns), no_noised_truth)
    if obstacle is not None:
        return not_applicable(spec, metric, paths, obstacle)
    return reduced(spec, metric, paths, columns[metric.statistic])


def _columns(member: xr.Dataset, spec: ProtocolSpec) -> dict[str, np.ndarray]:
    """Statistics of one protocol by name, each (seed, path, ...); empty where it was not run."""
    columns = {}
    for name, variable in member.data_vars.items():
        dim = "noise" if "noise" in variable.dims else "protocol"
        if dim in variable.dims and spec.name in variable[dim].values:
            columns[str(name)] = variable.sel({dim: spec.name}).values
    return columns


def curves(statistics: xr.Dataset) -> Iterator[Curve]:
    """Error against horizon of every split and every protocol that has one."""
    if "step_squared_error" not in statistics:
        return
    splits = statistics["split"].values.astype(str)
    for split in split_order(splits):
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
                value=tuple(rounded(value) for value in errors.mean(axis=0)),
                low=tuple(rounded(value) for value in low),
                high=tuple(rounded(value) for value in high),
            )
