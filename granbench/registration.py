"""Objects that packages register by entry points: looked up by name, imported when first used.

A package registers an object in its ``pyproject.toml``, as ``name = "module:object"`` under the
entry-point group; no module of GranBench holds a second list of the names.
"""

import sys
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from granbench.errors import GranbenchError, RegistryError, alternatives

OWN_DISTRIBUTION = "granbench"

Registered = TypeVar("Registered")


class Registry(Mapping[str, Registered], Generic[Registered]):
    """The objects of an entry-point group by name, sorted.

    Only the object that is looked up is imported, so that a broken package affects its own names
    alone. A name that GranBench itself registers is always its own object.

    Parameters
    ----------
    group : entry-point group, such as `granbench.models`
    kind : what an object of the group is, for errors, such as `classical model`
    contract : class that a registered object is an instance of
    classes : whether subclasses of `contract` are registered instead of instances
    names_agree : whether the attribute `name` of an object must be the name of its entry point
    error : type of every error
    """

    def __init__(
        self,
        group: str,
        kind: str,
        contract: type,
        *,
        classes: bool = False,
        names_agree: bool = False,
        error: type[GranbenchError] = RegistryError,
    ) -> None:
        self.group = group
        self.kind = kind
        self.contract = contract
        self.classes = classes
        self.names_agree = names_agree
        self.error = error

    def __getitem__(self, name: str) -> Registered:
        return self._checked(self._point(name))

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in _points_by_name(self.group, tuple(sys.path))

    def __iter__(self) -> Iterator[str]:
        return iter(registered_names(self.group))

    def __len__(self) -> int:
        return len(_points_by_name(self.group, tuple(sys.path)))

    def find(self, name: str) -> Registered:
        """The object of that name.

        Raises
        ------
        GranbenchError
            Of the type `error`, if there is none of this name, two packages register it, or its
            package is broken.
        """
        if name not in self:
            raise self.error(f"unknown {self.kind} {name!r}: {alternatives(name, self)}")
        return self[name]

    def own(self, name: str) -> bool:
        """Whether GranBench itself registers the name, so that its own object is used."""
        return any(map(_is_own, self._points(name)))

    def package(self, name: str) -> str | None:
        """Name of the package that registers a name; None for GranBench itself.

        Raises
        ------
        KeyError
            If none does.
        """
        point = self._point(name)
        return None if _is_own(point) else _package(point)

    def _points(self, name: str) -> tuple[EntryPoint, ...]:
        return _points_by_name(self.group, tuple(sys.path)).get(name, ())

    def _point(self, name: str) -> EntryPoint:
        points = self._points(name)
        if not points:
            raise KeyError(name)
        if self.own(name):
            return next(filter(_is_own, points))
        if len({point.value for point in points}) > 1:
            packages = " and ".join(sorted(map(_package, points)))
            raise self.error(
                f"{self.kind} {name!r} is registered more than once, by the packages {packages}; "
                "uninstall one of them"
            )
        return points[0]

    def _checked(self, point: EntryPoint) -> Any:
        """The object behind an entry point, if it is what the group holds."""
        where = (
            f"{self.kind} {point.name!r}, which the package {_package(point)} registers as "
            f"{point.value},"
        )
        remedy = "correct or uninstall that package"
        try:
            found = point.load()
        except (Exception, SystemExit) as error:  # code of another package
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            raise self.error(f"{where} cannot be loaded ({reason}); {remedy}") from error
        contract = f"{self.contract.__module__}.{self.contract.__qualname__}"
        if self.classes and not (isinstance(found, type) and issubclass(found, self.contract)):
            raise self.error(f"{where} must be a subclass of {contract}; {remedy}")
        if not self.classes and not isinstance(found, self.contract):
            raise self.error(f"{where} must be an object of type {contract}; {remedy}")
        if self.names_agree and found.name != point.name:
            raise self.error(f"{where} has the name {found.name!r}; use the same name in both")
        return found


def registered_names(group: str) -> list[str]:
    """Names in an entry-point group, sorted; nothing is imported."""
    return sorted(_points_by_name(group, tuple(sys.path)))


@cache
def _points_by_name(group: str, path: tuple[str, ...]) -> Mapping[str, tuple[EntryPoint, ...]]:
    """Entry points of a group by name; they are read again where the import path has changed."""
    found: dict[str, tuple[EntryPoint, ...]] = {}
    for point in entry_points(group=group):
        found[point.name] = (*found.get(point.name, ()), point)
    return found


def _is_own(point: EntryPoint) -> bool:
    return point.dist is not None and point.dist.name.lower() == OWN_DISTRIBUTION


def _package(point: EntryPoint) -> str:
    return point.module if point.dist is None else point.dist.name
