"""A rigid strip footing pressed into soil (thesis, Sec 5.3.3); one half, by symmetry.

          footing
          |######|  surcharge p_c                 footing: moves down; rough: it holds the soil in
          |######| | | | | | | | | |              x, smooth: it does not
          vvvvvvvv v v v v v v v v v
        o+--------+-----------------+o            left: the plane of symmetry, held in x (o)
        o|                          |o            right: held in x, free to slide
        o|                          |o
        o|                          |o
         +--------------------------+             bottom: held in x and y
         ///////////////////////////

The thesis draws no size: the footing is 1 m wide here, and the half that is analysed 2.5 m wide
and 1.5 m deep. Cells grow with the distance from the footing's edge. The soil is weightless, and
confined by the surcharge around the footing; at the start the footing bears it, too.

The reaction is the force of half of the footing, per metre of thickness. The driving strain is the
settlement over the footing's width.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from granbench.fem.loading import Loading, Prescribed
from granbench.fem.mesh import PlaneMesh
from granbench.fem.problems.problem import Problem
from granbench.fem.structured import graded, grid, sides

HALF, LENGTH, DEPTH = 0.5, 2.5, 1.5
"""Half the width of the footing, and size of the half that is analysed, m."""


def half_space(
    under: int, beside: int, rows: int, growth: float = 3.0, element: str = "quad8"
) -> PlaneMesh:
    """Half of the soil, with boundaries footing, surface, left, right, bottom.

    Parameters
    ----------
    under, beside, rows : cells under the half footing, beside it, and in depth
    growth : size of the farthest cells relative to those at the footing
    element : a key of `ELEMENTS`
    """
    # Under the footing cells shrink towards its edge, where the stress is singular.
    inside = HALF - graded(HALF, under, growth**0.5)[::-1]
    outside = HALF + graded(LENGTH - HALF, beside, growth * (LENGTH / HALF) ** 0.5)
    y = DEPTH - graded(DEPTH, rows, growth)[::-1]
    named = sides(0.0, LENGTH, 0.0, DEPTH)
    top = named.pop("top")
    boundaries = {
        **named,
        "footing": lambda x: top(x) & (x[0] < HALF),
        "surface": lambda x: top(x) & (x[0] > HALF),
    }
    return grid(np.concatenate([inside, outside[1:]]), y, element, boundaries)


@dataclass(frozen=True, kw_only=True)
class StripFooting(Problem):
    """See the module, and `Problem` for the other choices.

    Parameters
    ----------
    base : of the footing, rough or smooth
    """

    name: ClassVar[str] = "strip-footing"
    title: ClassVar[str] = "Rigid strip footing"
    drive: ClassVar[str] = "settlement of the footing"
    reaction: ClassVar[str] = "force of half of the footing"
    length: ClassVar[str] = "width of the footing"
    meshes: ClassVar[Mapping[str, Callable[[], PlaneMesh]]] = {
        "coarse": partial(half_space, 3, 7, 5),
        "medium": partial(half_space, 5, 12, 8),
        "fine": partial(half_space, 10, 24, 16),
        "table-5.2": partial(half_space, 5, 12, 8),  # 544 points for the table's 546
    }
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = {"base": ("rough", "smooth")}

    base: str = field(default="rough", metadata={"meaning": "of the footing: rough or smooth"})

    @property
    def drive_length(self) -> float:
        """See `Problem.drive_length`."""
        return 2.0 * HALF

    def loading(self, mesh: PlaneMesh) -> Loading:
        """See `Problem.loading`."""
        supports = (
            Prescribed("bottom", x=0.0, y=0.0),
            Prescribed("left", x=0.0),
            Prescribed("right", x=0.0),
            Prescribed("footing", x=0.0 if self.base == "rough" else None, y=-1.0),
        )
        return Loading(supports, self.drive_history(), self.pressures("surface"))
