"""A made-up dataset that follows the schema, for tests that need records but no engine.

The stress ratio r = sigma/p - 1 follows a bounding law that looks like sand,
dr = G (de - r |de| / r_peak), with a peak that falls to the critical state as the void ratio
reaches its critical value; everything is smooth and made in milliseconds.
"""

import json

import numpy as np
import xarray as xr

from granbench.records import CONVENTIONS, describe

GRADINGS = {  # name: (kind, I_G, fractal exponent, d_min, d_max, d50, Cu, Cc)
    "mono": ("mono", 1.0, np.nan, 11.8e-3, 11.8e-3, 11.8e-3, 1.0, 1.0),
    "binary": ("binary", 1.117, np.nan, 7.4e-3, 14.8e-3, 14.8e-3, 1.95, 0.6),
    "linear": ("linear", 1.064, np.nan, 2.1e-3, 21.4e-3, 18.0e-3, 1.5, 1.1),
    "fractal-1.5": ("fractal", 1.290, 1.5, 3.3e-3, 33.0e-3, 21.0e-3, 2.6, 1.1),
}
FRICTIONS = (0.0, 0.1, 0.3, 0.01, 0.2, 0.04, 0.005)
PRESSURES = (1e5, 5e5, 1e6, 2e6, 4e6)
RATIOS = (0.0, 0.5, 1.0)
FAMILIES = ("constant-p", "constant-sigma3", "cyclic", "random-strain")
CRITICAL_RATIO = 0.55  # |r| at the critical state; q/p = sqrt(3/2) |r|


def synthetic_records(n_specimens: int = 8, steps: int = 41, seed: int = 0) -> xr.Dataset:
    """Valid records of `n_specimens` packings, two of them prepared a second time.

    Parameters
    ----------
    n_specimens : packings without the replicates, 5 to 22; the last is `ood-psd`, the two
        before it `test`, the one before these `validation`, the others `train`
    steps : recorded states of a path, the start included
    seed : of the random strain paths and the scatter between packings

    Returns
    -------
    Dataset with five paths a specimen: one of each family and one more constant-p path
    """
    rng = np.random.default_rng(seed)
    rows = _plan(n_specimens, rng)
    strain, stress, void_ratio = _integrate(rows, steps, rng)
    paths = len(rows)
    shape = (paths, steps)
    labels = {name: [row[name] for row in rows] for name in rows[0] if name != "direction"}
    series = ("path", "step")
    ds = xr.Dataset(
        {
            "strain": ((*series, "component"), strain),
            "stress": ((*series, "component"), stress),
            "void_ratio": (series, void_ratio),
            "coordination_number": (series, 9.0 - 5.5 * void_ratio),
            "inertial_number": (series, rng.uniform(2e-4, 1e-3, shape)),
            "servo_error": (series, rng.normal(0.0, 2e-3, shape)),
            "stress_ratio_error": (series, rng.normal(0.0, 4e-3, shape)),
            "shear_stress": (
                (*series, "shear_component"),
                1e-3 * stress.mean(-1, keepdims=True) * rng.normal(size=(*shape, 3)),
            ),
            "fabric": (
                (*series, "fabric_component"),
                np.concatenate([_fabric(stress), np.zeros((*shape, 3))], axis=-1),
            ),
        },
        coords={
            "component": ["11", "22", "33"],
            "shear_component": ["23", "13", "12"],
            "fabric_component": ["xx", "yy", "zz", "yz", "xz", "xy"],
            **{name: ("path", values) for name, values in labels.items()},
        },
        attrs={
            "dataset": "synthetic",
            "version": "1.0.0",
            "generator": "tests.synthetic_records",
            "generator_version": "0",
            "engine": "closed form",
            "engine_version": "0",
            "configuration": json.dumps({"n_specimens": n_specimens, "steps": steps, "seed": seed}),
            "licence": "CC-BY-4.0",
            "thesis_section": "2.1",
            "conventions": CONVENTIONS,
        },
    )
    ds = ds.assign_coords(
        initial_void_ratio=("path", void_ratio[:, 0]),
        servo_error_rms=("path", np.sqrt((ds["servo_error"] ** 2).mean("step").values)),
        stress_ratio_error_rms=(
            "path",
            np.sqrt((ds["stress_ratio_error"] ** 2).mean("step").values),
        ),
        peak_inertial_number=("path", ds["inertial_number"].max("step").values),
    )
    return describe(ds)


def _fabric(stress: np.ndarray) -> np.ndarray:
    ratio = stress / stress.mean(-1, keepdims=True) - 1.0
    return (1.0 + 0.3 * ratio) / 3.0


