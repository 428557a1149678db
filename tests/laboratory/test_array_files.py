"""Files of arrays (.npz): what is damaged, lies or makes no test is one sentence."""

import io
import zipfile

import numpy as np
import pytest

from granbench.errors import DatasetError
from granbench.laboratory import ImportSettings, read_tests
from granbench.laboratory.array_file import read_arrays

UNITS = ImportSettings(units={"stress": "kPa", "strain": "-"})
GRAIN_KEYS = np.array(["e_x", "e_y", "e_z", "n", "p", "q"])
GRAINS = {"data": np.full((2, 6, 9), 0.4), "keys": GRAIN_KEYS, "params": np.zeros((2, 4))}
PATHS = {
    name: np.full((9, 2, 2), 0.5) for name in ("strain_k", "strain_k1", "stress_k", "stress_k1")
}
SOIL = {"a0": np.zeros((9, 1, 2)), "a1": np.ones((9, 1, 2)), "a2": np.full((9, 1, 1), 1600.0)}
NICE = {"a0": np.ones((9, 2)), "a1": np.ones((9, 2)), "a2": np.ones((9, 2)), "a3": np.array(1.0)}


@pytest.mark.parametrize(
    ("arrays", "named"),
    [
        (GRAINS | {"data": np.zeros((6, 9))}, "'data'"),
        (GRAINS | {"data": np.zeros((2, 6, 0))}, "'data'"),
        (GRAINS | {"data": np.full((2, 6, 9), "a")}, "'data'"),
        (GRAINS | {"keys": GRAIN_KEYS[:5]}, "'keys'"),
        (
            GRAINS | {"data": np.where(GRAIN_KEYS[:, None] == "n", 1.0, GRAINS["data"])},
            "run 1, row 1: column 'void_ratio'",
        ),
        (GRAINS | {"data": np.zeros((20_000, 6, 2))}, "20,000 tests"),
        (PATHS | {"stress_k": np.ones((9, 2, 1))}, "'stress_k'"),
        (PATHS | {"strain_k": np.ones(9)}, "'strain_k'"),
        (PATHS | {"strain_k": np.ones((9, 2, 2), complex)}, "'strain_k'"),
        (PATHS | {"stop": np.array([9, 0])}, "'stop' gives a path 0 steps"),
        (PATHS | {"stop": np.array([9, 10])}, "'stop' gives a path 10 steps"),
        (PATHS | {"stop": np.array([9, np.nan])}, "'stop' gives a path nan steps"),
        (PATHS | {"stop": np.array([9])}, "'stop'"),
        (NICE | {"a4": np.array(0)}, "'a4' gives a path 0 steps"),
        (NICE | {"a4": np.array(-3)}, "'a4' gives a path -3 steps"),
        (SOIL | {"a2": np.zeros((9, 1, 1))}, "density of 0"),
        (SOIL | {"a2": np.full((9, 1, 1), np.nan)}, "density of nan"),
        (SOIL | {"a1": np.ones((9, 1, 5))}, "'a1'"),
        (SOIL | {"a0": np.zeros((0, 1, 2))}, "'a0'"),
    ],
)
def test_arrays_that_make_no_test_are_named(arrays, named, tmp_path) -> None:
    np.savez(tmp_path / "x.npz", **arrays)
    with pytest.raises(DatasetError, match=named) as refusal:
        read_tests(tmp_path / "x.npz", UNITS)
    assert "x.npz" in str(refusal.value) and "\n" not in str(refusal.value)


def header(kind: str, shape: str) -> bytes:
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (header("<f8", "(10**12,)"), "header"),
        (header("<f8", "(1000000000000,)"), "declares"),
        (header("<f8", "(-1, -1)") + b"8" * 8, "declares"),
        (header("|O", "(1,)") + b"c", "type object"),
        (header("<f8", "(")[:40], "header|cannot be read"),
        (b"no array", "header"),
        (b"", "header|cannot be read"),
    ],
)
def test_false_array_headers_are_refused_before_anything_is_allocated(
    content, named, tmp_path
) -> None:
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        archive.writestr("data.npy", content)
    with pytest.raises(DatasetError, match=named):
        read_arrays(tmp_path / "x.npz")


def test_damaged_and_protected_archives_are_refused(tmp_path) -> None:
    path = tmp_path / "x.npz"
    np.savez_compressed(path, data=np.random.default_rng(0).random(1000))
    whole = path.read_bytes()
    spoilt = bytearray(whole)
    spoilt[200:240] = bytes(40)
    path.write_bytes(spoilt)
    with pytest.raises(DatasetError, match=r"x\.npz"):
        read_arrays(path)
    for at, named in ((8, "password"), (10, "method")):
        central = whole.index(b"PK\1\2")
        spoilt = bytearray(whole)
        spoilt[central + at] = {8: 1, 10: 97}[at]
        path.write_bytes(spoilt)
        with pytest.raises(DatasetError, match=named):
            read_arrays(path)


def test_arrays_come_as_numpy_saves_them(tmp_path) -> None:
    arrays = {
        "c": np.arange(6.0).reshape(2, 3), "f": np.asfortranarray(np.arange(6).reshape(2, 3)),
        "zero": np.array(3), "words": np.array(["a", "bc"]), "none": np.empty((0, 2)),
    }  # fmt: skip
    held = io.BytesIO()
    np.savez(held, **arrays)
    (tmp_path / "x.npz").write_bytes(held.getvalue())
    found = read_arrays(tmp_path / "x.npz")
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)
