"""Objects that packages register by entry points: looked up by name, imported when first used.

A package registers an object in its ``pyproject.toml``, as ``name = "module:object"`` under the
entry-point group; no module of GranBench holds a second list of the names.
"""

import sys
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from granbench.errors import ModelError

OWN_DISTRIBUTION = "granbench"

Registered = TypeVar("Registered")


class Registry(Mapping[str, Registered], Generic[Registered]):
    """The objects of an entry-point group by name, sorted.

    Where two packages register one name, that of GranBench itself is used.

    Parameters
    ----------
    group : entry-point group, such as `granbench.models`
    kind : what an object of the group is, for errors, such as `classical model`
    """

    def __init__(self, group: str, kind: str) -> None:
        self.group = group
        self.kind = kind

    def __getitem__(self, name: str) -> Registered:
        points = self._points(name)
        if not points:
            raise KeyError(name)
        point = next((point for point in points if is_own(point)), points[0])
        return self._loaded(point)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in _points_by_name(self.group, tuple(sys.path))

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(_points_by_name(self.group, tuple(sys.path))))

    def __len__(self) -> int:
        return len(_points_by_name(self.group, tuple(sys.path)))

    def own(self, name: str) -> bool:
        """Whether GranBench itself registers the name, so that its own object is used."""
        return any(map(is_own, self._points(name)))

    def _points(self, name: str) -> tuple[EntryPoint, ...]:
        return _points_by_name(self.group, tuple(sys.path)).get(name, ())

    def _loaded(self, point: EntryPoint) -> Any:
        try:
            return point.load()
        except (Exception, SystemExit) as error:  # code of another package
            package = point.dist.name if point.dist is not None else point.module
            raise ModelError(
                f"{self.kind} {point.name!r}, which the package {package} registers as "
                f"{point.value}, cannot be loaded ({type(error).__name__}: {error}); correct or "
                "uninstall that package"
            ) from error


@cache
def _points_by_name(group: str, path: tuple[str, ...]) -> Mapping[str, tuple[EntryPoint, ...]]:
    """Entry points of a group by name; they are read again where the import path has changed."""
    found: dict[str, tuple[EntryPoint, ...]] = {}
    for point in entry_points(group=group):
        found[point.name] = (*found.get(point.name, ()), point)
    return found


def is_own(point: EntryPoint) -> bool:
    """Whether an entry point is of GranBench itself, not of another package."""
    return point.dist is not None and point.dist.name.lower() == OWN_DISTRIBUTION
