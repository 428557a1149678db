"""Settings of an architecture, as a model file keeps them."""

from dataclasses import asdict
from typing import Annotated, Any, ClassVar, Self

from pydantic import ConfigDict, Field, StrictInt, ValidationError
from pydantic.dataclasses import dataclass

from granbench.errors import ModelError
from granbench.files.validation import first_fault

Count = Annotated[StrictInt, Field(ge=1)]
"""A width, or a number of layers or steps."""

SETTINGS = ConfigDict(extra="forbid")


@dataclass(frozen=True, config=SETTINGS)
class NetworkConfiguration:
    """Base of the settings of a network; a subclass is a pydantic dataclass with its fields.

    Attributes
    ----------
    widths : names of the fields that the size of the network depends on; `layers` is their number,
        the others are widths
    """

    widths: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def of(cls, settings: dict[str, Any]) -> Self:
        """The configuration with the settings in a model file.

        Raises
        ------
        ModelError
            Naming the setting that is unknown, missing or out of range.
        """
        try:
            return cls(**settings)
        except ValidationError as error:
            raise ModelError(f"setting {first_fault(error)}") from error

    def as_dict(self) -> dict[str, Any]:
        """Settings by name, for a file."""
        return asdict(self)

    def sizes(self) -> dict[str, int]:
        """Number of layers, as `layers`, and widths by name: what the memory depends on."""
        return {name: getattr(self, name) for name in self.widths}
