"""Help texts with the names of what is registered, looked up when the help is shown."""

import re
from typing import Any

from typer.core import TyperCommand

from granbench.registration import registered_names

PLACE = re.compile(r"\{(\w+)\}")


class CommandWithNames(TyperCommand):
    """A command whose help shows all names in `granbench.problems` in place of ``{problems}``.

    The same holds for every group of entry points; no registered object is imported.
    """

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """See `TyperCommand.format_help`."""
        for parameter in self.params:
            text = getattr(parameter, "help", None)
            if text:
                parameter.help = PLACE.sub(_names, text)  # type: ignore[attr-defined]
        super().format_help(ctx, formatter)


def _names(place: re.Match[str]) -> str:
    return ", ".join(registered_names(f"granbench.{place[1]}")) or "none is registered"
