r"""A dog bone pulled at its ends (thesis, Sec 6.4: 60 mm x 330 mm).

         ^^^^^^^^^^^^        the upper end moves up; both ends are held in x
        +------------+  330 mm
        |    grip    |
        +            +  245
         \  taper   /
          +        +    205
          | gauge  |
          +        +    125
         /  taper   \
        +            +   85
        |    grip    |
        +------------+    0
         ////////////

The lengths are the thesis'. It gives no width of the gauge: it is 30 mm here, half that of the
grips, and the tapers follow a cosine, so that the boundary has no corner. The driving strain is
the displacement over the whole 330 mm. Models that are defined under compression only are confined
on the free sides, and then pulled: the thesis tests the J2 family, which needs none.

The reaction is the pull at the upper end, per metre of thickness; it begins at minus the
confinement times the width.
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
from granbench.fem.structured import grid

GRIP, TAPER, GAUGE = 0.085, 0.040, 0.080
"""Lengths, m."""
HEIGHT = 2.0 * (GRIP + TAPER) + GAUGE
WIDTH, GAUGE_WIDTH = 0.060, 0.030


def width_at(y: Floats) -> Floats:
    """Width of the bone at a height, m."""
    from_middle = np.abs(y - 0.5 * HEIGHT)
    along = np.clip((from_middle - 0.5 * GAUGE) / TAPER, 0.0, 1.0)
    return GAUGE_WIDTH + (WIDTH - GAUGE_WIDTH) * 0.5 * (1.0 - np.cos(np.pi * along))


def bone(columns: int, grip: int, taper: int, gauge: int, element: str = "quad8") -> PlaneMesh:
    """The bone, with boundaries left, right, bottom, top.

    Parameters
    ----------
    columns : cells across
    grip, taper, gauge : cells along each part
    element : a key of `ELEMENTS`
    """
    lengths = (GRIP, TAPER, GAUGE, TAPER, GRIP)
    cells = (grip, taper, gauge, taper, grip)
    ends = np.cumsum((0.0, *lengths))
    pieces = [
        np.linspace(begin, end, count, endpoint=False)
        for begin, end, count in zip(ends[:-1], ends[1:], cells, strict=True)
    ]
    y = np.append(np.concatenate(pieces), HEIGHT)
    near = REACH * HEIGHT
    boundaries = {
        "bottom": lambda x: x[1] < near,
        "top": lambda x: x[1] > HEIGHT - near,
        "left": lambda x: (x[0] < 0.0) & (x[1] > near) & (x[1] < HEIGHT - near),
        "right": lambda x: (x[0] > 0.0) & (x[1] > near) & (x[1] < HEIGHT - near),
    }
    return grid(
        np.linspace(-0.5, 0.5, columns + 1),
        y,
        element,
        boundaries,
        mapped=lambda x, y: (x * width_at(y), y),
    )


@dataclass(frozen=True, kw_only=True)
class DogBone(Problem):
    """See the module, and `Problem` for the choices."""

    name: ClassVar[str] = "dog-bone"
    title: ClassVar[str] = "Dog bone in tension"
    drive: ClassVar[str] = "upward displacement of the upper end"
    reaction: ClassVar[str] = "pull at the upper end"
    length: ClassVar[str] = "height"
    meshes: ClassVar[Mapping[str, Callable[[], PlaneMesh]]] = {
        "coarse": partial(bone, 2, 3, 2, 4),
        "medium": partial(bone, 4, 5, 4, 8),
        "fine": partial(bone, 8, 10, 8, 16),
    }

    @property
    def drive_length(self) -> float:
        """See `Problem.drive_length`."""
        return HEIGHT

    def loading(self, mesh: PlaneMesh) -> Loading:
        """See `Problem.loading`."""
        ends = (Prescribed("bottom", x=0.0, y=0.0), Prescribed("top", x=0.0, y=1.0))
        return Loading(ends, self.drive_history(), self.pressures("left", "right"))
