"""The element tests of the laboratory by name, and histories of the strain that drives them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from granbench.errors import ConfigurationError, alternatives
from granbench.paths.element_tests import (
    BiaxialCompression,
    DrainedSimpleShear,
    Oedometer,
    SimpleShear,
    UndrainedTriaxial,
)
from granbench.paths.programme import Floats, LoadingProgramme
from granbench.paths.triaxial import ConstantMeanStress, ConstantMinorStress
from granbench.units.plausible import LARGEST_STRAIN


@dataclass(frozen=True)
class StandardTest:
    """A test that is known by its name.

    Parameters
    ----------
    title : full name
    make : programme of a pressure p0, Pa, a largest driving strain and, where `takes_b`, b
    takes_b : whether an intermediate stress ratio b is held
    """

    title: str
    make: Callable[..., LoadingProgramme]
    takes_b: bool = False

    def programme(
        self, pressure: float, largest_strain: float, b: float | None = None
    ) -> LoadingProgramme:
        """The programme of a test.

        Parameters
        ----------
        pressure : p0, Pa
        largest_strain : that the driving strain reaches in either sense
        b : intermediate stress ratio; 0 where it is held and None is given

        Raises
        ------
        ConfigurationError
            If the test holds no b but one is given, the strain seems to be in per cent, or a
            value is out of range.
        """
        if not largest_strain <= LARGEST_STRAIN:
            raise ConfigurationError(
                f"a driving strain of {largest_strain:g} is beyond {LARGEST_STRAIN:g}; strain has "
                "no unit: write 0.2 for 20 %"
            )
        if self.takes_b:
            return self.make(pressure, largest_strain, b or 0.0)
        if b is not None:
            raise ConfigurationError(
                f"b = {b:g} is given, but the test ({self.title}) does not hold it; leave b out"
            )
        return self.make(pressure, largest_strain)


STANDARD_TESTS: Mapping[str, StandardTest] = {
    "triaxial-drained": StandardTest(
        "drained triaxial test, lateral stress and b held",
        lambda p, reach, b: ConstantMinorStress(pressure=p, axial_strain=reach, b=b),
        takes_b=True,
    ),
    "triaxial-undrained": StandardTest(
        "undrained triaxial test, volume and b held",
        lambda p, reach, b: UndrainedTriaxial(pressure=p, largest_strain=reach, b=b),
        takes_b=True,
    ),
    "constant-p": StandardTest(
        "triaxial test at constant mean stress and b",
        lambda p, reach, b: ConstantMeanStress(pressure=p, axial_strain=reach, b=b),
        takes_b=True,
    ),
    "oedometer": StandardTest(
        "compression without lateral strain",
        lambda p, reach: Oedometer(pressure=p, largest_strain=reach),
    ),
    "biaxial": StandardTest(
        "drained plane-strain compression, smooth ends, lateral stress held",
        lambda p, reach: BiaxialCompression(pressure=p, largest_strain=reach),
    ),
    "simple-shear": StandardTest(
        "simple shear at constant volume",
        lambda p, reach: SimpleShear(pressure=p, largest_strain=reach),
    ),
    "simple-shear-drained": StandardTest(
        "simple shear, vertical stress held",
        lambda p, reach: DrainedSimpleShear(pressure=p, largest_strain=reach),
    ),
}


def find_test(name: str) -> StandardTest:
    """The standard test `name`.

    Raises
    ------
    ConfigurationError
        If there is none of this name.
    """
    if name in STANDARD_TESTS:
        return STANDARD_TESTS[name]
    raise ConfigurationError(f"unknown test {name!r}: {alternatives(name, STANDARD_TESTS)}")


def strain_history(corners: Sequence[float], steps: int) -> Floats:
    """Driving strain that goes straight from zero to each corner in turn.

    Every corner is met exactly; steps between are as equal as whole numbers allow.

    Parameters
    ----------
    corners : turning points and, last, the end; each differs from the one before
    steps : of the whole history, at least one to each corner

    Returns
    -------
    (steps + 1,), zero first

    Raises
    ------
    ConfigurationError
        If a corner is not finite or repeats the one before, or there are too few steps.
    """
    stops = np.array([0.0, *corners])
    legs = np.abs(np.diff(stops))
    if not (np.isfinite(legs).all() and (legs > 0.0).all() and len(corners)):
        listed = ", ".join(f"{corner:g}" for corner in corners)
        raise ConfigurationError(
            f"strains {listed or 'none'} cannot be visited in turn from 0; give finite numbers, "
            "each different from the one before"
        )
    if steps < len(legs):
        raise ConfigurationError(
            f"{steps} steps do not reach the {len(legs)} turning points and ends of the test; "
            "take more steps"
        )
    at = np.rint(np.cumsum(legs) / legs.sum() * steps).astype(int)
    # A leg too short for a step of its own takes one from its neighbours.
    for leg in range(len(at)):
        at[leg] = max(at[leg], at[leg - 1] + 1 if leg else 1)
    at = np.minimum(at, steps - np.arange(len(at))[::-1])
    return np.interp(np.arange(steps + 1), [0, *at], stops)
