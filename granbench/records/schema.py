"""The dataset schema: names, dimensions, units and ranges of variables of stress-strain records.

Stress and strain are compression positive; strain is cumulative (logarithmic in particle data)
and zero at step 0, where the stress is known. Directions of a `principal` record: 11 axial
(major, prescribed), 22 intermediate, 33 minor.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from granbench.errors import DatasetError
from granbench.tensors import COMPONENT_ORDERS

CONVENTIONS = (
    "compression positive; SI units; strain is logarithmic and cumulative from step 0; "
    "11 axial (prescribed), 22 intermediate, 33 minor"
)
"""Text of the attribute `conventions` where a dataset does not have its own."""
PLANE_STRAIN_CONVENTIONS = (
    "compression positive; SI units; strain is small and cumulative from step 0; shear "
    "components are tensor components; plane strain where the model is three-dimensional"
)
SPLIT_PATTERN = re.compile(r"train|validation|test|ood-[a-z0-9-]+")
VALUES_PER_BLOCK = 4_000_000
"""Number of values that are read at a time from a whole variable: 16 MB of float32."""


@dataclass(frozen=True)
class Range:
    """The range of a quantity.

    Parameters
    ----------
    minimum, maximum : in the units of the variable
    above : whether the minimum itself is out of range; the maximum is always in range
    """

    minimum: float = -math.inf
    maximum: float = math.inf
    above: bool = False

    def holds(self, values: np.ndarray) -> np.ndarray:
        """Whether each value, of any shape, is in the range; NaN is not."""
        high_enough = values > self.minimum if self.above else values >= self.minimum
        return high_enough & (values <= self.maximum)

    def __str__(self) -> str:
        if self.maximum < math.inf:
            return f"from {self.minimum:g} to {self.maximum:g}"
        return f"{'above' if self.above else 'at least'} {self.minimum:g}"


ANY = Range()
NOT_NEGATIVE = Range(0.0)
POSITIVE = Range(0.0, above=True)


@dataclass(frozen=True)
class VariableSpec:
    """The entry of the schema for one variable or coordinate.

    Parameters
    ----------
    dims : dimension names, in order
    units : SI units, "1" where dimensionless, "" for a label
    long_name : name for axis labels
    dtype : type in files, a NumPy name or "str"
    required : whether every dataset must have it
    nullable : whether NaN is allowed, for a quantity that does not apply to a path
    limits : range of the values
    positive_with : variables; if the dataset has one of them, zero is out of range as well
    not_below : variable that must not be larger than this one, path by path
    internal : whether it is an internal variable of the material, which a model may have as state
        and predict
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    dtype: str = "float32"
    required: bool = False
    nullable: bool = False
    limits: Range = ANY
    positive_with: tuple[str, ...] = ()
    not_below: str | None = None
    internal: bool = False

    @property
    def kind(self) -> str:
        """Kind of its values, a word for error messages."""
        return {"str": "text", "int64": "integer"}.get(self.dtype, "floating")


_COMPONENTS = ("path", "step", "component")
_SERIES = ("path", "step")
_PATH = ("path",)


def _scalar(
    units: str, long_name: str, limits: Range = ANY, *, nullable: bool = False
) -> VariableSpec:
    return VariableSpec(_PATH, units, long_name, "float64", nullable=nullable, limits=limits)


def _internal(units: str, long_name: str, limits: Range = ANY) -> VariableSpec:
    return VariableSpec(_SERIES, units, long_name, limits=limits, internal=True)


def _label(long_name: str, *, required: bool = False) -> VariableSpec:
    return VariableSpec(_PATH, "", long_name, "str", required)


def _count(long_name: str, limits: Range = ANY, *, required: bool = False) -> VariableSpec:
    return VariableSpec(_PATH, "1", long_name, "int64", required, limits=limits)


