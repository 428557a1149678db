"""The material at all Gauss points of a mesh: one cell, one batched call."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

import numpy as np
import torch

from granbench.cell import Conditions, MaterialCell
from granbench.difference_tangent import with_cheap_tangent
from granbench.errors import AnalysisError, ConfigurationError
from granbench.fem.mesh import Floats
from granbench.stress_control import FLOATING_FAILURES, Answer, surviving
from granbench.tensors import COMPONENT_ORDERS

ORDER = "plane"
COMPONENTS = len(COMPONENT_ORDERS[ORDER])


class MaterialFailure(AnalysisError):
    """A cell gave a stress that is not finite.

    Attributes
    ----------
    point : number of the Gauss point
    position : (x, y), m
    step : of the analysis
    strain : (component,), total strain there after the increment, compression positive
    count : at how many points it happened
    """

    def __init__(
        self, model: str, point: int, position: Floats, step: int, strain: Floats, count: int
    ) -> None:
        self.model, self.point, self.step, self.count = model, point, step, count
        self.position, self.strain = tuple(map(float, position)), tuple(map(float, strain))
        values = ", ".join(f"{value:.4g}" for value in self.strain)
        others = f" and at {count - 1} more points" if count > 1 else ""
        super().__init__(
            f"{model} gives no finite stress at Gauss point {point}, at "
            f"({self.position[0]:.4g}, {self.position[1]:.4g}) m{others}, in step {step}, where "
            f"the strain ({', '.join(COMPONENT_ORDERS[ORDER])}) is ({values}); take smaller steps, "
            "end the loading before, or use another model"
        )


class GaussPoints:
    """A cell's states at the Gauss points of a mesh.

    NumPy vectors on the outside are component-major (3 point,), float64, compression positive;
    they become the cell's (point, component) without a copy unless the cell is in another type.

    Parameters
    ----------
    cell : a model in `plane` components
    stress : (3, point), initial stress, Pa
    scalars : what else is known at the start, by dataset name: a number for all points, or (point,)
    positions : (point, direction), m

    Attributes
    ----------
    strain : (3 point,), total strain of the state that is kept
    stress : (3 point,), Pa, of the state that is kept
    seconds : spent in the cell, wall-clock

    Raises
    ------
    ConfigurationError
        If the cell's components are not those of the plane.
    ModelError
        If the cell cannot start so.
    """

    def __init__(
        self,
        cell: MaterialCell,
        stress: Floats,
        positions: Floats,
        scalars: Mapping[str, float | Floats] | None = None,
    ) -> None:
        if cell.order != ORDER:
            raise ConfigurationError(
                f"{cell.name} has {cell.component_count} {cell.order} components "
                f"({', '.join(COMPONENT_ORDERS[cell.order])}), but plane strain needs "
                f"{', '.join(COMPONENT_ORDERS[ORDER])}; make the model in the plane order"
            )
        self.cell, self.positions = cell, positions
        # Newton's method needs a direction; what it arrives at does not depend on the tangent.
        self._linearised = with_cheap_tangent(cell)
        self.count = len(positions)
        self.seconds = 0.0
        self._like = cell.dtype == torch.float64
        self._type = torch.empty(0, dtype=cell.dtype).numpy().dtype
        self._shape = (self.count, COMPONENTS)
        conditions = Conditions(
            torch.from_numpy(np.ascontiguousarray(stress)).T.to(cell.dtype),
            {
                name: torch.as_tensor(value, dtype=cell.dtype).expand(self.count)
                for name, value in (scalars or {}).items()
            },
        )
        with torch.no_grad():
            state = cell.initial_state(conditions)
        # Component-major: each component is contiguous over the points.
        self.state = state.detach().T.contiguous().T
        self.stress = np.array(stress, dtype=float).ravel()
        self.strain = np.zeros(COMPONENTS * self.count)
        self._trial = self.state, self.stress, self.strain

    def step(self, dstrain: Floats, step: int) -> Floats:
        """Stress (3 point,) after a strain increment (3 point,) from the state that is kept.

        The new state is kept only by `accept`.

        Raises
        ------
        MaterialFailure
            If the stress of some point is not finite; `step` is named in it.
        """
        begin = time.perf_counter()
        stress, state, *_ = self._ask(self.cell.step, dstrain)
        return self._tried(stress, state, dstrain, step, begin)

    def tangent(self, dstrain: Floats, step: int) -> tuple[Floats, Floats]:
        """As `step`, with a tangent (point, 3, 3), Pa, see `granbench.difference_tangent`."""
        begin = time.perf_counter()
        stress, state, tangent = self._ask(self._linearised.tangent, dstrain)
        matrix = tangent.detach().double().numpy()
        return self._tried(stress, state, dstrain, step, begin), matrix

    def accept(self) -> None:
        """Keep the state of the last `step` or `tangent`."""
        self.state, self.stress, self.strain = self._trial

    def internals(self) -> dict[str, Floats]:
        """The cell's internal variables that are kept, (point,) by dataset name."""
        layout = self.cell.layout
        return {
            name: self.state[:, layout[name]].detach().double().numpy()[:, 0]
            for name in self.cell.internals
        }

    def _ask(self, answer: Answer, dstrain: Floats) -> tuple[torch.Tensor, ...]:
        rows = dstrain.reshape(COMPONENTS, -1).T
        increment = torch.from_numpy(rows if self._like else rows.astype(self._type))
        if torch.is_grad_enabled():
            with torch.no_grad():
                return self._answer(answer, increment)
        return self._answer(answer, increment)

    def _answer(self, answer: Answer, increment: torch.Tensor) -> tuple[torch.Tensor, ...]:
        try:
            return answer(increment, self.state)
        except FLOATING_FAILURES:
            return surviving(answer, increment, self.state)

    def _tried(
        self,
        stress: torch.Tensor,
        state: torch.Tensor,
        dstrain: Floats,
        step: int,
        begin: float,
    ) -> Floats:
        # NumPy's calls cost a third of torch's at a few hundred points.
        array = (stress.detach() if stress.requires_grad else stress).numpy()
        if array.shape != self._shape:
            raise ConfigurationError(
                f"{self.cell.name} answers {self.count} strain increments with a stress of shape "
                f"{array.shape}; it must be {self._shape}"
            )
        values = np.ascontiguousarray(array.T, dtype=float).reshape(-1)
        strain = self.strain + dstrain
        self._trial = state, values, strain
        self.seconds += time.perf_counter() - begin
        # The sum of squares is finite only if every entry is, and costs one pass.
        if not math.isfinite(values @ values):
            self._refuse(values, strain, step)
        return values

    def _refuse(self, stress: Floats, strain: Floats, step: int) -> None:
        bad = ~np.isfinite(stress.reshape(COMPONENTS, -1)).all(axis=0)
        if not bad.any():
            return  # finite numbers whose squares overflow
        point = int(bad.argmax())
        raise MaterialFailure(
            self.cell.name,
            point,
            self.positions[point],
            step,
            strain.reshape(COMPONENTS, -1)[:, point],
            int(bad.sum()),
        )
