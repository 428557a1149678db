"""The registered generators, and which of them makes a dataset.

A family registers its `Generator` object as an entry point of the group `granbench.generators`.
The name of the entry point is that of the family, with which the names of its datasets begin: so
`fem` makes `fem-ime`, and one family is imported, not all of them.
"""

from granbench.errors import RegistryError
from granbench.generators.generator import Generator
from granbench.registration import Registry

GENERATORS: Registry[Generator] = Registry("granbench.generators", "generator", Generator)
"""Every registered family of datasets."""


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
    owners = [family for family in GENERATORS if _belongs(dataset, family)]
    if owners:
        generator = GENERATORS[max(owners, key=len)]
        if dataset in generator.datasets:
            return generator
    raise RegistryError(f"unknown dataset {dataset!r}; use one of {', '.join(dataset_names())}")


def dataset_names() -> list[str]:
    """Names of all datasets that can be generated, family by family.

    Families that cannot be imported are left out; `find_generator` gives the reason.
    """
    names: list[str] = []
    for family in GENERATORS:
        try:
            names += [name for name in GENERATORS[family].datasets if _belongs(name, family)]
        except RegistryError:
            continue
    return names


def _belongs(dataset: str, family: str) -> bool:
    return dataset == family or dataset.startswith(f"{family}-")
