"""Tests of `csuh` and `modified-cam-clay`, which end at their critical states."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from granbench.models import find_model
from granbench.models.classical import ClassicalCell
from granbench.paths.programme import Floats
from granbench.paths.standard_tests import strain_history
from granbench.plotting.model import ClosedForm, Panel
from model_curves.element import (
    KILO,
    Comparison,
    Evidence,
    Specimen,
    ends,
    monotonic,
    standard_test,
    strain_path,
)

HELD_WITHIN = 1e-4
"""Relative tolerance of held stresses in drained tests: a tenth of what a page shows, in a third of
the time."""


def undrained(cell: ClassicalCell, specimens: Sequence[Specimen]) -> xr.Dataset:
    """Undrained triaxial compression; no stress is held, because the models keep s22 = s33."""
    strain = np.stack([one.history for one in specimens])[..., None] * np.array([1.0, -0.5, -0.5])
    return strain_path(cell, strain, specimens)


def csuh() -> Evidence:
    """Dense to loose sand with `csuh`, drained and undrained, up to the critical state."""
    cell = find_model("csuh")(parameter_set="toyoura", order="principal")
    c = cell.values()
    m, slope, kappa, chi = (
        c[name]
        for name in ("critical_ratio", "compression_slope", "swelling_slope", "critical_spacing")
    )
    p_s = np.expm1((c["compression_intercept"] - c["low_pressure_intercept"]) / slope)

    def loosest(p: Floats, surface: Floats) -> Floats:
        """e_eta at p and A p, kPa."""
        compressed = np.log((p + p_s) / (1.0 + p_s))
        sheared = np.log((surface + p_s) / (p + p_s))
        return c["low_pressure_intercept"] - slope * compressed - (slope - kappa) * sheared

    def critical(p: Floats) -> Floats:
        return loosest(p, 2.0 * p / (1.0 - chi))

    def critical_pressure(e: float) -> float:
        return float(brentq(lambda p: critical(p) - e, 1e-3, 1e5))

    def specimen(e: float, history: Floats, p0: float = 1e5) -> Specimen:
        label = f"$e_0$ = {e:g}" if p0 == 1e5 else f"$e_0$ = {e:g}, {p0 / 1e6:g} MPa"
        return Specimen(label, history, p0, {"initial_void_ratio": e})

    densities = (0.735, 0.833, 0.907)
    drained = standard_test(
        cell, "triaxial-drained", [specimen(e, monotonic(0.25, 40)) for e in densities],
        tolerance=HELD_WITHIN,
    )  # fmt: skip
    history = monotonic(0.4, 160)
    constant_volume = undrained(
        cell,
        [specimen(0.907, history), specimen(0.86, history), specimen(0.833, history),
         specimen(0.833, history, 1e6), specimen(0.833, history, 2e6)],
    )  # fmt: skip
    cyclic = undrained(cell, [specimen(0.907, strain_history([0.004, -0.004] * 4, 640))])
    p = np.geomspace(15.0, 3000.0, 100)
    states = {e: critical_pressure(e) for e in (0.907, 0.86, 0.833)}
    pressures = np.array(list(states.values()))
    drained_end = 3.0 * m / (3.0 - m) * 1e5
    compression = Panel(
        "Drained, $p_0$ = 100 kPa", "axial_strain", "deviatoric_stress", [drained],
        [ClosedForm("critical state", [0.0, 0.25], [drained_end] * 2, line=True)],
        legend="lower right",
    )  # fmt: skip
    volumes = Panel(
        "Drained, $p_0$ = 100 kPa", "axial_strain", "volumetric_strain", [drained], legend=None
    )
    paths = Panel(
        "Undrained stress paths", "mean_stress", "deviatoric_stress", [constant_volume],
        [ClosedForm("$q=Mp$", [0.0, 2.1e6], [0.0, 2.1e6 * m], line=True),
         ClosedForm("critical state", KILO * pressures, KILO * m * pressures)],
        window=(0.0, 2100.0, 0.0, 1900.0), legend="upper left", named=False,
    )  # fmt: skip
    strength = Panel(
        "Undrained strength", "axial_strain", "deviatoric_stress", [constant_volume],
        [ClosedForm("critical state", np.full(3, 0.4), KILO * m * pressures)],
        legend="upper left", window=(np.nan, np.nan, np.nan, 2750.0),
    )  # fmt: skip
    density = Panel(
        "To the critical state; level: undrained", "mean_stress", "void_ratio",
        [drained.assign_coords(path_id=("path", [f"drained {e}" for e in densities])),
         constant_volume],
        [ClosedForm("critical state", KILO * p, critical(p), line=True),
         ClosedForm("loosest state", KILO * p, loosest(p, p), line=True)],
        logarithmic=True, legend="lower left", named=False,
        window=(np.nan, np.nan, 0.66, np.nan),
    )  # fmt: skip
    loop = Panel(
        "Cyclic, undrained, $e_0$ = 0.907",
        "axial_strain",
        "stress_difference",
        [cyclic],
        legend=None,
    )
    end, end_drained = ends(strength), ends(compression)
    return Evidence(
        (compression, volumes, paths, strength, density, loop),
        (
            *(
                # The critical state is approached asymptotically.
                Comparison(f"undrained, $e_0$ = {e:g}: $q$ at 40 %", r"M p_{cs}(e_0)",
                           end[f"$e_0$ = {e:g}"][1], m * state, "kPa", 0.01)
                for e, state in states.items()
            ),
            Comparison("undrained, $e_0$ = 0.833 from 2 MPa: $q$ at 40 %", r"M p_{cs}(e_0)",
                       end["$e_0$ = 0.833, 2 MPa"][1], m * states[0.833], "kPa", 0.01),
            Comparison("drained, $e_0$ = 0.907: $q$ at 25 %", r"\frac{3M}{3-M} p_0",
                       end_drained["$e_0$ = 0.907"][1], drained_end / KILO, "kPa", 0.02),
        ),
    )  # fmt: skip


def modified_cam_clay() -> Evidence:
    """Normally consolidated and overconsolidated clay with `modified-cam-clay`, and compression."""
    cell = find_model("modified-cam-clay")(order="principal")
    c = cell.values()
    m, slope, kappa, top = (
        c[name]
        for name in (
            "critical_ratio",
            "compression_slope",
            "swelling_slope",
            "compression_intercept",
        )
    )
    ratios, p0 = np.array([1.0, 2.0, 8.0]), 1e5
    names = [f"OCR = {ratio:g}" for ratio in ratios]

    def specimens(history: Floats) -> list[Specimen]:
        return [
            Specimen(name, history, p0, {"overconsolidation_ratio": ratio})
            for name, ratio in zip(names, ratios, strict=True)
        ]

    drained = standard_test(
        cell, "triaxial-drained", specimens(monotonic(0.4, 50)), tolerance=HELD_WITHIN
    )
    constant_volume = undrained(cell, specimens(monotonic(0.15, 120)))
    cycles = strain_history([0.01, -0.01] * 2 + [0.01], 400)
    cyclic = undrained(cell, specimens(cycles)[:2])
    volumetric = strain_history([0.1, 0.07, 0.16], 190)
    isotropic = volumetric[:, None] * np.full(3, 1.0 / 3.0)
    compressed = strain_path(cell, isotropic[None], specimens(volumetric)[:1])
    drained_end = 3.0 * m / (3.0 - m) * p0
    states = p0 * (0.5 * ratios) ** ((slope - kappa) / slope)
    # p^2 - p_c p + (q/M)^2 = 0 at p_c = OCR p0; a gap separates the three curves.
    share = np.append(np.linspace(0.0, 1.0, 80), np.nan)
    surface_p = np.concatenate([share * ratio * p0 for ratio in ratios])
    surface_q = np.concatenate(
        [m * ratio * p0 * np.sqrt(share * (1.0 - share)) for ratio in ratios]
    )
    p = np.geomspace(40.0, 1500.0, 60)
    normal = top - slope * np.log(p)
    compression = Panel(
        "Drained, $p_0$ = 100 kPa", "axial_strain", "deviatoric_stress", [drained],
        [ClosedForm("critical state", [0.0, 0.4], [drained_end] * 2, line=True)],
    )  # fmt: skip
    strength = Panel(
        "Undrained strength", "axial_strain", "deviatoric_stress", [constant_volume],
        [ClosedForm("critical state", np.full(3, 0.15), m * states)],
        legend="upper right", window=(np.nan, np.nan, np.nan, 640.0),
    )  # fmt: skip
    paths = Panel(
        "Undrained stress paths", "mean_stress", "deviatoric_stress", [constant_volume],
        [ClosedForm("$q=Mp$", [0.0, 5e5], [0.0, 5e5 * m], line=True),
         ClosedForm("first yield surfaces", surface_p, surface_q, line=True),
         ClosedForm("critical state", states, m * states)],
        window=(0.0, 520.0, 0.0, 500.0), named=False, legend="lower right",
    )  # fmt: skip
    density = Panel(
        "Isotropic compression", "mean_stress", "void_ratio", [compressed],
        [ClosedForm("normal compression", KILO * p, normal, line=True),
         ClosedForm("critical state", KILO * p, normal - (slope - kappa) * np.log(2.0),
                    line=True)],
        logarithmic=True,
    )  # fmt: skip
    loop = Panel("Cyclic, undrained", "axial_strain", "stress_difference", [cyclic])
    volumes = Panel(
        "Drained, $p_0$ = 100 kPa", "axial_strain", "volumetric_strain", [drained], legend=None
    )
    end = ends(strength)
    ((end_pressure, end_density),) = ends(density).values()
    return Evidence(
        (compression, volumes, paths, strength, density, loop),
        (
            *(
                # OCR = 1 approaches the state asymptotically; OCR = 8 does not quite reach it.
                Comparison(f"undrained, {name}: $q$ at 15 %",
                           r"M p_0 \big(\tfrac{\mathrm{OCR}}2\big)^{1-\kappa/\lambda}",
                           end[name][1], m * state / KILO, "kPa", 1e-3)
                for name, state in zip(names, states, strict=True)
            ),
            *(
                Comparison(f"drained, {name}: $q$ at 40 %", r"\frac{3M}{3-M} p_0",
                           ends(compression)[name][1], drained_end / KILO, "kPa", 1e-2)
                for name in names
            ),
            Comparison(f"isotropic compression: $e$ at {end_pressure:.0f} kPa",
                       r"N-\lambda\ln p", end_density,
                       top - slope * np.log(end_pressure), "1", 1e-4),
        ),
    )  # fmt: skip
