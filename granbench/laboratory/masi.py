"""Strain and stress paths of Masi and co-workers (.npz), each step as a pair of states.

Two components are the volumetric and the deviatoric invariant (p and q for stress, e_v and
e_q = 2/3 (e1 - e3) for strain), one is a bar. The files state no units: the user gives them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.laboratory.array_file import require_few, require_shape
from granbench.laboratory.interpretation import laboratory_test_from
from granbench.laboratory.laboratory_test import LaboratoryTest
from granbench.laboratory.remedies import unit
from granbench.laboratory.settings import ImportSettings
from granbench.tables.tables import Table

Floats = NDArray[np.float64]

NAMED_KEYS = frozenset({"strain_k", "strain_k1", "stress_k", "stress_k1"})

NICE_ARRAYS: Mapping[int, tuple[str, str]] = {
    5: ("a0", "a2"),  # benchmark 1, training: strain, strain after, stress, ...
    9: ("a0", "a6"),  # benchmark 2, training: strain, strain after, density and porosity, stress
    12: ("a1", "a0"),  # benchmark 1, inference: stress, strain, ...
    14: ("a1", "a0"),  # benchmark 2, inference: stress, strain, ...
}
"""Arrays of strain and stress in the NICE files (numbered arrays), by the number of arrays.
The last array is the number of steps of a path."""


def is_nice(arrays: Mapping[str, NDArray]) -> bool:
    """Whether arrays are those of a NICE file."""
    names = {f"a{place}" for place in range(len(arrays))}
    if len(arrays) not in NICE_ARRAYS or set(arrays) != names:
        return False
    strain, stress = NICE_ARRAYS[len(arrays)]
    shape = arrays[strain].shape
    last = arrays[f"a{len(arrays) - 1}"]
    return len(shape) == 2 and shape[1] == 2 and arrays[stress].shape == shape and last.ndim == 0


def read_paths(
    path: Path, arrays: Mapping[str, NDArray], settings: ImportSettings
) -> list[LaboratoryTest]:
    """Read the paths of a file.

    Parameters
    ----------
    path : of the file
    arrays : (time, path, component) `strain_k`, `stress_k` and their values one step later, with
        the number of valid steps of each path in `stop` where they differ; or see `NICE_ARRAYS`
    settings : units of `strain` and `stress`

    Raises
    ------
    DatasetError
        If the user gave no units, an array has another shape, a number of steps is impossible,
        or see `laboratory_test_from`.
    """
    for group, example in (("strain", "-"), ("stress", "kPa")):
        if group not in settings.units:
            raise DatasetError(
                f"{path}: states no units; give that of {group}, such as ", unit(group, example)
            )
    if settings.strain_measure == "engineering":
        # The paths were computed with infinitesimal strain: no finite measure has to be converted.
        settings = replace(settings, strain_measure="logarithmic")
    paths = _nice(path, arrays) if is_nice(arrays) else _named(path, arrays)
    return [
        _test(path, number, strain, stress, settings)
        for number, (strain, stress) in enumerate(paths, start=1)
    ]


def _named(path: Path, arrays: Mapping[str, NDArray]) -> Iterator[tuple[Floats, Floats]]:
    """Strain and stress (step, component) of every path, the last state included."""
    components = 1 if arrays["strain_k"].shape[-1:] == (1,) else 2
    shape = require_shape(path, arrays, "strain_k", ("steps", "paths", components))
    for name in sorted(NAMED_KEYS):
        require_shape(path, arrays, name, shape)
    steps, count, _ = shape
    require_few(path, count)
    if "stop" in arrays:
        require_shape(path, arrays, "stop", (count,))
    stops = arrays["stop"] if "stop" in arrays else np.full(count, steps)
    for place, stop in enumerate([_steps(path, "stop", number, steps) for number in stops]):
        parts = []
        for name in ("strain", "stress"):
            before, after = arrays[f"{name}_k"][:stop, place], arrays[f"{name}_k1"][:stop, place]
            parts.append(np.concatenate([before, after[-1:]]).astype(float))
        yield parts[0], parts[1]


def _steps(path: Path, name: str, number: float, most: int) -> int:
    if not (1 <= number <= most and number == int(number)):
        raise DatasetError(
            f"{path}: its array {name!r} gives a path {number:g} steps, but there are {most}; give "
            "a whole number from 1 on"
        )
    return int(number)


def _nice(path: Path, arrays: Mapping[str, NDArray]) -> Iterator[tuple[Floats, Floats]]:
    """Strain and stress (step, 2) of every path."""
    strain_name, stress_name = NICE_ARRAYS[len(arrays)]
    for name in (strain_name, stress_name):
        require_shape(path, arrays, name, ("steps", 2))
    strain, stress = arrays[strain_name], arrays[stress_name]
    last = f"a{len(arrays) - 1}"
    require_shape(path, arrays, last, ())
    steps = _steps(path, last, float(arrays[last]), len(strain))
    require_few(path, len(strain) // steps)
    for begin in range(0, len(strain) - steps + 1, steps):
        yield strain[begin : begin + steps], stress[begin : begin + steps]


def _test(
    path: Path, number: int, strain: Floats, stress: Floats, settings: ImportSettings
) -> LaboratoryTest:
    source = f"{path}, path {number}"
    name = f"{path.stem}-{number}"
    if strain.shape[1] == 1:
        lateral = {"radial_stress": np.zeros(len(stress))}
        arrays = {"axial_strain": strain[:, 0], "axial_stress": stress[:, 0], **lateral}
        return laboratory_test_from(Table.of_arrays(source, arrays, {}), settings, name, "uniaxial")
    volumetric, deviatoric = strain.T
    mean, q = stress.T
    arrays = {
        "volumetric_strain": volumetric,
        "deviatoric_strain": deviatoric,
        "mean_stress": mean,
        "deviatoric_stress": q,
    }
    return laboratory_test_from(Table.of_arrays(source, arrays, {}), settings, name)
