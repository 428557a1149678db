"""Laws of safetensors files from outside: the header is believed in nothing."""

import json
from pathlib import Path

import pytest
import torch

from granbench.baselines.training.tensor_files import read_tensors, write_tensors
from granbench.errors import ModelError

TENSORS = {"a": torch.arange(6.0).reshape(2, 3), "b": torch.zeros((), dtype=torch.float64)}


def with_header(path: Path, header: object, values: bytes = bytes(32)) -> Path:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + values)
    return path


def tensor(shape: object = (8,), offsets: object = (0, 32), dtype: object = "F32") -> dict:
    return {"dtype": dtype, "shape": shape, "data_offsets": offsets}


DAMAGED: dict[str, object] = {
    "a list": [],
    "null": None,
    "not JSON": b"{",
    "deep": b'{"a":' + b"[" * 5_000 + b"]" * 5_000 + b"}",
    "digits": b'{"a": ' + b"9" * 5_000 + b"}",
    "name twice": b'{"a": {}, "a": {}}',
    "no offsets": {"a": {"dtype": "F32", "shape": [8]}},
    "tensor as a number": {"a": 1},
    "unknown type": {"a": tensor(dtype="F128")},
    "type as a list": {"a": tensor(dtype=["F32"])},
    "negative length": {"a": tensor(shape=[-8])},
    "length with a point": {"a": tensor(shape=[8.0])},
    "endless": {"a": tensor(shape=[2**62, 0], offsets=[0, 0])},
    "larger than its bytes": {"a": tensor(shape=[10**6, 10**6])},
    "overlapping": {"a": tensor((4,), (0, 16)), "b": tensor((4,), (8, 24))},
    "beyond the file": {"a": tensor((16,), (0, 64))},
    "bytes left over": {"a": tensor((4,), (0, 16))},
    "a gap": {"a": tensor((4,), (0, 16)), "b": tensor((3,), (20, 32))},
    "backwards": {"a": tensor((8,), (32, 0))},
    "metadata as a number": {"__metadata__": 3, "a": tensor()},
    "metadata not text": {"__metadata__": {"description": 3}, "a": tensor()},
    "description not JSON": {"__metadata__": {"description": "["}, "a": tensor()},
    "description deep": {"__metadata__": {"description": "[" * 5_000}, "a": tensor()},
    "too many tensors": {f"t{n}": tensor((0,), (0, 0)) for n in range(20_000)},
}


@pytest.mark.parametrize("case", DAMAGED)
def test_damaged_header_is_one_sentence(case: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"^\S*a\.safetensors.*copy the file again$") as caught:
        read_tensors(with_header(tmp_path / "a.safetensors", DAMAGED[case]))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("length", [2**63, 10**9, 60])
def test_length_of_the_header_is_checked(length: int, tmp_path: Path) -> None:
    file = tmp_path / "a.safetensors"
    file.write_bytes(length.to_bytes(8, "little") + b"{}" + bytes(20))
    with pytest.raises(ModelError, match="header"):
        read_tensors(file)


def test_written_tensors_are_read_back(tmp_path: Path) -> None:
    about = {"losses": [1.0, 0.5], "seed": 3}
    write_tensors(tmp_path / "a.safetensors", TENSORS, about)
    found, description = read_tensors(tmp_path / "a.safetensors")
    assert description == about
    assert all(torch.equal(found[name], value) for name, value in TENSORS.items())
