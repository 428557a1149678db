"""The classical models by name."""

from collections.abc import Mapping

from granbench.errors import ModelError, alternatives
from granbench.models.classical import ClassicalCell
from granbench.models.csuh import CSUH
from granbench.models.drucker_prager import DruckerPrager
from granbench.models.enhanced_ime import EnhancedIME
from granbench.models.ime import IME
from granbench.models.j2 import J2
from granbench.models.j2_hardening import J2Hardening
from granbench.models.modified_cam_clay import ModifiedCamClay

MODELS: Mapping[str, type[ClassicalCell]] = {
    model.name: model
    for model in (
        J2,
        DruckerPrager,
        J2Hardening,
        IME,
        EnhancedIME,
        CSUH,
        ModifiedCamClay,
    )
}


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
