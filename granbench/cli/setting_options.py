"""The settings that library errors name, written as options of the command line."""

from collections.abc import Mapping

from granbench.errors import Setting

OPTIONS: Mapping[str, str] = {
    "columns": "--column",
    "folder": "--dest",
    "initial_void_ratio": "--e0",
    "left_out": "--leave-out",
    "minutes": "`granbench data fetch --make`",
    "units": "--unit",
    "weights": "--weight",
}
"""Option of each setting whose option has another name than the setting."""


def option_of(name: str) -> str:
    """The option of a setting, such as ``--strain-measure`` of `strain_measure`."""
    return OPTIONS.get(name, f"--{name.replace('_', '-')}")


def option_text(setting: Setting) -> str:
    """A setting as a user gives it on the command line, such as ``--unit stress=kPa``."""
    option, value = option_of(setting.name), setting.value
    if value is None or value is True:
        return option
    if isinstance(value, Mapping):
        return " ".join(f"{option} {name}={part}" for name, part in value.items())
    if isinstance(value, tuple):
        return " ".join(f"{option} {part!r}" for part in value)
    return f"{option} {value:g}" if isinstance(value, float) else f"{option} {value}"
