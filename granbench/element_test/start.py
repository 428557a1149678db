"""The state that an element test starts from."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor

from granbench.cells.check.attributes import require_tensor
from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.user_code import user_code
from granbench.errors import ConfigurationError
from granbench.paths.mixed_control import isotropic_stress
from granbench.units.plausible import LARGEST_OVERCONSOLIDATION, LARGEST_STRESS, VOID_RATIOS

DEFAULT_PRESSURE = 1e5


class UnusedScalarError(ConfigurationError):
    """A scalar is given at the start that the model does not read.

    Attributes
    ----------
    name : of the scalar
    model : name of the model
    """

    def __init__(self, name: str, model: str) -> None:
        self.name, self.model = name, model
        super().__init__(f"{name} is given, but {model} makes no use of it; leave it out")


@dataclass(frozen=True)
class Start:
    """What is known at the start of a test.

    Parameters
    ----------
    pressure : isotropic stress p0, Pa; None for the recorded stress, or else 100 kPa
    scalars : what else is known, under dataset names, such as `initial_void_ratio`
    """

    pressure: float | None = None
    scalars: Mapping[str, float] = field(default_factory=dict)

    def isotropic_pressure(self, undefined_at_zero: str | None = None) -> float:
        """The pressure p0, Pa; 100 kPa where none is given.

        Parameters
        ----------
        undefined_at_zero : the model or test that cannot start without compression, if any

        Raises
        ------
        ConfigurationError
            If a test cannot start from it.
        """
        pressure = DEFAULT_PRESSURE if self.pressure is None else self.pressure
        if not (math.isfinite(pressure) and pressure >= 0.0):
            raise ConfigurationError(
                f"pressure={pressure:g} must be 0 or a finite positive number; give it in Pa, "
                "compression positive"
            )
        if pressure > LARGEST_STRESS:
            raise ConfigurationError(
                f"pressure={pressure:g} is beyond {LARGEST_STRESS / 1e9:g} GPa, which no soil is "
                "under; give it in Pa (1e5 is 100 kPa)"
            )
        if pressure == 0.0 and undefined_at_zero:
            raise ConfigurationError(
                f"pressure=0: {undefined_at_zero} cannot start without compression; give a "
                "pressure above 0, in Pa"
            )
        return pressure

    def state(self, cell: MaterialCell, recorded: Conditions | None = None) -> Tensor:
        """State (point, n_state) of a cell: of one point, or of all that were recorded.

        Raises
        ------
        ConfigurationError
            If the pressure or a scalar is out of range.
        UnusedScalarError
            If the model does not read a scalar that is given.
        MissingScalarError
            If the model needs a scalar that is not given.
        ModelError
            If it cannot start in this state.
        """
        for name, value in self.scalars.items():
            _check_scalar(name, value)
        known = dict(recorded.scalars) if recorded else {}
        if recorded is None or self.pressure is not None:
            pressure = self.isotropic_pressure(cell.name if cell.pressure_dependent else None)
            points = len(recorded.stress) if recorded else 1
            stress = torch.from_numpy(isotropic_stress(pressure, cell.order)).repeat(points, 1)
            known["initial_mean_stress"] = torch.full((points,), pressure, dtype=torch.float64)
        else:
            stress = recorded.stress
        if "overconsolidation_ratio" in self.scalars:
            # It sets the density, in place of the one that was recorded.
            known.pop("initial_void_ratio", None)
        for name, value in self.scalars.items():
            known[name] = torch.full((len(stress),), value, dtype=torch.float64)
        scalars = _ReadScalars(known)
        with torch.no_grad(), user_code(f"{cell.name} failed to make its first state"):
            state = cell.initial_state(Conditions(stress, scalars))
        require_tensor(cell, "initial_state", "a state", state, (len(stress), cell.layout.size))
        for name in self.scalars:
            if name not in scalars.read:
                raise UnusedScalarError(name, cell.name)
        return state


def _check_scalar(name: str, value: float) -> None:
    """Refuse a value that no model can start from."""
    shown = f"{name}={value:g}"
    if not math.isfinite(value):
        raise ConfigurationError(f"{shown} must be a finite number")
    least, greatest = VOID_RATIOS
    if name == "initial_void_ratio" and not least <= value <= greatest:
        raise ConfigurationError(
            f"{shown} must lie between {least:g} and {greatest:g}; give the volume of the voids "
            "over that of the grains (0.8, not 80 %)"
        )
    if name == "overconsolidation_ratio" and value > LARGEST_OVERCONSOLIDATION:
        raise ConfigurationError(
            f"{shown} is beyond {LARGEST_OVERCONSOLIDATION:g}, which no soil has been under; give "
            "the largest pressure so far over the present one"
        )
    if name == "overconsolidation_ratio" and value < 1.0:
        raise ConfigurationError(
            f"{shown} must be at least 1; give 1 for a normally consolidated soil, or more"
        )


class _ReadScalars(Mapping[str, Tensor]):
    """Scalars that note the names of those that are read."""

    def __init__(self, scalars: Mapping[str, Tensor]) -> None:
        self._scalars = scalars
        self.read: set[str] = set()

    def __getitem__(self, name: str) -> Tensor:
        self.read.add(name)
        return self._scalars[name]

    def __contains__(self, name: object) -> bool:
        return name in self._scalars

    def __iter__(self) -> Iterator[str]:
        return iter(self._scalars)

    def __len__(self) -> int:
        return len(self._scalars)
