"""Biaxial compression of a specimen 0.5 m wide and 1 m high (thesis, Sec 4.3.1, 5.3.1, 6.4).

             top platen moves down
           +----------------------+        rough ends: the platens hold the soil in x and y
           |                      |        smooth ends: in y alone; one node of the base is held
        -> |                      | <-     in x
       p_c |                      | p_c
        -> |                      | <-     lateral pressure p_c on both sides
           |                      |
           +----------------------+
             bottom platen at rest

The reaction is the force of the top platen, per metre of thickness.
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
from granbench.fem.structured import rectangle

WIDTH, HEIGHT = 0.5, 1.0


@dataclass(frozen=True, kw_only=True)
class Biaxial(Problem):
    """See the module, and `Problem` for the other choices.

    Parameters
    ----------
    ends : rough or smooth
    """

    name: ClassVar[str] = "biaxial"
    title: ClassVar[str] = "Biaxial compression"
    drive: ClassVar[str] = "displacement of the top platen"
    reaction: ClassVar[str] = "force of the top platen"
    length: ClassVar[str] = "height"
    meshes: ClassVar[Mapping[str, Callable[[], PlaneMesh]]] = {
        "coarse": partial(rectangle, WIDTH, HEIGHT, 2, 4),
        "medium": partial(rectangle, WIDTH, HEIGHT, 4, 8),
        "fine": partial(rectangle, WIDTH, HEIGHT, 8, 16),
        "table-5.2": partial(rectangle, WIDTH, HEIGHT, 11, 11),  # the table's 484 Gauss points
    }
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = {"ends": ("rough", "smooth")}

    ends: str = field(default="rough", metadata={"meaning": "platens: rough or smooth"})

    @property
    def drive_length(self) -> float:
        """See `Problem.drive_length`."""
        return HEIGHT

    def loading(self, mesh: PlaneMesh) -> Loading:
        """See `Problem.loading`."""
        held = 0.0 if self.ends == "rough" else None
        platens = [Prescribed("bottom", x=held, y=0.0), Prescribed("top", x=held, y=-1.0)]
        if self.ends == "smooth":
            base = mesh.nodes[mesh.nodes_on("bottom")]
            x, y = base[np.abs(base[:, 0] - 0.5 * WIDTH).argmin()]
            platens.append(Prescribed((float(x), float(y)), x=0.0))
        return Loading(tuple(platens), self.drive_history(), self.pressures("left", "right"))
