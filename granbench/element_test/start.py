"""The model that a user names for an element test, and the state that it starts from."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import Tensor

from granbench.cells.baseline import baseline_names
from granbench.cells.check.attributes import require_tensor
from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.find import find_cells, unknown_model
from granbench.cells.user_code import user_code
from granbench.data.verification import task_file
from granbench.errors import ConfigurationError, ModelError
from granbench.models import MODELS, ClassicalCell, find_model
from granbench.models.parameter_file import cell_from_file, read_parameters
from granbench.paths.mixed_control import isotropic_stress
from granbench.records import open_records
from granbench.units.plausible import LARGEST_OVERCONSOLIDATION, LARGEST_STRESS, VOID_RATIOS

DEFAULT_PRESSURE = 1e5
DEFAULT_TASK = "dem-triaxial-mini"
"""It comes with the package, so that a model that needs no records is driven anywhere."""

OPTIONS = {"initial_void_ratio": "--e0", "overconsolidation_ratio": "--ocr"}
"""Options that give a scalar; any other one is given by `--start`."""


@dataclass(frozen=True)
class ModelChoice:
    """The model that is asked for.

    Parameters
    ----------
    name : of a classical model or baseline, parameter file (.json) of a classical one, folder of
        a trained model, or package.module:factory
    parameter_set, parameter_file : of a classical model that is named, one of them or none
    task : dataset that a baseline without training is fitted to

    Raises
    ------
    ModelError
        If there is no such model.
    ConfigurationError
        If parameters are given twice, or to a model that takes none.
    """

    name: str
    parameter_set: str | None = None
    parameter_file: Path | None = None
    task: str = DEFAULT_TASK

    def __post_init__(self) -> None:
        known = [*MODELS, *baseline_names()]
        if not (":" in self.name or Path(self.name).exists() or self.name in known):
            raise ModelError(unknown_model(self.name))
        given = {"--set": self.parameter_set, "--params": self.parameter_file}
        options = [option for option, value in given.items() if value is not None]
        if len(options) > 1:
            raise ConfigurationError("--set and --params both give parameters; leave one out")
        if options and self.name not in MODELS:
            raise ConfigurationError(
                f"{options[0]} gives the parameters of a classical model ({', '.join(MODELS)}), "
                f"which {self.name!r} does not name; leave it out"
            )

    def classical(self) -> type[ClassicalCell] | None:
        """The classical model, which is made in any component order; None for any other kind.

        Raises
        ------
        ModelError
            If a parameter file is damaged.
        """
        if self.name in MODELS:
            return MODELS[self.name]
        if self._is_file():
            return find_model(read_parameters(Path(self.name)).model)
        return None

    def cell(self, order: str) -> MaterialCell:
        """The model's cell; only a classical one heeds the component order.

        Raises
        ------
        ModelError
            If its parameters or files are unknown or damaged.
        """
        if self._is_file():
            return cell_from_file(Path(self.name), order)
        if self.parameter_file is not None:
            cell = cell_from_file(self.parameter_file, order)
            if cell.name != self.name:
                raise ModelError(
                    f"{self.parameter_file}: holds parameters of {cell.name!r}, not of "
                    f"{self.name!r}; name the model that they belong to"
                )
            return cell
        if self.name in MODELS:
            return MODELS[self.name](parameter_set=self.parameter_set, order=order)
        with open_records(task_file(self.task)) as records:
            return find_cells(self.name, records, seeds=(0,)).cell

    def _is_file(self) -> bool:
        return Path(self.name).suffix == ".json" and Path(self.name).is_file()


@dataclass(frozen=True)
class Start:
    """The state that is asked for at the start of a test.

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
        undefined_at_zero : who cannot start without compression, if anyone

        Raises
        ------
        ConfigurationError
            If it is no pressure to start from.
        """
        pressure = DEFAULT_PRESSURE if self.pressure is None else self.pressure
        if not (math.isfinite(pressure) and pressure >= 0.0):
            raise ConfigurationError(
                f"--p0 {pressure:g} is no pressure to start from; give it in Pa, compression "
                "positive"
            )
        if pressure > LARGEST_STRESS:
            raise ConfigurationError(
                f"--p0 {pressure:g} is beyond {LARGEST_STRESS / 1e9:g} GPa, which no soil is "
                "under; give it in Pa (1e5 is 100 kPa)"
            )
        if pressure == 0.0 and undefined_at_zero:
            raise ConfigurationError(
                f"--p0 0: {undefined_at_zero} does not start without compression; give p0 above "
                "0, in Pa"
            )
        return pressure

    def state(self, cell: MaterialCell, recorded: Conditions | None = None) -> Tensor:
        """State (point, n_state) of a cell: of one point, or of all that were recorded.

        Raises
        ------
        ConfigurationError
            If the pressure is none, or a scalar is no number or of no use to the model.
        ModelError
            If the model needs what is not given, or cannot start so.
        """
        for name, value in self.scalars.items():
            _check_scalar(name, value)
        known = dict(recorded.scalars) if recorded else {}
        if recorded is None or self.pressure is not None:
            dependent = cell.pressure_dependent
            pressure = self.isotropic_pressure(cell.name if dependent else None)
            points = len(recorded.stress) if recorded else 1
            stress = torch.from_numpy(isotropic_stress(pressure, cell.order)).repeat(points, 1)
            known["initial_mean_stress"] = torch.full((points,), pressure, dtype=torch.float64)
        else:
            stress = recorded.stress
        if "overconsolidation_ratio" in self.scalars:
            # The density that was recorded gives way to the one that is asked for.
            known.pop("initial_void_ratio", None)
        for name, value in self.scalars.items():
            known[name] = torch.full((len(stress),), value, dtype=torch.float64)
        given = _Given(stress, _ReadScalars(known))
        try:
            with torch.no_grad(), user_code(f"{cell.name} failed to make its first state"):
                state = cell.initial_state(given)
            require_tensor(cell, "initial_state", "a state", state, (len(stress), cell.layout.size))
        except ModelError as error:
            raise ModelError(f"{self._shown()}{error}") from error
        for name in self.scalars:
            if name not in given.scalars.read:
                raise ConfigurationError(
                    f"{_option(name).rstrip(' =')} is given, but {cell.name} makes no use of it; "
                    "leave it out"
                )
        return state

    def _shown(self) -> str:
        """The options that set the start, to lead a model's objection; empty if none does."""
        options = [f"--p0 {self.pressure:g}"] if self.pressure is not None else []
        options += [f"{_option(name)}{value:g}" for name, value in self.scalars.items()]
        return f"{', '.join(options)}: " if options else ""


