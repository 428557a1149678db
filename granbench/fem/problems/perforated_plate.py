r"""A square plate with a hole in its middle, pulled; one quarter (thesis, Sec 6.4: 0.1 m x 0.1 m).

           ^^^^^^^^^^^^^^        the upper edge moves up as a whole and is free to contract
         o+--------------+
         o|              |       left: plane of symmetry, held in x
         o|              |       bottom: plane of symmetry, held in y
         o+--__          |
               \         |       hole: a quarter circle around the origin
                |        |
                +--------+
                 oooooooo

The thesis gives the size of the quarter and not that of the hole: its radius is 25 mm here, a
quarter of the plate's half width, which makes the stress at its edge about that of an infinite
plate (Kirsch). Models that are defined under compression only are confined on the right edge and
in the hole.

The reaction is the pull on the quarter's upper edge, per metre of thickness. The driving strain is
the displacement over the quarter's height. The limit of perfectly plastic material of shear
strength k is that of the net section, 2 k (b - a).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from granbench.fem.loading import Loading, Prescribed
from granbench.fem.mesh import REACH, Floats, PlaneMesh
from granbench.fem.problems.problem import Problem
from granbench.fem.structured import graded, grid, sides

SIDE, RADIUS = 0.1, 0.025


def quarter_plate(
    around: int, outward: int, element: str = "quad8", radius: float = RADIUS
) -> PlaneMesh:
    """A quarter of the plate, with boundaries left, right, bottom, top and hole.

    Parameters
    ----------
    around : cells along the hole, an even number, so that the plate's corner is a node
    outward : cells from the hole to the edges; they grow with the distance
    element : a key of `ELEMENTS`
    radius : of the hole, m
    """

    def placed(share: Floats, angle: Floats) -> tuple[Floats, Floats]:
        cosine, sine = np.cos(angle), np.sin(angle)
        edge = SIDE / np.maximum(cosine, sine)
        distance = radius + share * (edge - radius)
        # On the planes of symmetry to the last bit.
        x = np.where(angle == 0.5 * np.pi, 0.0, distance * cosine)
        return x, np.where(angle == 0.0, 0.0, distance * sine)

    named = sides(0.0, SIDE, 0.0, SIDE)
    hole = (1.0 + REACH) * radius
    boundaries = {**named, "hole": lambda x: np.hypot(x[0], x[1]) < hole}
    return grid(
        graded(1.0, outward, 4.0),
        np.linspace(0.0, 0.5 * np.pi, around + 1),
        element,
        boundaries,
        mapped=placed,
    )


@dataclass(frozen=True, kw_only=True)
class PerforatedPlate(Problem):
    """See the module, and `Problem` for the choices."""

    name: ClassVar[str] = "perforated-plate"
    title: ClassVar[str] = "Perforated plate in tension, a quarter"
    drive: ClassVar[str] = "upward displacement of the upper edge"
    reaction: ClassVar[str] = "pull on the upper edge"
    length: ClassVar[str] = "height of the quarter"
    meshes: ClassVar[Mapping[str, Callable[[], PlaneMesh]]] = {
        "coarse": partial(quarter_plate, 6, 5),
        "medium": partial(quarter_plate, 12, 9),
        "fine": partial(quarter_plate, 24, 18),
    }

    @property
    def drive_length(self) -> float:
        """See `Problem.drive_length`."""
        return SIDE

    def loading(self, mesh: PlaneMesh) -> Loading:
        """See `Problem.loading`."""
        supports = (
            Prescribed("left", x=0.0),
            Prescribed("bottom", y=0.0),
            Prescribed("top", y=1.0),
        )
        return Loading(supports, self.drive_history(), self.pressures("right", "hole"))
