"""The material at all Gauss points of a mesh: one cell, one batched call."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from granbench.cells.contract import FLOATING_FAILURES, Conditions, MaterialCell
from granbench.cells.difference_tangent import with_cheap_tangent
from granbench.cells.robust_runs import CellMethod, robust_call
from granbench.cells.user_code import user_code
from granbench.errors import (
    AnalysisError,
    ConfigurationError,
    ModelError,
)
from granbench.fem.cell_failure import CellFailure, misanswered, raised
from granbench.fem.mesh import Floats
from granbench.fem.operators import ORDER
from granbench.tensors import COMPONENT_ORDERS

COMPONENTS = len(COMPONENT_ORDERS[ORDER])


FLOATS = (torch.float64, torch.float32, torch.float16)
"""Types that a stress may have; NumPy knows them too."""

UNSTRESSED = 1e5
"""Pa; reference of an imbalance at the start if no stress is imposed: the thesis' confinement."""


class MaterialFailure(AnalysisError):
    """A cell gave a stress that is not finite.

    Attributes
    ----------
    point : number of the Gauss point
    position : (x, y), m
    step : of the analysis; 0 at the start
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
        circumstances = (
            f"in step {step}, where the strain ({', '.join(COMPONENT_ORDERS[ORDER])}) is "
            f"({values}); take smaller steps, end the loading earlier, or use another model"
            if step > 0
            else "at zero strain; choose another start or another model"
        )
        super().__init__(
            f"{model} gives no finite stress at Gauss point {point}, at "
            f"({self.position[0]:.4g}, {self.position[1]:.4g}) m{others}, {circumstances}"
        )


class GaussPoints:
    """A cell's states at the Gauss points of a mesh.

    NumPy vectors on the outside are component-major (3 point,), float64, compression positive;
    they become the cell's (point, component) without a copy unless the cell is in another type.

    Parameters
    ----------
    cell : a model in `plane` components
    stress : (3, point), initial stress, Pa
    scalars : other quantities at the start, by dataset name: a number for all points, or (point,)
    positions : (point, direction), m

    Attributes
    ----------
    strain : (3 point,), total strain of the accepted state
    stress : (3 point,), Pa, of the accepted state
    seconds : spent in the cell, wall-clock
    initial_imbalance : see `measure_initial_imbalance`; 0 before

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
                f"{', '.join(COMPONENT_ORDERS[ORDER])}; make the model with order={ORDER!r}"
            )
        self.cell, self.positions = cell, positions
        self._linearised: MaterialCell | None = None
        self.count = len(positions)
        self.seconds = self.initial_imbalance = 0.0
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
        with torch.no_grad(), user_code(f"{cell.name} failed in initial_state"):
            state = cell.initial_state(conditions)
        if not isinstance(state, Tensor):
            raise ModelError(
                f"{cell.name}: initial_state returned a {type(state).__name__}; it must return "
                "a tensor"
            )
        # Component-major: each component is contiguous over the points.
        self.state = state.detach().T.contiguous().T
        self.stress = np.array(stress, dtype=float).ravel()
        self.strain = np.zeros(COMPONENTS * self.count)
        self._trial = self.state, self.stress, self.strain

    def step(self, dstrain: Floats, step: int) -> Floats:
        """Stress (3 point,) after a strain increment (3 point,) from the accepted state.

        `accept` accepts the new state.

        Raises
        ------
        MaterialFailure
            If the stress of some point is not finite; `step` is named in it.
        CellFailure
            If the cell raises, or does not return a stress of the shape of the strain and a state.
        """
        begin = time.perf_counter()
        stress, state, *_ = self._ask(self.cell.step, dstrain, step)
        return self._tried(stress, state, dstrain, step, begin)

    def tangent(self, dstrain: Floats, step: int) -> tuple[Floats, Floats]:
        """The same as `step`, with a tangent (point, 3, 3), Pa."""
        begin = time.perf_counter()
        if self._linearised is None:
            # Newton's method needs a direction; what it arrives at does not depend on the tangent.
            self._linearised = with_cheap_tangent(self.cell)
        try:
            stress, state, tangent = self._ask(self._linearised.tangent, dstrain, step, 3)
        except CellFailure:
            self.step(dstrain, step)  # the error of the step itself is clearer
            raise
        values = self._tried(stress, state, dstrain, step, begin)
        return values, tangent.detach().double().numpy()

    def measure_initial_imbalance(self) -> None:
        """Measure the imbalance at the start: the stress change at zero strain.

        It is the largest change of a component at any point over the largest stress imposed
        anywhere, or over `UNSTRESSED` where none is; infinite where the cell then has no stress.
        The accepted state does not change.
        """
        before = self._trial
        try:
            change = self.step(np.zeros_like(self.strain), 0) - self.stress
        except MaterialFailure:
            self.initial_imbalance = math.inf
        else:
            imposed = float(np.abs(self.stress).max()) or UNSTRESSED
            self.initial_imbalance = float(np.abs(change).max()) / imposed
        self._trial = before

    def accept(self) -> None:
        """Accept the state of the last `step` or `tangent`."""
        self.state, self.stress, self.strain = self._trial

    def internals(self) -> dict[str, Floats]:
        """The cell's internal variables in the accepted state, (point,) by dataset name."""
        layout = self.cell.layout
        return {
            name: self.state[:, layout[name]].detach().double().numpy()[:, 0]
            for name in self.cell.internals
        }

    def _ask(
        self, answer: CellMethod, dstrain: Floats, step: int, parts: int = 2
    ) -> tuple[Tensor, ...]:
        rows = dstrain.reshape(COMPONENTS, -1).T
        increment = torch.from_numpy(rows if self._like else rows.astype(self._type))
        try:
            if torch.is_grad_enabled():
                with torch.no_grad():
                    found = self._answer(answer, increment)
            else:
                found = self._answer(answer, increment)
        except (AnalysisError, KeyboardInterrupt):
            raise
        except BaseException as error:  # user code: an analysis keeps what it computed before
            raise raised(self.cell.name, error, step) from error
        whole = isinstance(found, tuple) and len(found) >= parts
        if not (whole and isinstance(found[0], Tensor) and isinstance(found[1], Tensor)):
            raise misanswered(self.cell.name, found, step)
        return found

    def _answer(self, answer: CellMethod, increment: Tensor) -> tuple[Tensor, ...]:
        try:
            return answer(increment, self.state)
        except FLOATING_FAILURES:
            return robust_call(answer, increment, self.state)

    def _tried(
        self,
        stress: Tensor,
        state: Tensor,
        dstrain: Floats,
        step: int,
        begin: float,
    ) -> Floats:
        for what, part in (("stress", stress), ("state", state)):
            if part.dtype not in FLOATS or not part.is_cpu or part.layout != torch.strided:
                raise CellFailure(
                    f"{self.cell.name} returned a {what} of type {part.dtype}; it must be a dense "
                    f"tensor of type {self.cell.dtype} on the CPU",
                    step,
                )
        # NumPy's calls cost a third of torch's at a few hundred points.
        array = (stress.detach() if stress.requires_grad else stress).numpy()
        if array.shape != self._shape:
            raise CellFailure(
                f"{self.cell.name} returned a stress of shape {array.shape} for {self.count} "
                f"strain increments; it must be {self._shape}",
                step,
            )
        if state.shape != self.state.shape:
            raise CellFailure(
                f"{self.cell.name} returned a state of shape {tuple(state.shape)}; it must keep "
                f"the shape {tuple(self.state.shape)}",
                step,
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
