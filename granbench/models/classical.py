"""A classical model as a material cell: it states its parameters and its `update`.

State, plane strain and the contract of the material cell follow from them here; parameters are in
`granbench.models.parametrised`.
"""

import abc
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell, StateLayout
from granbench.errors import ModelError
from granbench.models.arrays import Array, in_numpy, in_torch
from granbench.models.components import TensorRows, tensor_rows
from granbench.models.parameters import Constants
from granbench.models.parametrised import ParametrisedModule
from granbench.models.substepping import Substepping
from granbench.tensors import COMPONENT_ORDERS, mean_stress

OUT_OF_PLANE = "out_of_plane_stress"

BLOCK = 16384
"""Points that are updated at a time: the temporaries of an update then stay in the cache."""


FEW_POINTS = 4096
"""Points up to which an update without gradients is one of NumPy's arrays: see
`granbench.models.arrays`."""


class ClassicalCell(MaterialCell, ParametrisedModule):
    """A constitutive model in closed form, batched over points and differentiable.

    Gradients flow to strain, state and parameters. A point that the model cannot follow (it
    ran out of substeps, or its stress left the model's domain) gets a NaN stress and leaves
    the others alone.

    Parameters
    ----------
    values : parameters that replace those of the set, by name
    parameter_set : a key of `parameter_sets`; the first of them by default
    order : component order. A 3-D model in the `plane` order is in plane strain and carries
        the stress zz as the internal variable `out_of_plane_stress`.
    dtype : floating type; float64 wherever data are made

    Attributes
    ----------
    title : full name, in figures and tables
    dimension : of space in which the model is defined, 2 or 3
    parameter_table, parameter_sets : see `ParametrisedModule`
    holds_without_stress : whether such a model may start at zero mean stress, its apex
    internal_tensors : tensors beside the stress, such as `plastic_strain`; their components are
        internal variables `plastic_strain_xx` and so on, in the order of `rows`
    internal_variables : scalars beside the stress, after the tensors, under their dataset names
    substepping : how finely increments are cut; None where they are not
    numpy_updates : whether `update` is written in `granbench.models.arrays`, so that it also takes
        NumPy's arrays; one in torch alone is as good, but slower where points are few. Set it to
        False on a cell where torch's last bits are wanted, or forward-mode differentiation under
        `no_grad`, which cannot follow NumPy

    Raises
    ------
    ModelError
        If a set, a parameter or an order is unknown, or a value is out of range.
    """

    title: ClassVar[str]
    dimension: ClassVar[int] = 3
    holds_without_stress: ClassVar[bool] = False
    internal_tensors: ClassVar[tuple[str, ...]] = ()
    internal_variables: ClassVar[tuple[str, ...]] = ()
    substepping: Substepping | None = None
    numpy_updates: bool = False

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        # Without a closed form it is automatic differentiation through every substep.
        cls.cheap_tangent = cls.update_and_tangent is not ClassicalCell.update_and_tangent

    def __init__(
        self,
        values: Mapping[str, float] | None = None,
        *,
        parameter_set: str | None = None,
        order: str = "plane",
        dtype: torch.dtype = torch.float64,
    ) -> None:
        super().__init__(values, parameter_set, dtype)
        self.order = order
        self.dtype = dtype
        self.rows: TensorRows = tensor_rows(order, self.dimension, dtype)
        extra = (OUT_OF_PLANE,) if self.rows.count > len(COMPONENT_ORDERS[order]) else ()
        tensors = [
            f"{name}_{label}" for name in self.internal_tensors for label in self.rows.labels
        ]
        self.internals = (*extra, *tensors, *self.internal_variables)
        self.layout = StateLayout.of(
            stress=len(COMPONENT_ORDERS[order]), **dict.fromkeys(self.internals, 1)
        )

    def copy_with(self, values: Mapping[str, float]) -> Self:
        """The same model with other values of some parameters.

        Raises
        ------
        ModelError
            As the class.
        """
        return type(self)({**self.values(), **values}, order=self.order, dtype=self.dtype)

    def parameters_count(self) -> int:
        """Number of material parameters."""
        return len(self.parameter_table)

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`.

        The stress zz in plane strain is the conditions' scalar `out_of_plane_stress`, or, where
        they have none, the mean of xx and yy: exact after isotropic consolidation.

        Raises
        ------
        ModelError
            If the model is not defined for the given stress or scalars; a pressure-dependent one
            needs compression.
        """
        stress = conditions.stress.to(self.dtype).T
        if OUT_OF_PLANE in self.layout:
            known = conditions.scalars.get(OUT_OF_PLANE)
            zz = mean_stress(stress.T, self.order) if known is None else known.to(self.dtype)
            stress = torch.cat([stress, zz.unsqueeze(0)])
        if self.pressure_dependent:
            self._refuse_tension(self.rows.mean(stress))
        return torch.cat([stress, *self.initial_internals(stress, conditions)]).T

    def _refuse_tension(self, mean_stress: Tensor) -> None:
        bad = ~(mean_stress > 0.0) & ~((mean_stress == 0.0) & self.holds_without_stress)
        if bad.any():
            point = int(bad.nonzero()[0])
            raise ModelError(
                f"{self.name}: point {point} starts at a mean stress of "
                f"{float(mean_stress[point]):g} Pa, but the model holds under compression only; "
                "start from p0 above zero, compression positive"
            )

    def initial_internals(self, stress: Tensor, conditions: Conditions) -> Sequence[Tensor]:
        """State beside the stress where a path begins, tensors first, then `internal_variables`.

        Parameters
        ----------
        stress : (component, point), Pa, with zz last in plane strain
        conditions : where a scalar has the name of an internal variable, that is its value

        Returns
        -------
        One (1, point) for each internal variable; by default the scalar, or zero
        """
        known = conditions.scalars
        return [
            known[name].to(self.dtype).unsqueeze(0)
            if name in known
            else torch.zeros_like(stress[:1])
            for name in self.internals
            if name != OUT_OF_PLANE
        ]

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        fixed, points = self._fixed(), state.shape[0]
        if fixed is None or torch.is_grad_enabled():
            after = self.update(self._strain_rows(dstrain), state.T.contiguous(), self.constants())
        elif self.numpy_updates and points <= FEW_POINTS and state.is_cpu:
            return self._step_in_numpy(dstrain, state, fixed.in_numpy)
        elif points < 2 * BLOCK:
            after = self.update(self._strain_rows(dstrain), state.T.contiguous(), fixed.in_torch)
        else:
            after = state.new_empty(self.layout.size, points)
            for start in range(0, points, BLOCK):
                block = slice(start, start + BLOCK)
                strain = self._strain_rows(dstrain[block])
                after[:, block] = self.update(strain, state[block].T, fixed.in_torch)
        return self._stress_of(after).T, after.T

    def _step_in_numpy(self, dstrain: Tensor, state: Tensor, c: Constants) -> tuple[Tensor, Tensor]:
        count = self.component_count
        if dstrain.shape != (state.shape[0], count):  # which NumPy would spread over the state
            raise ModelError(
                f"{self.name}: a strain increment of shape {tuple(dstrain.shape)} for "
                f"{state.shape[0]} points; give {(state.shape[0], count)}"
            )
        before: Any = np.ascontiguousarray(in_numpy(state).T)
        strain: Any = np.zeros((self.rows.count, before.shape[1]), before.dtype)
        strain[:count] = in_numpy(dstrain).T  # in plane strain zz is zero
        # A point that cannot be followed ends as NaN without a warning, as in torch.
        with np.errstate(all="ignore"):
            after = self.update(strain, before, c)
        return in_torch(after[:count].T), in_torch(after.T)

    def tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """See `MaterialCell.tangent`; in closed form where the model has one."""
        with torch.no_grad():
            closed = self.update_and_tangent(self._strain_rows(dstrain), state.T.contiguous())
        if closed is None:
            return super().tangent(dstrain, state)
        after, tangent = closed
        count = self.component_count
        return self._stress_of(after).T, after.T, tangent[:count, :count].permute(2, 0, 1)

    def _stress_of(self, rows: Tensor) -> Tensor:
        # The gradient of a slice writes zeros for what it leaves out: none of everything.
        return rows[: self.component_count] if self.internals else rows

    def _strain_rows(self, dstrain: Tensor) -> Tensor:
        rows = dstrain.to(self.dtype).T
        if OUT_OF_PLANE in self.layout:
            return torch.nn.functional.pad(rows, (0, 0, 0, 1))  # plane strain: zz is zero
        return rows.contiguous()

    def forward(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """`step`, for those who call a torch module."""
        return self.step(dstrain, state)

    @abc.abstractmethod
    def update(self, dstrain: Array, state: Array, c: Constants) -> Array:
        """State after a strain increment; the model itself.

        Parameters
        ----------
        dstrain : (component, point), rows as in `rows`, compression positive
        state : (n_state, point): the stress rows, Pa, then the internal variables
        c : the model's `constants`, in the kind of arrays that the others are

        Returns
        -------
        (n_state, point)
        """

    def update_and_tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor] | None:
        """State and consistent tangent after a strain increment; None without a closed form.

        Parameters
        ----------
        dstrain, state : as in `update`

        Returns
        -------
        state : (n_state, point)
        tangent : (component, component, point), d stress row / d strain row, Pa
        """
        return None