def _plan(n_specimens: int, rng: np.random.Generator) -> list[dict]:
    seen = [name for name in GRADINGS if name != "fractal-1.5"]
    specimens = []
    for number in range(n_specimens):
        from_end = n_specimens - number
        split = {1: "ood-psd", 2: "test", 3: "test", 4: "validation"}.get(from_end, "train")
        grading = "fractal-1.5" if split == "ood-psd" else seen[number % len(seen)]
        friction = FRICTIONS[(number // len(seen)) % len(FRICTIONS)]
        specimens.append((number, grading, friction, split, 0))
    for number in (0, n_specimens - 3):
        specimens.append((*specimens[number][:4], 1))
    rows = []
    for number, grading, friction, split, replicate in specimens:
        kind, index, beta, d_min, d_max, d50, cu, cc = GRADINGS[grading]
        specimen = f"{grading}-f{friction:g}-r{replicate}"
        void_ratio = 0.50 + 0.17 * (friction / 0.3) ** 0.5 - 0.5 * (index - 1.0)
        void_ratio += 0.004 * rng.normal()
        for order, family in enumerate((*FAMILIES, "constant-p")):
            pressure = PRESSURES[(number + order) % len(PRESSURES)]
            ratio = RATIOS[(number + order) % 3] if family.startswith("constant") else np.nan
            # What the replicate repeats: drawn from the original's number, not from `rng`.
            shape_seed = 100 * number + order
            programme = {"family": family, "p0": pressure, "number": shape_seed}
            rows.append(
                {
                    "path_id": f"{specimen}/{order:02d}-{family}",
                    "specimen": specimen,
                    "split": split,
                    "loading_family": family,
                    "programme": json.dumps(programme),
                    "grading": grading,
                    "grading_kind": kind,
                    "grading_index": index,
                    "fractal_dimension": beta,
                    "d_min": d_min,
                    "d_max": d_max,
                    "d50": d50,
                    "coefficient_of_uniformity": cu,
                    "coefficient_of_curvature": cc,
                    "particle_count": 3000,
                    "box_edge_ratio": 0.12 / d_max,
                    "preparation_friction": friction,
                    "initial_void_ratio": void_ratio,
                    "initial_mean_stress": pressure,
                    "intermediate_stress_ratio": ratio,
                    "seed": 1000 * replicate + number,
                    "replicate": replicate,
                    "direction": shape_seed,
                }
            )
    return rows


def _strain_shape(row: dict, steps: int) -> np.ndarray:
    """Deviatoric strain (step, 3) that the programme prescribes."""
    time = np.linspace(0.0, 1.0, steps)
    if row["loading_family"] == "random-strain":
        rng = np.random.default_rng(row["direction"])
        waves = np.sin(np.pi * np.outer(time, [1, 2, 3, 5])) @ rng.normal(0.0, 0.02, (4, 3))
        return waves - waves.mean(-1, keepdims=True)
    if row["loading_family"] == "cyclic":
        axial = 0.08 * time + 0.03 * np.sin(6.0 * np.pi * time)
        return np.outer(axial, [1.0, -0.5, -0.5])
    b = row["intermediate_stress_ratio"]
    return np.outer(0.4 * time, np.array([2.0 - b, 2.0 * b - 1.0, -1.0 - b]) / (2.0 - b))


def _integrate(
    rows: list[dict], steps: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    deviatoric = np.stack([_strain_shape(row, steps) for row in rows])
    p0 = np.array([row["initial_mean_stress"] for row in rows])
    void = np.array([row["initial_void_ratio"] for row in rows])
    index = np.array([row["grading_index"] for row in rows])
    family = np.array([row["loading_family"] for row in rows])
    stiffness = 120.0 * (1.0 + 0.02 * rng.normal(size=len(rows)))
    ratio = np.zeros((len(rows), 3))
    volumetric = np.zeros(len(rows))
    pressure = p0.copy()
    strain = np.zeros((len(rows), steps, 3))
    stress = np.repeat(p0[:, None, None], steps, axis=1) * np.ones(3)
    voids = np.repeat(void[:, None], steps, axis=1)
    substeps = max(50, 2000 // steps)  # few records must not mean large increments
    for step in range(1, steps):
        increment = (deviatoric[:, step] - deviatoric[:, step - 1]) / substeps
        length = np.linalg.norm(increment, axis=-1)
        for _ in range(substeps):
            critical = 0.69 - 0.5 * (index - 1.0) - 0.02 * np.log10(pressure / 1e5)
            looseness = void - critical
            peak = CRITICAL_RATIO * np.exp(-1.5 * looseness)
            ratio += stiffness[:, None] * (increment - ratio * (length / peak)[:, None])
            mobilised = np.linalg.norm(ratio, axis=-1) / peak
            contraction = 3.0 * looseness * mobilised * length
            volumetric += contraction
            void -= (1.0 + void) * contraction
            pressure = np.select(
                [family == "constant-p", family == "random-strain"],
                [p0, p0 * np.exp(20.0 * volumetric)],
                p0 / (1.0 + ratio[:, 2]),
            )
        strain[:, step] = deviatoric[:, step] + volumetric[:, None] / 3.0
        stress[:, step] = pressure[:, None] * (1.0 + ratio)
        voids[:, step] = void
    return strain, stress, voids
