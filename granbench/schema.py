"""The dataset schema: names, dimensions and units of a stress-strain record, and their check.

Stress and strain are compression positive; strain is cumulative (logarithmic in particle data)
and zero at step 0, where the stress is known. Directions of a `principal` record: 11 axial
(major, prescribed), 22 intermediate, 33 minor.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from granbench.errors import ConfigurationError, DatasetError
from granbench.tensors import component_order

CONVENTIONS = (
    "compression positive; SI units; strain is logarithmic and cumulative from step 0; "
    "11 axial (prescribed), 22 intermediate, 33 minor"
)
SPLIT_PATTERN = re.compile(r"train|validation|test|ood-[a-z0-9-]+")
VALUES_PER_BLOCK = 4_000_000
"""Values read at a time where a whole variable is walked: 16 MB of float32."""


@dataclass(frozen=True)
class VariableSpec:
    """What the schema asks of one variable or coordinate.

    Parameters
    ----------
    dims : dimension names, in order
    units : SI units, "1" where dimensionless, "" for a label
    long_name : what it is, for axis labels
    dtype : type in files, a NumPy name or "str"
    required : whether every dataset has it
    nullable : whether NaN is a value (what does not apply to a path)
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    dtype: str = "float32"
    required: bool = False
    nullable: bool = False

    @property
    def kind(self) -> str:
        """What its values are, in a word that an error message can use."""
        return {"str": "text", "int64": "integer"}.get(self.dtype, "floating")


_COMPONENTS = ("path", "step", "component")
_SERIES = ("path", "step")
_PATH = ("path",)


def _scalar(units: str, long_name: str, *, nullable: bool = False) -> VariableSpec:
    return VariableSpec(_PATH, units, long_name, "float64", nullable=nullable)


def _label(long_name: str, *, required: bool = False) -> VariableSpec:
    return VariableSpec(_PATH, "", long_name, "str", required)


def _count(long_name: str, *, required: bool = False) -> VariableSpec:
    return VariableSpec(_PATH, "1", long_name, "int64", required)


SCHEMA: dict[str, VariableSpec] = {
    "strain": VariableSpec(_COMPONENTS, "1", "strain, compression positive", required=True),
    "stress": VariableSpec(_COMPONENTS, "Pa", "stress, compression positive", required=True),
    "void_ratio": VariableSpec(_SERIES, "1", "void ratio"),
    "coordination_number": VariableSpec(_SERIES, "1", "mean contacts per grain"),
    "inertial_number": VariableSpec(_SERIES, "1", "inertial number (Eq 2.6)"),
    "servo_error": VariableSpec(_SERIES, "1", "relative error of the controlled stress"),
    "stress_ratio_error": VariableSpec(
        _SERIES, "1", "error of the intermediate stress ratio", nullable=True
    ),
    "shear_stress": VariableSpec(
        ("path", "step", "shear_component"), "Pa", "shear stress, compression positive"
    ),
    "fabric": VariableSpec(("path", "step", "fabric_component"), "1", "contact fabric tensor"),
    "path_id": _label("path", required=True),
    "specimen": _label("specimen", required=True),
    "split": _label("split, by specimen", required=True),
    "loading_family": _label("loading family", required=True),
    "programme": _label("loading programme (JSON)"),
    "grading": _label("grading"),
    "grading_kind": _label("kind of grading"),
    "grading_index": _scalar("1", "grading index I_G (Eq 2.1)"),
    "fractal_dimension": _scalar("1", "fractal exponent beta (Eq 2.3)", nullable=True),
    "d_min": _scalar("m", "smallest grain diameter"),
    "d_max": _scalar("m", "largest grain diameter"),
    "d50": _scalar("m", "median grain diameter by mass"),
    "coefficient_of_uniformity": _scalar("1", "coefficient of uniformity C_u"),
    "coefficient_of_curvature": _scalar("1", "coefficient of curvature C_c"),
    "particle_count": _count("number of grains"),
    "time_step": _scalar("s", "time step of the simulation"),
    "box_edge_ratio": _scalar("1", "box edge over largest grain diameter"),
    "preparation_friction": _scalar("1", "preparation friction mu_0"),
    "initial_void_ratio": _scalar("1", "initial void ratio e_0"),
    "initial_mean_stress": _scalar("Pa", "initial mean stress p_0"),
    "intermediate_stress_ratio": _scalar("1", "intermediate stress ratio b", nullable=True),
    "seed": _count("seed of the packing", required=True),
    "replicate": _count("0: first packing; 1: prepared again with another seed"),
    "servo_error_rms": _scalar("1", "RMS relative error of the controlled stress"),
    "stress_ratio_error_rms": _scalar(
        "1", "RMS error of the intermediate stress ratio", nullable=True
    ),
    "peak_inertial_number": _scalar("1", "largest inertial number"),
    "component": VariableSpec(("component",), "", "tensor component", "str", required=True),
    "shear_component": VariableSpec(("shear_component",), "", "shear component", "str"),
    "fabric_component": VariableSpec(("fabric_component",), "", "fabric component", "str"),
}

