"""Objects that packages register by entry points: looked up by name, imported when first used.

A package registers an object in its ``pyproject.toml``, as ``name = "module:object"`` under the
entry-point group; no module of GranBench holds a second list of the names.
"""

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from granbench.errors import GranbenchError, RegistryError, alternatives

OWN_DISTRIBUTION = "granbench"

Registered = TypeVar("Registered")


@dataclass(frozen=True)
class _Registration:
    """An entry point with the name of its package, which is read while its files can be found."""

    point: EntryPoint
    package: str

    @property
    def own(self) -> bool:
        """Whether GranBench itself registers it."""
        return self.package.lower() == OWN_DISTRIBUTION


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
        return self._checked(self._entry(name))

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in _entries_by_name(self.group, tuple(sys.path))

    def __iter__(self) -> Iterator[str]:
        return iter(registered_names(self.group))

    def __len__(self) -> int:
        return len(_entries_by_name(self.group, tuple(sys.path)))

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
        return any(entry.own for entry in self._entries(name))

    def package(self, name: str) -> str | None:
        """Name of the package that registers a name; None for GranBench itself.

        Raises
        ------
        KeyError
            If none does.
        """
        entry = self._entry(name)
        return None if entry.own else entry.package

    def _entries(self, name: str) -> tuple[_Registration, ...]:
        return _entries_by_name(self.group, tuple(sys.path)).get(name, ())

    def _entry(self, name: str) -> _Registration:
        entries = self._entries(name)
        if not entries:
            raise KeyError(name)
        for entry in entries:
            if entry.own:
                return entry
        if len({entry.point.value for entry in entries}) > 1:
            packages = " and ".join(sorted(entry.package for entry in entries))
            raise self.error(
                f"{self.kind} {name!r} is registered more than once, by the packages {packages}; "
                "uninstall one of them"
            )
        return entries[0]

    def _checked(self, entry: _Registration) -> Any:
        """The object behind an entry point, if it is what the group holds."""
        point = entry.point
        where = (
            f"{self.kind} {point.name!r}, which the package {entry.package} registers as "
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
    return sorted(_entries_by_name(group, tuple(sys.path)))


@cache
def _entries_by_name(group: str, path: tuple[str, ...]) -> Mapping[str, tuple[_Registration, ...]]:
    """Entry points of a group by name; they are read again where the import path has changed."""
    found: dict[str, tuple[_Registration, ...]] = {}
    for point in entry_points(group=group):
        package = point.module if point.dist is None else point.dist.name
        found[point.name] = (*found.get(point.name, ()), _Registration(point, package))
    return found
