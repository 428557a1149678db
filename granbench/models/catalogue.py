"""The registered classical models by name.

A package registers a model under the entry-point group `granbench.models`, as
``name = "module:Class"`` with a subclass of `ClassicalCell`; there is no second list of names.
"""

from granbench.errors import ModelError
from granbench.models.classical import ClassicalCell
from granbench.registration import Registry

MODELS: Registry[type[ClassicalCell]] = Registry(
    "granbench.models",
    "classical model",
    ClassicalCell,
    classes=True,
    names_agree=True,
    error=ModelError,
)
"""Every registered classical model."""


def find_model(name: str) -> type[ClassicalCell]:
    """The classical model `name`.

    Raises
    ------
    ModelError
        If there is none of this name, or the package that registers it is broken.
    """
    return MODELS.find(name)
