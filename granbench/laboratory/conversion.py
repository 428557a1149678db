"""Laboratory tests as stress-strain records and back, so that they are scored like any dataset."""

import json
from collections.abc import Sequence

import numpy as np
import xarray as xr

from granbench import __version__
from granbench.errors import DatasetError
from granbench.laboratory.laboratory_test import KINDS, LaboratoryTest, apparent_kind
from granbench.records import describe
from granbench.tensors import COMPONENT_ORDERS

LOADING_FAMILIES = {"triaxial-drained": "constant-sigma3"}
"""Name of the same loading in particle datasets, by kind of test."""

STEPS = 201


def to_records(
    tests: Sequence[LaboratoryTest],
    *,
    left_out: Sequence[str] = (),
    name: str = "laboratory",
    licence: str = "not stated",
    steps: int = STEPS,
) -> xr.Dataset:
    """The tests as one dataset, ready for `granbench.records.write_records`.

    Parameters
    ----------
    tests : with different names
    left_out : names of the tests that make the split `test`; the others are `train`
    name : of the dataset
    licence : of the data
    steps : of every path; the tests are interpolated linearly along their curve to that number, or
        to more if one of them has more reversals, since every reversal is kept

    Raises
    ------
    DatasetError
        If there is no test, two have one name, or a lateral strain was not measured.
    """
    names = [test.name for test in tests]
    if not tests or len(set(names)) < len(names):
        raise DatasetError(
            f"{len(tests)} tests with the names {', '.join(names) or '(none)'}: a dataset needs at "
            "least one test, and different names"
        )
    if unknown := [test for test in tests if not test.lateral_strain_known]:
        raise DatasetError(
            f"{unknown[0].source}: the lateral strain is not known, so the test is not a complete "
            "record; add the volumetric strain or the void ratio"
        )
    if unknown := [test for test in tests if not test.lateral_stress_known]:
        raise DatasetError(
            f"{unknown[0].source}: the lateral stress is not known, so the test is not a complete "
            "record; leave it out"
        )
    steps = max(steps, *(test.reversals for test in tests))
    even = [test.resampled(steps) for test in tests]
    series = ("path", "step")
    variables: dict[str, tuple[tuple[str, ...], object]] = {
        "strain": ((*series, "component"), np.stack([test.strain for test in even])),
        "stress": ((*series, "component"), np.stack([test.stress for test in even])),
    }
    coordinates: dict[str, tuple[str, object]] = {
        "component": ("component", list(COMPONENT_ORDERS["principal"])),
        "path_id": ("path", names),
        "specimen": ("path", names),
        "split": ("path", ["test" if name in left_out else "train" for name in names]),
        "loading_family": ("path", [LOADING_FAMILIES.get(t.kind, t.kind) for t in tests]),
        "initial_mean_stress": ("path", [test.initial_mean_stress for test in tests]),
        "seed": ("path", np.zeros(len(tests), dtype=np.int64)),
    }
    void_ratios = [test.void_ratio for test in even if test.void_ratio is not None]
    if len(void_ratios) == len(even):
        variables["void_ratio"] = (series, np.stack(void_ratios))
        coordinates["initial_void_ratio"] = ("path", [ratio[0] for ratio in void_ratios])
    sources = {test.name: {"source": test.source, "kind": test.kind} for test in tests}
    attributes = {
        "dataset": name,
        "version": "0.0.0",
        "generator": "granbench.laboratory",
        "generator_version": __version__,
        "engine": "laboratory",
        "engine_version": "",
        "configuration": json.dumps({"steps": steps, "tests": sources}),
        "licence": licence,
        "thesis_section": "",
    }
    return describe(xr.Dataset(variables, coordinates, attributes))


def from_records(records: xr.Dataset, source: str) -> list[LaboratoryTest]:
    """Every path of records in the `principal` order as a test.

    Parameters
    ----------
    records : follow the schema
    source : file, for error texts

    Raises
    ------
    DatasetError
        If the components are others, or a path has too few steps.
    """
    components = tuple(str(label) for label in records["component"].values)
    if components != COMPONENT_ORDERS["principal"]:
        raise DatasetError(
            f"{source}: has the components {', '.join(components)}, but a laboratory test has "
            "principal components; give a file with the components 11, 22, 33"
        )
    kinds = {family: kind for kind, family in LOADING_FAMILIES.items()}
    tests = []
    for path in range(records.sizes["path"]):
        member = records.isel(path=path)
        family, name = str(member["loading_family"].values), str(member["path_id"].values)
        kind = kinds.get(family, family)
        strain, stress = (member[v].values.astype(np.float64) for v in ("strain", "stress"))
        void_ratio = (
            member["void_ratio"].values.astype(np.float64) if "void_ratio" in member else None
        )
        tests.append(
            LaboratoryTest(
                name,
                f"{source}, path {name}",
                kind if kind in KINDS else apparent_kind(strain, stress),
                strain,
                stress,
                void_ratio,
            )
        )
    return tests
