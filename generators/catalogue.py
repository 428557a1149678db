"""The datasets that can be generated, and the function that does it."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from granbench.errors import RegistryError
from granbench.generators.campaign import CampaignReport

Generate = Callable[..., tuple[Path, CampaignReport]]

GENERATORS = {
    "dem-triaxial": "granbench.generators.dem.generate:generate",
    "gp-j2": "granbench.generators.classical.generate:gp_j2",
    "gp-dp": "granbench.generators.classical.generate:gp_dp",
    "gp-j2-hardening": "granbench.generators.classical.generate:gp_j2_hardening",
    "gp-ime": "granbench.generators.classical.generate:gp_ime",
    "gp-csuh": "granbench.generators.classical.generate:gp_csuh",
    "fem-ime": "granbench.generators.fem.generate:fem_ime",
    "fem-csuh": "granbench.generators.fem.generate:fem_csuh",
}
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