def _check_scalar(name: str, value: float) -> None:
    """Refuse what no model can start from, whatever it makes of the scalar."""
    shown = f"{_option(name)}{value:g}"
    if not math.isfinite(value):
        raise ConfigurationError(f"{shown} is not a finite number")
    least, greatest = VOID_RATIOS
    if name == "initial_void_ratio" and not least <= value <= greatest:
        raise ConfigurationError(
            f"{shown} is no void ratio of a soil; give the volume of the voids over that of the "
            f"grains, from {least:g} to {greatest:g} (0.8, not 80 %)"
        )
    if name == "overconsolidation_ratio" and value > LARGEST_OVERCONSOLIDATION:
        raise ConfigurationError(
            f"{shown} is beyond {LARGEST_OVERCONSOLIDATION:g}, which no soil has been under; give "
            "the largest pressure so far over the present one"
        )
    if name == "overconsolidation_ratio" and value < 1.0:
        raise ConfigurationError(
            f"{shown} is below 1: no soil is under more than it has ever been under; give 1 for a "
            "normally consolidated soil, or more"
        )


def _option(name: str) -> str:
    """An option, up to where its value begins."""
    return f"{OPTIONS[name]} " if name in OPTIONS else f"--start {name}="


class _ReadScalars(Mapping[str, Tensor]):
    """Scalars with the names of those that were read."""

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


@dataclass(frozen=True)
class _Given(Conditions):
    """Conditions from options: what is missing among them is said in terms of options."""

    scalars: _ReadScalars = field(default_factory=lambda: _ReadScalars({}))

    def require(self, name: str) -> Tensor:
        """See `Conditions.require`."""
        if name not in self.scalars:
            raise ModelError(
                f"the model needs {name!r} at the start of a path; give it with "
                f"{_option(name)}{'X' if name in OPTIONS else 'VALUE'}"
            )
        return self.scalars[name]
