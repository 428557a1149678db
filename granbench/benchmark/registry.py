"""The registered axes and metrics; nothing else in the package names one.

A package registers an axis under the entry-point group `granbench.axes`, and a metric under
`granbench.metrics`.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import cache
from typing import TypeVar

from granbench.benchmark.axis import Axis, Part, Stored
from granbench.benchmark.metric import Metric
from granbench.benchmark.package_code import package_code
from granbench.errors import ConfigurationError
from granbench.registration import Registry

AXES: Registry[Axis] = Registry("granbench.axes", "axis", Axis, error=ConfigurationError)
METRICS: Registry[Metric] = Registry(
    "granbench.metrics", "metric", Metric, error=ConfigurationError
)

Result = TypeVar("Result")

_WRITTEN: dict[str, Callable[[Axis], Iterable[str]]] = {
    "part": lambda axis: [part.name for part in axis.parts],
    "variable": lambda axis: axis.layout,
    "coordinate": lambda axis: axis.labels,
}


class _NoMore:
    """The end of an iterator, whose results may be None."""


_NO_MORE = _NoMore()


@cache
def axes() -> tuple[Axis, ...]:
    """The registered axes, in the order of the scorecard.

    Raises
    ------
    ConfigurationError
        If there is none, what is registered is not an axis, or two axes share a name, a part, or a
        variable or coordinate of the predictions file.
    """
    found = list(AXES.values())
    if not found:
        raise ConfigurationError(
            f"no axis is registered under the entry points {AXES.group}; install granbench again"
        )
    names = [name for axis in found for name in axis.names]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ConfigurationError(
            f"two packages register an axis {twice[0]!r}; uninstall one of them"
        )
    _require_own_names(found)
    return tuple(sorted(found, key=lambda axis: (axis.order, axis.name)))


def _require_own_names(found: Sequence[Axis]) -> None:
    """Refuse what two axes would both write: parts in the scores, variables and coordinates."""
    for kind, names_of in _WRITTEN.items():
        owners: dict[str, str] = {}
        for axis in found:
            for name in names_of(axis):
                other = owners.setdefault(name, axis.name)
                if other != axis.name:
                    raise ConfigurationError(
                        f"axis {axis.name!r} has the {kind} {name!r}, which axis {other!r} has "
                        "too; rename it in the package that registers the axis"
                    )
    for axis in found:
        for part in axis.parts:
            if part.axis not in axis.names:
                raise ConfigurationError(
                    f"axis {axis.name!r}: the part {part.name!r} belongs to axis {part.axis!r}; "
                    f"use axis={axis.names[0]!r}"
                )


def axes_for(names: Iterable[str]) -> tuple[Axis, ...]:
    """The axes of GranBench where they have all the names, else every registered axis.

    A broken axis of another package then affects only what names an axis of another package.
    """
    found = (AXES[point] for point in AXES if AXES.own(point))
    own = tuple(sorted(found, key=lambda axis: (axis.order, axis.name)))
    return own if set(names) <= {name for axis in own for name in axis.names} else axes()


@cache
def plugged_in_metrics() -> tuple[Metric, ...]:
    """The metrics that other packages register, by name.

    Raises
    ------
    ConfigurationError
        If what is registered is not a metric, belongs to no axis, or has the name of another.
    """
    found: list[Metric] = []
    known = {axis.name: axis for axis in axes()}
    for point, registered in METRICS.items():
        metric = replace(registered, package=METRICS.package(point))
        if metric.axis not in known:
            raise ConfigurationError(
                f"metric {metric.name!r}: axis is {metric.axis!r}; use one of {', '.join(known)}"
            )
        others = (*known[metric.axis].own_metrics, *found)
        if any(other.name == metric.name and other.axis == metric.axis for other in others):
            raise ConfigurationError(
                f"metric {metric.name!r}: the axis {metric.axis!r} has one of this name already; "
                "choose another name"
            )
        found.append(metric)
    return tuple(found)


@cache
def plugged_in_axes() -> frozenset[str]:
    """Names of the axes that other packages register."""
    return frozenset(name for point in AXES if not AXES.own(point) for name in AXES[point].names)


@cache
def _packages_of_axes() -> dict[str, str | None]:
    return {AXES[point].name: AXES.package(point) for point in AXES}


def axis_code(axis: Axis) -> AbstractContextManager[None]:
    """Calls of an axis; an exception in the code of another package becomes an error naming it.

    Raises
    ------
    ConfigurationError
        See `granbench.benchmark.package_code.package_code`.
    """
    return package_code(f"axis {axis.name!r}", _packages_of_axes().get(axis.name))


def of_every_axis(call: Callable[[Axis], Iterable[Result]]) -> Iterator[Result]:
    """The results of a call for every axis, in the order of the scorecard, within `axis_code`."""
    for axis in axes():
        with axis_code(axis):
            results = iter(call(axis))
        while True:
            with axis_code(axis):
                result = next(results, _NO_MORE)
            if isinstance(result, _NoMore):
                break
            yield result


def axis_names() -> tuple[str, ...]:
    """Names of everything that a model can be evaluated on, in order."""
    return tuple(name for axis in axes() for name in axis.names)


def chosen_axes(names: Iterable[str] | None) -> tuple[str, ...]:
    """The named axes, each once, in the order of the scorecard; all of them for None.

    Raises
    ------
    ConfigurationError
        If one is unknown, or there is none.
    """
    known = axis_names()
    wanted = set(known if names is None else names)
    if unknown := sorted(wanted - set(known)):
        raise ConfigurationError(f"unknown axis {unknown[0]!r}; use {', '.join(known)}")
    if not wanted:
        raise ConfigurationError(f"there is no axis to evaluate; use {', '.join(known)}")
    return tuple(name for name in known if name in wanted)


def find_axis(name: str) -> Axis | None:
    """The registered axis that a name, such as that of a score, belongs to; None: not installed."""
    return next((axis for axis in axes() if name in axis.names), None)


def find_part(name: str) -> Part | None:
    """The protocol, check or solver of that name; None where there is none."""
    return next((part for axis in axes() for part in axis.parts if part.name == name), None)


def find_metric(axis: str, name: str) -> Metric | None:
    """The metric of a score.

    Parameters
    ----------
    axis : name of the score's axis
    name : of the metric, with the label of its component
    """
    found = find_axis(axis)
    if found is None:
        return None
    return next((metric for metric in found.metrics() if metric.is_named(name)), None)


def is_plugged_in(axis: str, name: str) -> bool:
    """Whether another package brings the metric of a score, or its axis.

    Parameters
    ----------
    axis, name : as of `find_metric`
    """
    return axis in plugged_in_axes() or find_metric(axis, name) in plugged_in_metrics()


def headline_axis() -> Axis:
    """The axis with the score that models are ranked by.

    Raises
    ------
    ConfigurationError
        If no registered axis has one.
    """
    for axis in axes():
        if axis.headline is not None:
            return axis
    raise ConfigurationError("no registered axis has a headline; install granbench again")


def layout() -> dict[str, Stored]:
    """Every variable that a predictions file may hold."""
    return {name: stored for axis in axes() for name, stored in axis.layout.items()}


def labels() -> dict[str, Sequence[str]]:
    """Coordinates of a predictions file with the labels that they may have."""
    return {name: allowed for axis in axes() for name, allowed in axis.labels.items()}
