"""Element tests shown on the pages of the models, and their closed-form solutions.

Each function of the other modules in this folder runs the tests of one model. The closed forms are
written from the equations, without using the code of the model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
import xarray as xr

from granbench import __version__
from granbench.cells import Conditions
from granbench.element_test.response_files import response_records
from granbench.element_test.run import run_test
from granbench.errors import ModelError
from granbench.models import ClassicalCell
from granbench.paths.mixed_control import MixedControl, isotropic_stress
from granbench.paths.programme import Floats
from granbench.paths.standard_tests import find_test
from granbench.plotting.model import Panel

KILO = 1e3
PRESSURES = (5e4, 1e5, 2e5)
BY_PRESSURE = tuple(f"$p_0$ = {p / KILO:g} kPa" for p in PRESSURES)
EXACT = 1e-6
"""Tolerance if the closed form has the same assumptions as the model: only the tolerance of held
stresses and rounding remain."""


@dataclass(frozen=True)
class Specimen:
    """One curve of a figure.

    Parameters
    ----------
    label : label in the legend
    history : (step,), driving strain, starting from zero
    pressure : isotropic stress at the start, Pa
    scalars : other quantities at the start, such as `initial_void_ratio`
    """

    label: str
    history: Floats
    pressure: float = 1e5
    scalars: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Comparison:
    """A number of a drawn curve and its closed form.

    Parameters
    ----------
    what : the test and the number
    formula : closed form, as mathematics for the page
    model, closed_form : values in the unit
    unit : kPa, % or 1
    tolerance : relative difference that the closed form's assumptions leave
    """

    what: str
    formula: str
    model: float
    closed_form: float
    unit: str
    tolerance: float

    @property
    def difference(self) -> float:
        """Difference relative to the closed form, or absolute if that is zero."""
        return abs(self.model - self.closed_form) / (abs(self.closed_form) or 1.0)


@dataclass(frozen=True)
class Evidence:
    """Figure and comparisons on the page of a model.

    Parameters
    ----------
    panels : panels of the figure
    comparisons : comparisons of the curves with closed forms
    """

    panels: tuple[Panel, ...]
    comparisons: tuple[Comparison, ...]


def monotonic(strain: float, steps: int) -> Floats:
    """Driving strain (step,) up to `strain` in growing steps, so that the start is shown well."""
    return strain * np.linspace(0.0, 1.0, steps + 1) ** 2


def standard_test(
    cell: ClassicalCell,
    control: str,
    specimens: Sequence[Specimen],
    tolerance: float | None = None,
) -> xr.Dataset:
    """A standard test on some specimens, as one batch.

    Parameters
    ----------
    cell : the model, in an order that has the directions of the test
    control : name of the test
    specimens : one path each, of equally many steps
    tolerance : relative tolerance of held stresses, see `run_test`

    Returns
    -------
    Records whose `path_id` are the specimens' labels

    Raises
    ------
    ModelError
        If a specimen cannot be followed to the end.
    """
    controls = []
    for specimen in specimens:
        reach = float(abs(specimen.history).max())
        programme = find_test(control).programme(specimen.pressure, reach)
        controls.append(MixedControl.of_programme(programme, specimen.history, cell.order))
    return _run(cell, MixedControl.together(controls), specimens, control, tolerance)


def at_pressures(cell: ClassicalCell, control: str, strain: float, steps: int) -> xr.Dataset:
    """A monotonic standard test at each of `PRESSURES`."""
    history = monotonic(strain, steps)
    specimens = [
        Specimen(label, history, pressure)
        for label, pressure in zip(BY_PRESSURE, PRESSURES, strict=True)
    ]
    return standard_test(cell, control, specimens)


def strain_path(cell: ClassicalCell, strain: Floats, specimens: Sequence[Specimen]) -> xr.Dataset:
    """Specimens along prescribed strains (path, step, component); otherwise as `standard_test`."""
    return _run(cell, MixedControl.of_strain(cell.order, strain), specimens, "prescribed")


def _run(
    cell: ClassicalCell,
    control: MixedControl,
    specimens: Sequence[Specimen],
    family: str,
    tolerance: float | None = None,
) -> xr.Dataset:
    stress = np.stack([isotropic_stress(one.pressure, cell.order) for one in specimens])
    scalars = {
        name: torch.tensor([one.scalars[name] for one in specimens], dtype=torch.float64)
        for name in specimens[0].scalars
    }
    test = run_test(
        cell, control, Conditions(torch.from_numpy(stress), scalars), tolerance=tolerance
    )
    if test.failures:
        first = test.failures[0]
        raise ModelError(
            f"{cell.name}, {specimens[first.point].label}, step {first.step}: {first.reason}; "
            "shorten the test on the page"
        )
    answer = response_records(
        cell.order,
        test.strain,
        test.stress,
        test.internals,
        family=family,
        configuration={"model": cell.name, "parameters": cell.values()},
        version=__version__,
    )
    return answer.assign_coords(path_id=("path", [one.label for one in specimens]))


def ends(panel: Panel) -> dict[str, tuple[float, float]]:
    """End point of each curve of a panel by its label, in the units of the axes."""
    return {label: (float(x[-1]), float(y[-1])) for label, (x, y) in panel.curves().items()}
