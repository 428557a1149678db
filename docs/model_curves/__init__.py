"""Tests shown on the pages of the classical models, with one function for each model."""

from collections.abc import Callable, Mapping

from model_curves.critical_state import csuh, modified_cam_clay
from model_curves.element import Comparison, Evidence
from model_curves.ime import enhanced_ime, ime
from model_curves.plane import drucker_prager, j2, j2_hardening

EVIDENCE: Mapping[str, Callable[[], Evidence]] = {
    "j2": j2,
    "drucker-prager": drucker_prager,
    "j2-hardening": j2_hardening,
    "ime": ime,
    "enhanced-ime": enhanced_ime,
    "csuh": csuh,
    "modified-cam-clay": modified_cam_clay,
}

__all__ = ["EVIDENCE", "Comparison", "Evidence"]
