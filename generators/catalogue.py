"""The datasets that can be generated, and the function that does it."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from granbench.errors import RegistryError
from granbench.generators.campaign import CampaignReport

Generate = Callable[..., tuple[Path, CampaignReport]]

GENERATORS = {"dem-triaxial": "granbench.generators.dem.generate:generate"}
"""``module:function`` of each dataset, imported only when it is asked for."""


def generator(dataset: str) -> Generate:
    """The function that generates a dataset: (preset, out, seed=, workers=, scheduler=, ...).

    Raises
    ------
    RegistryError
        If no generator makes it.
    """
    if dataset not in GENERATORS:
        raise RegistryError(
            f"dataset {dataset!r} has no generator; use one of {', '.join(GENERATORS)}"
        )
    module, _, name = GENERATORS[dataset].partition(":")
    function: Any = getattr(import_module(module), name)
    return function
