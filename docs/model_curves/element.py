"""Element tests that the pages of the models show, and what is known of them in closed form.

The modules beside this one run the tests of one model in each function. They write closed forms
down from the equations, without any code of the model.
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
"""Where the closed form assumes nothing that the model does not: the tolerance of held stresses
and rounding, and no more."""


@dataclass(frozen=True)
class Specimen:
    """One curve of a figure.

    Parameters
    ----------
    label : in the legend
    history : (step,), its driving strain from zero on
    pressure : isotropic stress at the start, Pa
    scalars : what else is known at the start, such as `initial_void_ratio`
    """

    label: str
    history: Floats
    pressure: float = 1e5
    scalars: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Comparison:
    """A number of a drawn curve beside its closed form.

    Parameters
    ----------
    what : the test and the number
    formula : in mathematics of the page
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
        """Relative to the closed form; absolute where that is zero."""
        return abs(self.model - self.closed_form) / (abs(self.closed_form) or 1.0)


@dataclass(frozen=True)
class Evidence:
    """What the page of a model shows.

    Parameters
    ----------
    panels : of the figure
    comparisons : of the curves with closed forms
    """

    panels: tuple[Panel, ...]
    comparisons: tuple[Comparison, ...]


def monotonic(strain: float, steps: int) -> Floats:
    """Driving strain (step,) up to `strain` in steps that grow, so that the start is seen well."""
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
    tolerance : of held stresses, see `run_test`

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
    way = monotonic(strain, steps)
    specimens = [
        Specimen(label, way, pressure)
        for label, pressure in zip(BY_PRESSURE, PRESSURES, strict=True)
    ]
    return standard_test(cell, control, specimens)


def strain_path(cell: ClassicalCell, strain: Floats, specimens: Sequence[Specimen]) -> xr.Dataset:
    """Specimens along prescribed strains (path, step, component); else as `standard_test`."""
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
    """Where each curve of a panel ends, by its label, in the units of the axes."""
    return {label: (float(x[-1]), float(y[-1])) for label, (x, y) in panel.curves().items()}
