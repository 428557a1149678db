"""The datasets that can be generated, and the function that does it."""

import os
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from granbench.errors import ConfigurationError, RegistryError
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


def require_usable(folder: Path) -> None:
    """Refuse, before hours of work, a folder into which no dataset could be written.

    Raises
    ------
    ConfigurationError
        If the netCDF library cannot write to a file of that path.
    """
    raw = os.fsencode(folder)
    try:
        text = raw.decode()
    except UnicodeDecodeError:
        text = ""
    if not text or "\\" in text:
        shown = raw.decode(errors="replace")
        raise ConfigurationError(
            f"{shown}: netCDF cannot write below a folder whose name has a backslash or is not "
            "UTF-8; name another folder with --out"
        )
