"""Tests of `ime` and `enhanced-ime`."""

import numpy as np
from scipy.optimize import brentq

from granbench.models import find_model
from granbench.models.classical import ClassicalCell
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
)


def ime() -> Evidence:
    """Both parameter sets of `ime`, volume, a loop, and paths that do not depend on pressure."""
    make, to = find_model("ime"), 0.15
    sets = {name.removeprefix("guan2023-"): name for name in make.parameter_sets}
    cells = {label: make(parameter_set=name, order="principal") for label, name in sets.items()}
    tests = {
        label: standard_test(cell, "triaxial-drained", [Specimen(label, monotonic(to, 100))])
        for label, cell in cells.items()
    }
    turning = strain_history((0.04, -0.02, 0.06), 240)
    loops = [
        standard_test(cell, "triaxial-drained", [Specimen(label, turning)])
        for label, cell in cells.items()
    ]
    first = next(iter(cells.values()))
    pressures = at_pressures(first, "triaxial-drained", to, 100)

    def at(cell: ClassicalCell, norm: Floats) -> tuple[Floats, Floats]:
        """Axial strain and q once the plastic strain's norm is `norm`."""
        c = cell.values()
        power = (norm + c["hardening_strain"]) ** c["hardening_exponent"]
        q = c["yield_stress"] + c["hardening_modulus"] * power
        return q / c["young_modulus"] + np.sqrt(2.0 / 3.0) * norm, q

    norms = np.array([0.0, 0.02, 0.06, 0.12, 0.16])
    known = [at(cell, norms) for cell in cells.values()]
    axial, q = (np.concatenate(row) for row in zip(*known, strict=True))
    share = [
        (1.0 - 2.0 * cell.values()["poisson_ratio"]) / cell.values()["young_modulus"]
        for cell in cells.values()
    ]
    volume = q * np.repeat(share, len(norms))
    compression = Panel(
        "Drained triaxial compression", "axial_strain", "deviatoric_stress", list(tests.values()),
        [ClosedForm("closed form", axial, q)],
    )  # fmt: skip
    volumes = Panel(
        "Volume", "axial_strain", "volumetric_strain", list(tests.values()),
        [ClosedForm("closed form", axial, volume)],
    )  # fmt: skip
    paths = Panel(
        "Stress paths, sec5.2.1", "mean_stress", "deviatoric_stress", [pressures],
        [ClosedForm("first yield", [0.0, 3e5], [q[0]] * 2, line=True)],
        window=(0.0, 300.0, 0.0, 379.0), legend="upper left",
    )  # fmt: skip
    comparisons = []
    for label, cell in cells.items():
        norm = brentq(lambda norm, cell=cell: float(at(cell, np.array(norm))[0]) - to, 0.0, 1.0)
        comparisons.append(
            Comparison(f"{label}: $q$ at 15 %",
                       r"\varepsilon_a=\frac{q}{E}+\sqrt{\tfrac23}"
                       r"\Big[\big(\tfrac{q-\sigma_0}{A}\big)^{1/n}-\varepsilon_0\Big]",
                       ends(compression)[label][1], float(at(cell, np.array(norm))[1]) / KILO,
                       "kPa", EXACT)
        )  # fmt: skip
    loop = Panel("Cyclic triaxial test", "axial_strain", "stress_difference", loops)
    return Evidence((compression, volumes, loop, paths), tuple(comparisons))


def _surface(cell: ClassicalCell, shear: Floats, p: Floats) -> Floats:
    """Strength q of `enhanced-ime` at a plastic shear strain, no compaction (Eq 7.17, 7.18)."""
    c = cell.values()
    by_shear = (
        c["shear_hardening_modulus"]
        * (c["shear_hardening_strain"] + shear) ** (c["shear_hardening_exponent"])
    )
    by_volume = c["volumetric_hardening_modulus"] * (
        c["volumetric_hardening_strain"] ** c["volumetric_hardening_exponent"]
    )
    return c["yield_stress"] + by_shear + by_volume - c["pressure_slope"] * p