REQUIRED_ATTRIBUTES = (
    "dataset",
    "version",
    "generator",
    "generator_version",
    "engine",
    "engine_version",
    "configuration",
    "licence",
    "thesis_section",
    "conventions",
)


def describe(ds: xr.Dataset) -> xr.Dataset:
    """The dataset with the schema's types, and its `units` and `long_name` where they lack.

    Units that are already there are kept, right or wrong: `validate_records` judges them.
    """
    described = ds.copy()
    described.attrs.setdefault("conventions", CONVENTIONS)
    for name, spec in SCHEMA.items():
        if name not in described.variables:
            continue
        attributes = dict(described[name].attrs)
        if spec.dtype != "str" and np.can_cast(described[name].dtype, spec.dtype, "same_kind"):
            described[name] = described[name].astype(spec.dtype)
        described[name].attrs = {"units": spec.units, "long_name": spec.long_name} | attributes
    return described


def path_blocks(variable: xr.DataArray) -> Iterator[np.ndarray]:
    """The values of a variable in pieces along its first dimension, in order.

    At most about `VALUES_PER_BLOCK` values are in memory at a time, so that a file larger
    than memory can be checked and hashed.

    Raises
    ------
    DatasetError
        If the file behind it is damaged there.
    """
    per_row = max(1, int(np.prod(variable.shape[1:])))
    rows = max(1, VALUES_PER_BLOCK // per_row)
    pieces = [slice(start, start + rows) for start in range(0, (variable.shape or (1,))[0], rows)]
    for piece in pieces:
        try:
            # A fresh selection leaves xarray's cache of the whole variable empty.
            values = np.asarray(variable[piece].values if variable.ndim else variable.values)
        except (OSError, RuntimeError) as error:
            raise DatasetError(
                f"{variable.encoding.get('source', 'the dataset')}: variable {variable.name!r} "
                f"cannot be read ({error}); the file is damaged, fetch it again"
            ) from error
        yield values


def validate_records(ds: xr.Dataset, source: str = "the dataset") -> None:
    """Check a dataset against the schema.

    Parameters
    ----------
    ds : stress-strain records
    source : file name for the error text

    Raises
    ------
    DatasetError
        Naming the file, the variable and the remedy: a missing variable, wrong dimensions,
        units or type, a value that is not finite, strain that does not begin at zero, two
        paths of one name, an unknown split, a specimen in two splits, a missing attribute.
    """
    for name, spec in SCHEMA.items():
        if name in ds.variables:
            _check_form(ds[name], name, spec, source)
        elif spec.required:
            raise DatasetError(
                f"{source}: variable {name!r} ({spec.long_name}) is missing; "
                f"add it with dimensions {_tuple(spec.dims)}"
                + (f" and units {spec.units!r}" if spec.units else "")
            )
    for name in map(str, ds.variables):
        if name not in SCHEMA and not {"units", "long_name"} <= set(ds[name].attrs):
            raise DatasetError(
                f"{source}: variable {name!r} is not part of the schema and has no units and "
                "long_name; give it both attributes or remove it"
            )
    if missing := [name for name in REQUIRED_ATTRIBUTES if name not in ds.attrs]:
        raise DatasetError(
            f"{source}: global attribute {missing[0]!r} is missing; set it before writing "
            f"(a dataset needs {', '.join(REQUIRED_ATTRIBUTES)})"
        )
    _check_components(ds, source)
    _check_labels(ds, source)
    _check_values(ds, source)


def _tuple(dims: tuple[object, ...]) -> str:
    return f"({', '.join(map(str, dims))})"


def _check_form(variable: xr.DataArray, name: str, spec: VariableSpec, source: str) -> None:
    if variable.dims != spec.dims:
        raise DatasetError(
            f"{source}: variable {name!r} has dimensions {_tuple(variable.dims)} instead of "
            f"{_tuple(spec.dims)}; transpose or rename its dimensions"
        )
    found = {"f": "floating", "i": "integer", "u": "integer"}.get(variable.dtype.kind, "text")
    if found != spec.kind:
        raise DatasetError(
            f"{source}: variable {name!r} holds {found} values instead of {spec.kind} ones; "
            f"store it as {spec.dtype}"
        )
    units = variable.attrs.get("units", "")
    if units != spec.units:
        raise DatasetError(
            f"{source}: variable {name!r} has units {units!r} instead of {spec.units!r}; "
            f"convert its values and set its attribute 'units' to {spec.units!r}"
        )


def _check_components(ds: xr.Dataset, source: str) -> None:
    labels = tuple(str(label) for label in ds["component"].values)
    try:
        component_order(labels)
    except ConfigurationError as error:
        raise DatasetError(f"{source}: variable 'component': {error}") from error


def _check_labels(ds: xr.Dataset, source: str) -> None:
    if ds.sizes["path"] == 0 or ds.sizes["step"] < 2:
        raise DatasetError(
            f"{source}: dimensions path and step have {ds.sizes['path']} and {ds.sizes['step']} "
            "entries; a dataset needs at least one path of two steps"
        )
    identifiers, first_rows = np.unique(ds["path_id"].values.astype(str), return_index=True)
    if len(identifiers) < ds.sizes["path"]:
        repeated = min(set(range(ds.sizes["path"])) - set(first_rows.tolist()))
        raise DatasetError(
            f"{source}: variable 'path_id' holds {ds['path_id'].values[repeated]!r} more than "
            "once; give every path a name of its own"
        )
    split_of: dict[str, str] = {}
    for specimen, split in zip(ds["specimen"].values, ds["split"].values, strict=True):
        if not SPLIT_PATTERN.fullmatch(str(split)):
            raise DatasetError(
                f"{source}: variable 'split' holds {str(split)!r}; use train, validation, test "
                "or ood-NAME"
            )
        if split_of.setdefault(str(specimen), str(split)) != str(split):
            raise DatasetError(
                f"{source}: variable 'split' puts specimen {str(specimen)!r} in both "
                f"{split_of[str(specimen)]!r} and {str(split)!r}; split by specimen"
            )


def _check_values(ds: xr.Dataset, source: str) -> None:
    for name in map(str, ds.variables):
        spec = SCHEMA.get(name)
        if spec is None or spec.nullable or ds[name].dtype.kind != "f":
            continue
        row = 0
        for block in path_blocks(ds[name]):
            finite = np.isfinite(block).reshape(len(block), -1).all(axis=1)
            if not finite.all():
                path = ds["path_id"].values[row + int(np.argmin(finite))]
                raise DatasetError(
                    f"{source}: variable {name!r} has values that are NaN or infinite in "
                    f"path {str(path)!r}; remove the path or mend its source"
                )
            row += len(block)
    start = np.abs(ds["strain"].isel(step=0).values).max(axis=-1)
    if (start > 0.0).any():
        path = ds["path_id"].values[int(np.argmax(start > 0.0))]
        raise DatasetError(
            f"{source}: variable 'strain' is not zero at step 0 of path {str(path)!r}; measure "
            "strain from the state that step 0 records"
        )