SCHEMA: dict[str, VariableSpec] = {
    "strain": VariableSpec(_COMPONENTS, "1", "strain, compression positive", required=True),
    "stress": VariableSpec(_COMPONENTS, "Pa", "stress, compression positive", required=True),
    "void_ratio": _internal("1", "void ratio", POSITIVE),
    "out_of_plane_stress": _internal("Pa", "stress zz in plane strain, compression positive"),
    **{
        f"plastic_strain_{label}": _internal("1", f"plastic strain {label}, compression positive")
        for label in COMPONENT_ORDERS["full"]
    },
    "plastic_strain_norm": _internal("1", "length of the plastic strain path", NOT_NEGATIVE),
    "plastic_volumetric_strain": _internal("1", "plastic volumetric strain"),
    "plastic_deviatoric_strain": _internal("1", "plastic deviatoric strain"),
    "hardening": _internal("1", "hardening parameter H"),
    "initial_yield_pressure": _internal("Pa", "size of the first yield surface, p_x0", POSITIVE),
    "reference_void_ratio": _internal("1", "void ratio that strains count from", POSITIVE),
    "tangent": VariableSpec(
        (*_COMPONENTS, "strain_component"),
        "Pa",
        "d stress / d strain of the step that ends here; at step 0 of a zero increment",
    ),
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
    "d_min": _scalar("m", "smallest grain diameter", NOT_NEGATIVE),
    "d_max": VariableSpec(
        _PATH, "m", "largest grain diameter", "float64", limits=POSITIVE, not_below="d_min"
    ),
    "d50": _scalar("m", "median grain diameter by mass", POSITIVE),
    "coefficient_of_uniformity": _scalar("1", "coefficient of uniformity C_u", Range(1.0)),
    "coefficient_of_curvature": _scalar("1", "coefficient of curvature C_c"),
    "particle_count": _count("number of grains", Range(1.0)),
    "time_step": _scalar("s", "time step of the simulation", POSITIVE),
    "box_edge_ratio": _scalar("1", "box edge over largest grain diameter"),
    "preparation_friction": _scalar("1", "preparation friction mu_0", NOT_NEGATIVE),
    "initial_void_ratio": _scalar("1", "initial void ratio e_0", POSITIVE),
    # A continuum may start without stress; grains with voids between them need pressure.
    "initial_mean_stress": VariableSpec(
        _PATH,
        "Pa",
        "initial mean stress p_0",
        "float64",
        limits=NOT_NEGATIVE,
        positive_with=("void_ratio", "particle_count"),
    ),
    "intermediate_stress_ratio": _scalar(
        "1", "intermediate stress ratio b", Range(0.0, 1.0), nullable=True
    ),
    # Drawn strain paths; NaN for a path of another family.
    "strain_deviation": _scalar(
        "1", "standard deviation of the principal strains", NOT_NEGATIVE, nullable=True
    ),
    "correlation_length": _scalar(
        "1", "correlation length over the length of the path", POSITIVE, nullable=True
    ),
    "rotation_deviation": _scalar(
        "rad", "standard deviation of the principal angle", NOT_NEGATIVE, nullable=True
    ),
    "initial_angle": _scalar("rad", "principal angle at the start", nullable=True),
    "strain_amplitude": _scalar("1", "Frobenius norm of the peak strain", POSITIVE, nullable=True),
    "strain_cycles": _scalar("1", "number of strain cycles", NOT_NEGATIVE, nullable=True),
    "strain_ratio": _scalar("1", "lower over upper turning strain", nullable=True),
    "volumetric_factor": _scalar(
        "1", "factor on the volumetric part of the drawn strain", NOT_NEGATIVE
    ),
    "position_x": _scalar("m", "x of the Gauss point at the start"),
    "position_y": _scalar("m", "y of the Gauss point at the start"),
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
    "strain_component": VariableSpec(("strain_component",), "", "strain component", "str"),
}

INTERNALS = tuple(name for name, spec in SCHEMA.items() if spec.internal)
"""Names of the internal variables of a material."""

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

TEXT_ATTRIBUTES = (
    "content_sha256",
    "configuration_sha256",
    "sealed_variables",
    "ground_truth",
    "embedded_analyses",
)
"""Optional global attributes that must be text; `REQUIRED_ATTRIBUTES` must be text too."""


GROUND_TRUTH = "ground_truth"
"""Global attribute of a dataset made by a model: JSON with the model and its parameters."""


def describe(ds: xr.Dataset) -> xr.Dataset:
    """The dataset with the types of the schema, and with missing `units` and `long_name` added.

    Units that are already there are kept, even wrong ones, which `validate_records` reports.
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
    """The values of a variable in blocks along its first dimension, in order.

    About `VALUES_PER_BLOCK` values are in memory at a time, so that a file larger than memory can
    be checked and hashed.

    Raises
    ------
    DatasetError
        If the file is damaged there.
    """
    per_row = max(1, math.prod(variable.shape[1:]))
    rows = max(1, VALUES_PER_BLOCK // per_row)
    pieces = [slice(start, start + rows) for start in range(0, (variable.shape or (1,))[0], rows)]
    for piece in pieces:
        try:
            # A new selection does not fill the cache that xarray has for the whole variable.
            values = np.asarray(variable[piece].values if variable.ndim else variable.values)
        except Exception as error:  # for a damaged file the libraries raise anything
            reason = " ".join(str(error).split()) or type(error).__name__
            raise DatasetError(
                f"{variable.encoding.get('source', 'the dataset')}: variable {variable.name!r} "
                f"cannot be read ({reason}); the file is damaged, fetch it again"
            ) from error
        yield values
