"""Settings from the texts of the options of `granbench fit`."""

from collections.abc import Sequence

from granbench.errors import ConfigurationError


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
