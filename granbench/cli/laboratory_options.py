"""Options of `granbench fit` for laboratory files: their texts, and how errors name them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from granbench.errors import ConfigurationError, GranbenchError, Setting

OPTIONS: Mapping[str, str] = {
    "columns": "--column",
    "units": "--unit",
    "ignore": "--ignore",
    "kind": "--kind",
    "stresses": "--stresses",
    "monotonic": "--monotonic",
    "tension_positive": "--tension-positive",
    "strain_measure": "--strain-measure",
    "initial_void_ratio": "--e0",
    "lateral_stress": "--lateral-stress",
    "cell_pressure": "--cell-pressure",
    "back_pressure": "--back-pressure",
    "k0": "--k0",
    "free": "--free",
    "control": "--control",
    "weights": "--weight",
    "left_out": "--leave-out",
}
"""Option of each field of `ImportSettings` and `FitSettings`, and argument of `fit`."""


def option_text(setting: Setting) -> str:
    """A setting as a user gives it on the command line, such as ``--unit stress=kPa``."""
    option, value = OPTIONS.get(setting.name), setting.value
    if option is None:
        return str(setting)
    if value is None or value is True:
        return option
    if isinstance(value, Mapping):
        return " ".join(f"{option} {name}={part}" for name, part in value.items())
    if isinstance(value, tuple):
        return " ".join(f"{option} {part!r}" for part in value)
    return f"{option} {value:g}" if isinstance(value, float) else f"{option} {value}"


@contextmanager
def settings_as_options() -> Iterator[None]:
    """Write the settings in the text of an error as options of the command line."""
    try:
        yield
    except GranbenchError as error:
        error.args = (error.spelled(option_text),)
        raise


def named_texts(option: str, texts: Sequence[str] | None) -> dict[str, str]:
    """Values by name, from texts NAME=VALUE.

    Raises
    ------
    ConfigurationError
        If a text is not such a pair.
    """
    pairs = {}
    for text in texts or ():
        name, sign, value = text.partition("=")
        if not (sign and name and value):
            raise ConfigurationError(f"{option} {text!r}: give NAME=VALUE")
        pairs[name.strip()] = value.strip()
    return pairs


def named_columns(texts: Sequence[str] | None) -> dict[str, str]:
    """Header of each quantity, from QUANTITY=HEADER or HEADER=QUANTITY."""
    from granbench.laboratory.quantities import QUANTITIES

    columns: dict[str, str] = {}
    for text in texts or ():
        first, _, rest = text.partition("=")
        front, _, last = text.rpartition("=")
        if first.strip() not in QUANTITIES and last.strip() in QUANTITIES and front:
            first, rest = last, front
        columns |= named_texts("--column", [f"{first}={rest}" if rest else text])
    return columns


def named_numbers(option: str, texts: Sequence[str] | None) -> dict[str, float]:
    """Numbers by name, from texts NAME=NUMBER.

    Raises
    ------
    ConfigurationError
        If a text is not such a pair.
    """
    numbers = {}
    for name, text in named_texts(option, texts).items():
        try:
            numbers[name] = float(text)
        except ValueError as error:
            raise ConfigurationError(f"{option}: {text!r} is not a number") from error
    return numbers
