"""Tensors with a description, in safetensors: reading a file never executes code."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from granbench.errors import ModelError
from granbench.whole_file import cannot_write, whole_file

_DESCRIPTION = "description"


def write_tensors(path: Path, tensors: Mapping[str, Tensor], description: Any = None) -> None:
    """Write tensors and a JSON description in one file, whole or not at all.

    Parameters
    ----------
    path : file to write; an existing one is replaced
    tensors : by name, on any device
    description : anything that JSON can hold

    Raises
    ------
    ModelError
        If the folder cannot be written or is full.
    """
    stored = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    with whole_file(path, ModelError, SafetensorError) as partial:
        save_file(stored, partial, metadata={_DESCRIPTION: json.dumps(description)})


def digest_of(tensors: Mapping[str, Tensor], description: Any) -> str:
    """SHA-256 over names, types, shapes and bytes of tensors, and over a JSON description."""
    digest = hashlib.sha256(json.dumps(description, sort_keys=True).encode())
    for name in sorted(tensors):
        tensor = tensors[name].detach().cpu().contiguous()
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}".encode())
        digest.update(tensor.reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()


def unwritable(path: Path, error: Exception) -> ModelError:
    """The error for a file that could not be written."""
    return ModelError(cannot_write(path, error))


def read_tensors(path: Path) -> tuple[dict[str, Tensor], Any]:
    """Tensors by name, on the CPU, and the description.

    Raises
    ------
    ModelError
        If the file is missing, damaged or not a safetensors file.
    """
    if not path.is_file():
        raise ModelError(f"{path}: there is no such file; check the name or train the model again")
    try:
        with safe_open(path, framework="pt") as file:
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            description = json.loads((file.metadata() or {}).get(_DESCRIPTION, "null"))
    except (OSError, SafetensorError, ValueError) as error:
        raise ModelError(
            f"{path}: is damaged or no safetensors file ({error}); train the model again or "
            "copy the file anew"
        ) from error
    return tensors, description