def enhanced_ime() -> Evidence:
    """Both parameter sets of `enhanced-ime` at three pressures, a loop, and yield surfaces."""
    make, to = find_model("enhanced-ime"), 0.2
    original, optimised = (
        make(parameter_set=name, order="principal") for name in make.parameter_sets
    )
    first = at_pressures(original, "triaxial-drained", to, 60)
    second = at_pressures(optimised, "triaxial-drained", to, 60)
    turning = strain_history((0.04, -0.02, 0.06), 160)
    loop = standard_test(original, "triaxial-drained", [Specimen("original", turning)])

    def at(cell: ClassicalCell, shear: Floats, pressure: float) -> tuple[Floats, Floats, Floats]:
        """Axial strain, volumetric strain and q once the plastic shear strain is `shear`.

        Elastic strains are those of E_0; the stiffness of the optimised set falls with dilation,
        but at some 0.03 % its elastic strains are too small to be seen.
        """
        c = cell.values()
        slope = c["flow_slope"] + c["pressure_slope"]
        # p = p0 + q/3 in a drained test.
        q = _surface(cell, shear, np.array(pressure)) / (1.0 + c["pressure_slope"] / 3.0)
        elastic = q / c["young_modulus"]
        volume = (1.0 - 2.0 * c["poisson_ratio"]) * elastic + slope * shear
        return elastic + shear * (1.0 + slope / 3.0), volume, q

    def known(cell: ClassicalCell, shear: Floats) -> tuple[Floats, Floats, Floats]:
        parts = [at(cell, shear, pressure) for pressure in PRESSURES]
        axial, volume, q = (np.concatenate(row) for row in zip(*parts, strict=True))
        return axial, volume, q

    shear = {"original": np.array([0.0, 0.02, 0.07, 0.15]), "optimised": np.array([0.0, 0.05, 0.2])}
    panels = []
    for (label, where), cell, tests in zip(
        shear.items(), (original, optimised), (first, second), strict=True
    ):
        axial, volume, q = known(cell, where)
        panels += [
            Panel(f"tab7.2-{label}", "axial_strain", "deviatoric_stress", [tests],
                  [ClosedForm("closed form", axial, q)]),
            Panel(f"Volume, tab7.2-{label}", "axial_strain", "volumetric_strain", [tests],
                  [ClosedForm("closed form", axial, volume)]),
        ]  # fmt: skip
    loops = Panel(
        "Cyclic, tab7.2-original", "axial_strain", "stress_difference", [loop], legend=None
    )
    p = np.array([0.0, 3e5])
    first_yield, friction = (_surface(optimised, np.array(gone), p) for gone in (0.0, np.inf))
    paths = Panel(
        "Stress paths, tab7.2-optimised", "mean_stress", "deviatoric_stress", [second],
        [ClosedForm("first yield", p, first_yield, line=True),
         ClosedForm("friction alone", p, friction, line=True)],
        window=(0.0, 300.0, 0.0, 459.0), legend="upper left",
    )  # fmt: skip
    comparisons = []
    for cell, panel, label, tolerance in (
        (original, panels[0], "original", 1e-4),
        # E_0 in place of the stiffness that dilation has changed.
        (optimised, panels[2], "optimised", 5e-3),
    ):
        end_strain, end_stress = ends(panel)[BY_PRESSURE[1]]
        shears = np.linspace(0.0, 0.3, 30001)
        axial, _, q = at(cell, shears, 1e5)
        comparisons.append(
            Comparison(f"{label}: $q$ at {end_strain:g} %, $p_0$ = 100 kPa",
                       r"\frac{\sigma_0+H-C_p p_0}{1+C_p/3}", end_stress,
                       float(np.interp(to, axial, q)) / KILO, "kPa", tolerance)
        )  # fmt: skip
    return Evidence((*panels, loops, paths), tuple(comparisons))
