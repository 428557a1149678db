"""What the classical models share: named parameters, parameter sets, one update per model.

A model states its parameters and its `update`; state, plane strain and the contract of the
material cell follow from them here.
"""

import abc
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Self, cast

import numpy as np
import torch
from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell, StateLayout
from granbench.errors import ModelError, alternatives
from granbench.models.arrays import Array, in_numpy, in_torch
from granbench.models.components import TensorRows, tensor_rows
from granbench.models.parameters import Constants, Parameter
from granbench.models.substepping import Substepping
from granbench.tensors import COMPONENT_ORDERS, mean_stress

OUT_OF_PLANE = "out_of_plane_stress"

BLOCK = 16384
"""Points that are updated at a time: the temporaries of an update then stay in the cache."""


FEW_POINTS = 4096
"""Points up to which an update without gradients is one of NumPy's arrays: see
`granbench.models.arrays`."""


class _Fixed(NamedTuple):
    """Constants that were made once, of unconstrained numbers `free`, for both kinds of arrays."""

    free: list[float]
    in_torch: Constants
    in_numpy: Constants


class ClassicalCell(MaterialCell, torch.nn.Module):
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
    title : for people
    dimension : of space in which the model is defined, 2 or 3
    parameter_table : its parameters
    parameter_sets : published values, the default first
    holds_without_stress : whether such a model may start at zero mean stress, its apex
    internal_tensors : tensors beside the stress, such as `plastic_strain`; their components are
        internal variables `plastic_strain_xx` and so on, in the order of `rows`
    internal_variables : scalars beside the stress, after the tensors, under their dataset names
    substepping : how finely increments are cut; None where they are not
    numpy_updates : whether `update` is written in `granbench.models.arrays`, so that it also takes
        NumPy's arrays; one in torch alone is as good, but slower where points are few. A cell may
        be told otherwise: torch's last bits and NumPy's differ, and forward-mode differentiation
        under `no_grad` sees nothing of it

    Raises
    ------
    ModelError
        If a set, a parameter or an order is unknown, or a value is out of range.
    """

    title: ClassVar[str]
    dimension: ClassVar[int] = 3
    parameter_table: ClassVar[tuple[Parameter, ...]]
    parameter_sets: ClassVar[Mapping[str, Mapping[str, float]]]
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
        super().__init__()
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
        self.reference = {**self._published(parameter_set), **self._known(values or {})}
        self.free = torch.nn.ParameterDict()
        for parameter in self.parameter_table:
            parameter.check(self.reference[parameter.name], self.name)
            self.free[parameter.name] = torch.nn.Parameter(torch.zeros((), dtype=dtype))
        self._last_fixed: _Fixed | None = None

    @classmethod
    def _published(cls, parameter_set: str | None) -> Mapping[str, float]:
        if parameter_set is None:
            return next(iter(cls.parameter_sets.values()))
        if parameter_set not in cls.parameter_sets:
            raise ModelError(
                f"{cls.name} has no parameter set {parameter_set!r}; "
                f"{alternatives(parameter_set, cls.parameter_sets)}"
            )
        return cls.parameter_sets[parameter_set]

    @classmethod
    def _known(cls, values: Mapping[str, float]) -> Mapping[str, float]:
        names = [parameter.name for parameter in cls.parameter_table]
        for name in values:
            if name not in names:
                raise ModelError(
                    f"{cls.name} has no parameter {name!r}: {alternatives(name, names)}"
                )
        return values

    def constants(self) -> Constants:
        """The parameters' values and what is `derived` from them, by name, differentiable.

        Tensors () or (point,).
        """
        fixed = self._fixed()
        return fixed.in_torch if fixed else self._constrained(self._free_values())

    def _fixed(self) -> "_Fixed | None":
        """Constants that all points share and no gradient is wanted of; None if there are none."""
        free = self._free_values()
        wanted = torch.is_grad_enabled() and any(value.requires_grad for value in free)
        if wanted or any(value.ndim for value in free) or torch.compiler.is_compiling():
            return None
        # A run asks for the same numbers at every step.
        numbers = [value.item() for value in free]
        if self._last_fixed is None or self._last_fixed.free != numbers:
            with torch.inference_mode(False):  # a later call may want gradients of the stress
                constants = self._constrained([value.detach() for value in free])
            self._last_fixed = _Fixed(numbers, constants, constants.in_numpy())
        return self._last_fixed

    def _free_values(self) -> list[Tensor]:
        # `self.free.values()` takes ten times as long.
        return list(cast(dict[str, Tensor], self.free._parameters).values())

    def _constrained(self, free: Sequence[Tensor]) -> Constants:
        constants = Constants()
        for parameter, value in zip(self.parameter_table, free, strict=True):
            number = parameter.constrained(value, self.reference[parameter.name])
            setattr(constants, parameter.name, number)
        vars(constants).update(self.derived(constants))
        return constants

    def derived(self, c: Constants) -> Mapping[str, Tensor]:
        """Constants that follow from the parameters `c`, such as moduli; none by default."""
        return {}

    @torch.no_grad()
    def values(self) -> dict[str, float]:
        """The parameters as numbers, by name; a model with parameters per point has none.

        Raises
        ------
        ModelError
            If the parameters differ from point to point.
        """
        if self._differs_between_points():
            raise ModelError(f"the parameters of {self.name} differ from point to point")
        constants = vars(self.constants())
        return {
            parameter.name: float(constants[parameter.name]) for parameter in self.parameter_table
        }

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

    def _differs_between_points(self) -> bool:
        return any(value.ndim > 0 for value in self._free_values())

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
