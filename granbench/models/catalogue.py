"""The registered classical models by name.

A package registers a model under the entry-point group `granbench.models`, as
``name = "module:Class"`` with a subclass of `ClassicalCell`; there is no second list of names.
"""

from granbench.errors import ModelError, alternatives
from granbench.models.classical import ClassicalCell
from granbench.registration import Registry

ENTRY_POINTS = "granbench.models"

MODELS: Registry[type[ClassicalCell]] = Registry(ENTRY_POINTS, "classical model")
"""Every registered classical model."""


def find_model(name: str) -> type[ClassicalCell]:
    """The classical model `name`.

    Raises
    ------
    ModelError
        If there is none of this name.
    """
    if name in MODELS:
        return MODELS[name]
    raise ModelError(f"unknown classical model {name!r}: {alternatives(name, MODELS)}")
