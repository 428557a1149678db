"""Tests of the two-dimensional models `j2`, `drucker-prager` and `j2-hardening`."""

import numpy as np
from scipy.optimize import brentq

from granbench.models import find_model
from granbench.paths.programme import Floats
from granbench.paths.standard_tests import strain_history
from granbench.plotting.model import ClosedForm, Panel
from model_curves.element import (
    BY_PRESSURE,
    EXACT,
    KILO,
    PRESSURES,
    Comparison,
    Evidence,
    Specimen,
    at_pressures,
    ends,
    monotonic,
    standard_test,
    strain_path,
)

STRETCHED = "stretched along $x$"


def j2() -> Evidence:
    """Strength of `j2` in three kinds of test, volume, a loop, and paths to the yield line."""
    make, to = find_model("j2"), 0.15
    plane, solid = make(), make(order="principal")
    c = plane.values()
    history, turning = monotonic(to, 150), strain_history((0.08, -0.08, 0.1), 260)
    biaxial = standard_test(plane, "biaxial", [Specimen("biaxial, in the plane", history)])
    strain = standard_test(solid, "biaxial", [Specimen("biaxial, plane strain", history)])
    triaxial = standard_test(solid, "triaxial-drained", [Specimen("triaxial compression", history)])
    loop = standard_test(plane, "biaxial", [Specimen("biaxial", turning)])
    pressures = at_pressures(plane, "biaxial", to, 150)
    strength, volume = c["yield_stress"], c["yield_stress"] / (2.0 * c["bulk_modulus"])
    first_yield = strength / (4.0 * c["bulk_modulus"]) + strength / (4.0 * c["shear_modulus"])
    known = (strength, strength, 2.0 / np.sqrt(3.0) * strength)
    compression = Panel(
        "Compression at constant lateral stress", "axial_strain", "stress_difference",
        [biaxial, triaxial, strain],
        [ClosedForm("closed form", [first_yield, to, to], [strength, *known[1:]])],
    )  # fmt: skip
    volumes = Panel(
        "Volume, biaxial in the plane", "axial_strain", "volumetric_strain", [biaxial],
        [ClosedForm("closed form", [first_yield, to], [volume, volume])],
    )  # fmt: skip
    end = ends(compression)
    return Evidence(
        (
            compression,
            volumes,
            Panel(
                r"Cyclic biaxial test (dashed: $\pm\sigma_Y$)", "axial_strain", "stress_difference",
                [loop],
                [ClosedForm("strength", [-0.1, 0.1, np.nan, -0.1, 0.1],
                            strength * np.array([1, 1, np.nan, -1, -1]), line=True)],
                legend=None,
            ),
            Panel(
                "Stress paths in the plane", "mean_stress", "deviatoric_stress", [pressures],
                [ClosedForm(r"yield line $q=\sigma_Y$", [0.0, 3e5], [strength] * 2, line=True)],
                window=(0.0, 300.0, 0.0, 170.0), legend="upper left",
            ),
        ),
        (
            _strength("biaxial in the plane", r"\sigma_Y",
                      end["biaxial, in the plane"][1], known[0]),
            _strength("triaxial compression", r"\sigma_Y",
                      end["triaxial compression"][1], known[1]),
            # The out-of-plane stress starts elastic and approaches the mean of the others like
            # exp(-strain): at 15 % the difference is about 1e-4.
            _strength("biaxial in plane strain", r"\tfrac{2}{\sqrt3} \sigma_Y",
                      end["biaxial, plane strain"][1], known[2], tolerance=1e-3),
            Comparison("volumetric strain after yield, biaxial in the plane",
                       r"\frac{\sigma_Y}{2K}", ends(volumes)["biaxial, in the plane"][1],
                       100.0 * volume, "%", EXACT),
        ),
    )  # fmt: skip


def _strength(
    what: str, formula: str, model: float, closed_form: float, tolerance: float = EXACT
) -> Comparison:
    """Comparison of a stress difference in kPa with its closed form in Pa."""
    return Comparison(
        f"strength, {what}", formula, model, closed_form / KILO, "kPa", tolerance
    )  # fmt: skip


