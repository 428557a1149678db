"""Text of what pydantic finds wrong in the content of a file."""

from typing import Annotated

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from granbench.files.validation import first_fault


class Sizes(BaseModel):
    model_config = ConfigDict(extra="forbid")

    steps: Annotated[int, Field(gt=0)]
    names: tuple[str, ...] = ()

    @field_validator("names")
    @classmethod
    def _differ(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(names)) < len(names):
            raise ValueError("two names are equal; rename one")
        return names


class Content(BaseModel):
    sizes: Sizes


@pytest.mark.parametrize(
    ("sizes", "text"),
    [
        ({"steps": 0}, "'sizes.steps' is 0 but must be greater than 0"),
        ({"steps": "many"}, "'sizes.steps' is \"many\" but must be a valid integer"),
        ({}, "'sizes.steps' is missing"),
        ({"steps": 1, "step": 2}, "'sizes.step' is unknown"),
        ({"steps": 1, "names": ["a", "a"]}, "'sizes.names': two names are equal"),
        ({"steps": 0, "names": ["a", "a"]}, "(and 1 more)"),
        (3, "'sizes' is 3 but must be an object"),
        ({"steps": "\x1b[2J" * 100}, "u001b"),
    ],
)
def test_the_field_is_named_with_its_value_and_the_rule(sizes: object, text: str) -> None:
    with pytest.raises(ValidationError) as refusal:
        Content.model_validate({"sizes": sizes})
    fault = first_fault(refusal.value)
    assert text in fault
    assert fault.isprintable() and len(fault) < 200
