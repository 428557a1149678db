"""Abaqus' element types by name: which belong to a plane body, and their number of nodes."""

from __future__ import annotations

import re

from granbench.errors import ConfigurationError

PLANE = re.compile(r"^(?:CPEG|CPE|CPS|M3D|SFM3D|STRI|R3D|S)(65|[34689])[A-Z]*5?$")
"""Plane strain and stress; flat membranes, shells and rigid faces, as other programs write."""
LINE = re.compile(r"^(?:(?:T2D|T3D|RB2D|R2D)([23])|B[23]([123]))[A-Z]*$")
"""Trusses, rigid lines and beams."""
NODES_OF_BEAM = {"1": 2, "2": 3, "3": 2}
BESIDE = ("MASS", "SPRING", "DASHPOT", "CONN", "ROTARYI", "GAP", "ITT", "CINPE")
"""First letters of the element types that are not part of the body."""


def is_plane(kind: str) -> bool:
    """Whether a type is that of an element of the body."""
    return PLANE.match(kind) is not None


def corners_of(kind: str) -> int:
    """Corners of a type of the body, 3 or 4."""
    return 3 if nodes_of(kind) in (3, 6) else 4


def nodes_of(kind: str) -> int | None:
    """Nodes of an element type; None for one that is no part of a body.

    Raises
    ------
    ConfigurationError
        With the remedy, if the type is not one of a plane body.
    """
    if matched := PLANE.match(kind):
        return 6 if matched[1] == "65" else int(matched[1])
    if matched := LINE.match(kind):
        return int(matched[1]) if matched[1] else NODES_OF_BEAM[matched[2]]
    if kind.startswith(BESIDE):
        return None
    if kind.startswith("CAX"):
        why = "is axisymmetric, but the analysis is in plane strain; mesh with CPE4 or CPE8R"
    elif kind.startswith(("C3D", "CIN3D", "COH3D", "SC")):
        why = "is three-dimensional; mesh the plane section with CPE4 or CPE8R"
    else:
        why = (
            "is not known here; use CPE3, CPE4, CPE6 or CPE8 (also with H, I, M, P, R), or CPS in "
            "place of CPE"
        )
    raise ConfigurationError(f"element {kind} {why}")
