"""A trained model on disk: `model.safetensors` with its weights, `model.json` about them."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, StrictInt, StrictStr, TypeAdapter, ValidationError
from torch import Tensor, nn

from granbench.baselines.training.tensor_files import read_tensors, write_tensors
from granbench.cells.baseline import DESCRIPTION_FILE
from granbench.errors import ModelError
from granbench.files.json_reading import read_json_object, shortened
from granbench.files.validation import first_fault
from granbench.files.whole_file import whole_file

WEIGHTS_FILE = "model.safetensors"


@dataclass(frozen=True)
class ModelDescription:
    """The content of `model.json`.

    Parameters
    ----------
    baseline : name under which the architecture is registered
    configuration : of the architecture
    parameters : number of trainable parameters
    training : dataset, seed, recipe, losses, duration and versions
    weights_sha256 : of the bytes of `model.safetensors`
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    baseline: StrictStr
    configuration: dict[str, Any]
    parameters: StrictInt
    training: dict[str, Any]
    weights_sha256: StrictStr = ""


def write_model(folder: Path, weights: Mapping[str, Tensor], description: ModelDescription) -> Path:
    """Write both files, each whole or not at all; the description comes last.

    Returns
    -------
    folder

    Raises
    ------
    ModelError
        If the folder cannot be written or is full.
    """
    write_tensors(folder / WEIGHTS_FILE, weights)
    sealed = asdict(description) | {"weights_sha256": _digest(folder / WEIGHTS_FILE)}
    with whole_file(folder / DESCRIPTION_FILE, ModelError) as partial:
        partial.write_text(json.dumps(sealed, indent=2) + "\n")
    return folder


def read_description(folder: Path) -> ModelDescription:
    """The content of `model.json` in the folder of a trained model; the weights are not read.

    Raises
    ------
    ModelError
        If the file is missing or damaged.
    """
    path = folder / DESCRIPTION_FILE
    if folder.is_dir() and not path.exists():
        raise ModelError(f"{folder}: has no {DESCRIPTION_FILE}; give the folder of a trained model")
    content = read_json_object(path, ModelError, remedy=_REMEDY)
    try:
        return _DESCRIPTION.validate_python(content)
    except ValidationError as error:
        raise ModelError(f"{path}: is damaged ({first_fault(error)}); {_REMEDY}") from error


_DESCRIPTION = TypeAdapter(ModelDescription)
_REMEDY = "train the model again or copy the file again"


def read_model(folder: Path) -> tuple[ModelDescription, dict[str, Tensor]]:
    """Description and weights of a trained model.

    Raises
    ------
    ModelError
        If a file is missing or damaged, or the two do not belong together.
    """
    description = read_description(folder)
    weights, _ = read_tensors(folder / WEIGHTS_FILE)
    if _digest(folder / WEIGHTS_FILE) != description.weights_sha256:
        raise ModelError(
            f"{folder / WEIGHTS_FILE}: its SHA-256 differs from that in {DESCRIPTION_FILE}; train "
            "the model again or copy both files again"
        )
    return description, weights


def load_weights(module: nn.Module, weights: Mapping[str, Tensor], source: Path) -> None:
    """Put weights into a module that was built from the same description.

    Raises
    ------
    ModelError
        If a tensor is missing, unknown or of another shape.
    """
    for name, weight in weights.items():
        if not weight.dtype.is_floating_point or not bool(weight.isfinite().all()):
            raise ModelError(
                f"{source / WEIGHTS_FILE}: tensor {shortened(name)} has values that are not finite "
                "numbers; train the model again"
            )
    try:
        module.load_state_dict(dict(weights))
    except RuntimeError as error:
        first = str(error).strip().splitlines()[-1].strip()
        raise ModelError(
            f"{source / WEIGHTS_FILE}: does not fit the architecture in {DESCRIPTION_FILE} "
            f"({first}); copy both files again"
        ) from error


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
