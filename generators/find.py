"""The registered generators, and which of them makes a dataset.

A family registers its `Generator` object as an entry point of the group `granbench.generators`.
The name of the entry point is that of the family, with which the names of its datasets begin: so
`fem` makes `fem-ime`, and one family is imported, not all of them.
"""

from importlib.metadata import EntryPoint, entry_points

from granbench.errors import RegistryError
from granbench.generators.generator import Generator

ENTRY_POINTS = "granbench.generators"


def find_generator(dataset: str) -> Generator:
    """The generator that makes a dataset.

    Parameters
    ----------
    dataset : name, such as `gp-j2`

    Raises
    ------
    RegistryError
        If no generator makes it, or its generator cannot be imported.
    """
    families = _families()
    owners = [family for family in families if _belongs(dataset, family)]
    if owners:
        generator = _load(families[max(owners, key=len)])
        if dataset in generator.datasets:
            return generator
    raise RegistryError(f"unknown dataset {dataset!r}; use one of {', '.join(dataset_names())}")


def dataset_names() -> list[str]:
    """Names of all datasets that can be generated, family by family.

    Families that cannot be imported are left out; `find_generator` gives the reason.
    """
    names: list[str] = []
    for family, point in sorted(_families().items()):
        try:
            names += [name for name in _load(point).datasets if _belongs(name, family)]
        except RegistryError:
            continue
    return names


def _families() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=ENTRY_POINTS)}


def _belongs(dataset: str, family: str) -> bool:
    return dataset == family or dataset.startswith(f"{family}-")


def _load(point: EntryPoint) -> Generator:
    try:
        loaded = point.load()
    except Exception as error:  # a package from outside may raise anything
        raise RegistryError(
            f"generator {point.name!r} cannot be imported from {point.value} "
            f"({type(error).__name__}: {error}); correct or uninstall the package that provides it"
        ) from error
    if not isinstance(loaded, Generator):
        raise RegistryError(
            f"generator {point.name!r}: {point.value} is not a granbench.generators.generator."
            "Generator; correct the package that provides it"
        )
    return loaded
