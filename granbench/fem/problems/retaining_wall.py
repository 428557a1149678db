"""A wall pushed into the soil behind it: passive earth pressure (thesis, Sec 4.3.2, 5.3.2).

              surcharge p_c
           | | | | | | | | | | |
           v v v v v v v v v v v
         o+---------------------+#       left: held in x, free to slide (o)
         o|                     |# <--   right: the wall (#) moves to the left
         o|                     |# <--   rough wall: it holds the soil in y; smooth: it does not
         o|                     |#
          +---------------------+        bottom: held in x and y
          //////////////////////

The supports are the thesis', which gives no size: the soil is 1 m high here and 2.5 m long, longer
than the passive wedge of a friction angle up to 45 degrees. The soil is weightless by default, and
confined by a surcharge, so that models that were made at one pressure stay near it; with `weight`
the stress at the start grows with depth, equally in all directions. The node at the wall's toe
belongs to the base, and the wall begins above it.

The reaction is the force of the wall, per metre of thickness. The driving strain is the wall's
displacement over the length of the soil.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from granbench.fem.loading import Loading, Prescribed
from granbench.fem.mesh import REACH, Floats, PlaneMesh
from granbench.fem.operators import ORDER
from granbench.fem.problems.problem import Problem
from granbench.fem.structured import rectangle
from granbench.tensors import normal_mask

LENGTH, HEIGHT = 2.5, 1.0
GRAVITY = 9.81
"""m/s2."""


@dataclass(frozen=True, kw_only=True)
class RetainingWall(Problem):
    """See the module, and `Problem` for the other choices.

    Parameters
    ----------
    wall : smooth or rough
    weight : whether the soil has weight
    """

    name: ClassVar[str] = "retaining-wall"
    title: ClassVar[str] = "Retaining wall, passive"
    drive: ClassVar[str] = "displacement of the wall towards the soil"
    reaction: ClassVar[str] = "force of the wall"
    length: ClassVar[str] = "length of the soil"
    meshes: ClassVar[Mapping[str, Callable[[], PlaneMesh]]] = {
        "coarse": partial(rectangle, LENGTH, HEIGHT, 10, 4),
        "medium": partial(rectangle, LENGTH, HEIGHT, 15, 6),
        "fine": partial(rectangle, LENGTH, HEIGHT, 30, 12),
        "table-5.2": partial(rectangle, LENGTH, HEIGHT, 17, 4),  # 272 points for the table's 271
    }
    default_mesh: ClassVar[str] = "table-5.2"
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = {"wall": ("smooth", "rough")}

    wall: str = field(default="smooth", metadata={"meaning": "smooth or rough"})
    weight: bool = field(default=False, metadata={"meaning": "whether the soil has weight"})
    end_strain: float = 0.05

    @property
    def drive_length(self) -> float:
        """See `Problem.drive_length`."""
        return LENGTH

    def loading(self, mesh: PlaneMesh) -> Loading:
        """See `Problem.loading`."""

        def above_the_toe(nodes: Floats) -> Floats:
            return np.where(nodes[:, 1] > REACH * HEIGHT, -1.0, 0.0)

        supports = (
            Prescribed("bottom", x=0.0, y=0.0),
            Prescribed("left", x=0.0),
            Prescribed("right", x=above_the_toe, y=0.0 if self.wall == "rough" else None),
        )
        gravity = (0.0, -GRAVITY if self.weight else 0.0)
        return Loading(supports, self.drive_history(), self.pressures("top"), gravity)

    def initial_stress(self, positions: Floats, density: float) -> Floats:
        """See `Problem.initial_stress`."""
        stress = super().initial_stress(positions, density)
        if self.weight:
            weight = density * GRAVITY * (HEIGHT - positions[:, 1])
            stress += np.outer(normal_mask(ORDER), weight)
        return stress
