"""Tensors with a description, in safetensors: reading a file never executes code."""

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from granbench.errors import ModelError
from granbench.files.json_reading import parse_json, shortened
from granbench.files.whole_file import cannot_write, whole_file

LARGEST_HEADER = 4_000_000
"""Bytes of the header of a file; that of a checkpoint has some thousands."""
MOST_TENSORS = 10_000
ITEM_BYTES = {"BOOL": 1, "U8": 1, "I8": 1, "I16": 2, "I32": 4, "I64": 8} | {
    "F16": 2, "BF16": 2, "F32": 4, "F64": 8,
}  # fmt: skip
"""Bytes of one value, by the format's name of its type."""

_DESCRIPTION = "description"
_REMEDY = "train the model again or copy the file again"


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
    _check_header(path)
    try:
        with safe_open(path, framework="pt") as file:
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            metadata = file.metadata() or {}
    except (OSError, SafetensorError, ValueError, RuntimeError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise ModelError(
            f"{path}: is damaged or not a safetensors file ({reason}); {_REMEDY}"
        ) from error
    text = metadata.get(_DESCRIPTION, "null")
    return tensors, parse_json(text, f"{path} (its description)", ModelError, remedy=_REMEDY)


def _check_header(path: Path) -> None:
    """Refuse a file whose header declares other tensors than its bytes hold, before any is read."""
    if not path.is_file():
        raise ModelError(f"{path}: there is no such file; check the name or train the model again")
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            length = int.from_bytes(file.read(8), "little")
            if size < 10 or length > min(LARGEST_HEADER, size - 8):
                raise _damaged(path, f"its header would have {length} of {size} bytes")
            header = parse_json(
                file.read(length), f"{path} (its header)", ModelError, remedy=_REMEDY
            )
    except OSError as error:
        raise ModelError(
            f"{path}: cannot be read ({error.strerror or error}); {_REMEDY}"
        ) from error
    if not isinstance(header, dict):
        raise _damaged(path, "its header is not an object")
    metadata = header.pop("__metadata__", {})
    if not isinstance(metadata, dict) or not all(isinstance(v, str) for v in metadata.values()):
        raise _damaged(path, "its metadata is not text by name")
    if len(header) > MOST_TENSORS:
        raise _damaged(path, f"it declares {len(header)} tensors, more than {MOST_TENSORS}")
    end = 0
    for name, tensor in sorted(header.items(), key=lambda item: _offsets(item[1], path)):
        begin, stop = _offsets(tensor, path)
        shape, bytes_each = tensor.get("shape"), ITEM_BYTES.get(str(tensor.get("dtype")))
        if bytes_each is None:
            raise _damaged(path, f"tensor {shortened(name)} is of an unknown type")
        if (
            not isinstance(shape, list)
            or len(shape) > 8
            or not all(type(length) is int and 0 <= length <= size for length in shape)
        ):
            raise _damaged(path, f"tensor {shortened(name)} has an impossible shape")
        if begin != end or stop - begin != bytes_each * math.prod(shape):
            raise _damaged(path, f"the bytes of tensor {shortened(name)} are not its own")
        end = stop
    if end != size - 8 - length:
        raise _damaged(path, "its tensors do not fill it")


def _offsets(tensor: Any, path: Path) -> tuple[int, int]:
    offsets = tensor.get("data_offsets") if isinstance(tensor, dict) else None
    if (
        not isinstance(offsets, list)
        or len(offsets) != 2
        or not all(type(offset) is int and offset >= 0 for offset in offsets)
    ):
        raise _damaged(path, "a tensor does not say where its bytes are")
    return offsets[0], offsets[1]


def _damaged(path: Path, reason: str) -> ModelError:
    return ModelError(f"{path}: is damaged or not a safetensors file ({reason}); {_REMEDY}")