def drucker_prager() -> Evidence:
    """Rankine's strength with `drucker-prager`, dilation, a loop, and a path to the apex."""
    cell, to = find_model("drucker-prager")(), 0.2
    c = cell.values()
    friction, dilation = c["friction_slope"], c["dilation_slope"]
    p0 = np.array(PRESSURES)
    strength = friction * p0 / (1.0 - friction / 2.0)
    first_yield = strength / (4.0 * c["bulk_modulus"]) + strength / (4.0 * c["shear_modulus"])
    volume = strength / (2.0 * c["bulk_modulus"])
    slope = -dilation / (1.0 - dilation / 2.0)
    biaxial = at_pressures(cell, "biaxial", to, 200)
    turning = strain_history((0.1, -0.1, 0.12), 320)
    loop = standard_test(cell, "biaxial", [Specimen("biaxial", turning)])
    stretched = np.zeros((1, 121, 3))
    stretched[0, :, 0] = np.linspace(0.0, -0.24, 121)
    apex = strain_path(cell, stretched, [Specimen(STRETCHED, stretched[0, :, 0])])
    at = np.full(3, to)
    compression = Panel(
        "Biaxial compression", "axial_strain", "stress_difference", [biaxial],
        [ClosedForm("closed form", at, strength)],
        window=(np.nan, np.nan, np.nan, 219.0), legend="upper left",
    )  # fmt: skip
    volumes = Panel(
        "Volume", "axial_strain", "volumetric_strain", [biaxial],
        [ClosedForm("closed form", np.concatenate([first_yield, at]),
                    np.concatenate([volume, volume + slope * (at - first_yield)]))],
    )  # fmt: skip
    paths = Panel(
        "Stress paths", "mean_stress", "deviatoric_stress",
        [biaxial, apex],
        [ClosedForm("yield line $q=Mp$", [0.0, 3e5], [0.0, 3e5 * friction], line=True)],
        window=(0.0, 300.0, 0.0, 219.0), legend="upper left",
    )  # fmt: skip
    end, end_volume = ends(compression), ends(volumes)
    passive = 2.0 * friction / (2.0 - friction)
    active = -2.0 * friction / (2.0 + friction)
    return Evidence(
        (
            compression,
            volumes,
            Panel(
                "Cyclic, 100 kPa (dashed: strength)", "axial_strain", "stress_difference",
                [loop],
                [ClosedForm("strength", [-0.1, 0.12, np.nan, -0.1, 0.12],
                            1e5 * np.array([passive, passive, np.nan, active, active]),
                            line=True)],
                legend=None,
            ),
            paths,
        ),
        (
            *(
                _strength(f"biaxial at {p / KILO:g} kPa", r"\frac{M p_0}{1-M/2}",
                          end[label][1], known)
                for label, p, known in zip(BY_PRESSURE, p0, strength, strict=True)
            ),
            Comparison("volumetric strain at 20 %, biaxial at 100 kPa",
                       r"\frac{q}{2K}-\frac{M_d}{1-M_d/2} (\varepsilon_a-\varepsilon_{a,Y})",
                       end_volume[BY_PRESSURE[1]][1],
                       100.0 * float(volume[1] + slope * (to - first_yield[1])), "%", EXACT),
            Comparison("mean stress of the stretched point", "0",
                       ends(paths)[STRETCHED][0], 0.0, "kPa", EXACT),
        ),
    )  # fmt: skip


def j2_hardening() -> Evidence:
    """Hardening curve of `j2-hardening`, volume, and a loop compared with the hardening law."""
    cell, to = find_model("j2-hardening")(), 0.2
    c = cell.values()
    turning = strain_history((to, -0.1, to), 400)
    biaxial = standard_test(cell, "biaxial", [Specimen("biaxial in the plane", monotonic(to, 200))])
    loop = standard_test(cell, "biaxial", [Specimen("biaxial", turning)])

    def at(flow: Floats) -> tuple[Floats, Floats]:
        """Axial strain and q once the plastic strain's norm is `flow`."""
        q = c["hardening_modulus"] * (flow + c["hardening_strain"]) ** c["hardening_exponent"]
        elastic = q / (4.0 * c["bulk_modulus"]) + q / (4.0 * c["shear_modulus"])
        return elastic + flow / np.sqrt(2.0), q

    flow = np.array([0.0, 0.03, 0.07, 0.12])
    axial, q = at(flow)
    compression = Panel(
        "Biaxial compression", "axial_strain", "stress_difference", [biaxial],
        [ClosedForm("closed form", axial, q)],
    )  # fmt: skip
    volumes = Panel(
        "Volume", "axial_strain", "volumetric_strain", [biaxial],
        [ClosedForm("closed form", axial, q / (2.0 * c["bulk_modulus"]))],
    )  # fmt: skip
    law = Panel(
        "The same loop against the law", "plastic_strain_norm", "deviatoric_stress", [loop],
        [ClosedForm(r"$A(\|\varepsilon^p\|_F+\varepsilon_0)^B$", np.linspace(0.0, 0.15, 80),
                    at(np.linspace(0.0, 0.15, 80))[1], line=True)],
    )  # fmt: skip
    ((_, end_stress),) = ends(compression).values()
    known_flow = brentq(lambda flow: float(at(np.array(flow))[0]) - to, 0.0, 1.0)
    known_stress = float(at(np.array(known_flow))[1])
    ((_, end_volume),) = ends(volumes).values()
    return Evidence(
        (
            compression,
            volumes,
            Panel(
                "Cyclic biaxial test", "axial_strain", "stress_difference", [loop], legend=None
            ),
            law,
        ),
        (
            Comparison("$q$ at 20 %, biaxial",
                       r"\varepsilon_a=\frac{q}{4K}+\frac{q}{4G}+\frac{1}{\sqrt2}"
                       r"\Big[\big(\tfrac{q}{A}\big)^{1/B}-\varepsilon_0\Big]",
                       end_stress, known_stress / KILO, "kPa", EXACT),
            Comparison("volumetric strain there", r"\frac{q}{2K}", end_volume,
                       100.0 * known_stress / (2.0 * c["bulk_modulus"]), "%", EXACT),
        ),
    )  # fmt: skip
