"""Small changes of valid files: of bytes, JSON trees, table cells, zip members and netCDF parts."""

import contextlib
import io
import json
import random
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

NUMBERS = (0, -1, 1, 1e30, 1e-320, 5e-324, 1e308, 2**31, 2**63 - 1, 2**64, 10**23, -0.0)
TEXTS = (
    "", " ", "nan", "NaN", "inf", "-", "1e999", "1,5", "0x10", "null", "a\tb", "\x1b[2J", "\u202e",
    "é" * 50, "../../etc/passwd", "x" * 10_000, "9" * 5_000, "$\\foo$", "%s", "[", "{", "\ufeff",
)  # fmt: skip
DEEP = "[" * 2_000 + "]" * 2_000


def mutate_bytes(content: bytes, rng: random.Random) -> bytes:
    """Flip, cut, repeat or insert bytes."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 8, 64))):
        if not data:
            break
        place = rng.randrange(len(data))
        length = min(rng.choice((1, 4, 64, 1024)), len(data) - place)
        kind = rng.randrange(6)
        if kind == 0:
            data[place] ^= 1 << rng.randrange(8)
        elif kind == 1:
            data[place : place + length] = rng.randbytes(length)
        elif kind == 2:
            del data[place : place + length]
        elif kind == 3:
            data[place:place] = data[place : place + length] * rng.choice((1, 2, 50))
        elif kind == 4:
            data[place : place + length] = bytes([rng.choice((0, 255, 127))]) * length
        elif rng.random() < 0.2:
            del data[place:]
    return bytes(data)


def mutate_json(text: str, rng: random.Random) -> str:
    """Replace, remove, double or rename a part of a JSON document."""
    tree = json.loads(text)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        tree = _changed_tree(tree, rng)
    changed = json.dumps(tree)
    if rng.random() < 0.15:
        changed = changed.replace('"@deep@"', DEEP).replace('"@digits@"', "7" * 5_000)
    return changed


def _changed_tree(tree: Any, rng: random.Random) -> Any:
    places: list[tuple[Any, Any]] = []

    def walk(node: Any) -> None:
        items = node.items() if isinstance(node, dict) else enumerate(node)
        for key, value in items:
            places.append((node, key))
            if isinstance(value, dict | list):
                walk(value)

    if not isinstance(tree, dict | list):
        return _odd_value(rng)
    walk(tree)
    if not places:
        return _odd_value(rng)
    node, key = rng.choice(places)
    kind = rng.randrange(6)
    if kind == 0:
        del node[key]
    elif kind == 1 and isinstance(node, dict):
        node[rng.choice((*TEXTS, "seed", "scores"))] = node.pop(key)
    elif kind == 2 and isinstance(node, list):
        node.extend([node[key]] * rng.choice((1, 2, 100)))
    elif kind == 3 and isinstance(node[key], int | float):
        node[key] = rng.choice((-node[key], node[key] * 1e6, node[key] + 1, str(node[key])))
    else:
        node[key] = _odd_value(rng)
    return tree


def _odd_value(rng: random.Random) -> Any:
    return rng.choice(
        (
            rng.choice(NUMBERS),
            rng.choice(TEXTS),
            float("nan"),
            float("inf"),
            None,
            True,
            [],
            {},
            [[1, 2], 3],
            {"a": None},
            "@deep@",
            "@digits@",
        )
    )


def mutate_table(text: str, rng: random.Random) -> str:
    """Change cells, lines, separators and line ends of a table."""
    lines = text.splitlines()
    for _ in range(rng.choice((1, 1, 2, 5))):
        if not lines:
            break
        row = rng.randrange(len(lines))
        kind = rng.randrange(8)
        if kind == 0:
            del lines[row]
        elif kind == 1:
            lines.insert(row, rng.choice((lines[row], "", "# note", ",,,,", *TEXTS)))
        elif kind == 2:
            lines[row] = lines[row].replace(",", rng.choice((";", "\t", " ", ",,", "")))
        elif kind == 3:
            lines = lines[: row + 1]
        else:
            separator = "," if "," in lines[row] else "\t"
            cells = lines[row].split(separator)
            cells[rng.randrange(len(cells))] = str(rng.choice((*NUMBERS, *TEXTS)))
            lines[row] = separator.join(cells)
    return rng.choice(("\n", "\n", "\r\n", "\r")).join(lines) + "\n"


def mutate_zip(content: bytes, rng: random.Random) -> bytes:
    """Change one member of an archive, or its name, or leave it out."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as archive, zipfile.ZipFile(out, "w") as changed:
        names = archive.namelist()
        chosen = rng.choice(names)
        for name in names:
            member = archive.read(name)
            if name == chosen:
                kind = rng.randrange(5)
                if kind == 0:
                    continue
                if kind == 1:
                    name = rng.choice((*TEXTS[6:12], "../a", "a.npy"))
                elif kind == 2:
                    with contextlib.suppress(UnicodeDecodeError):
                        member = mutate_table(member.decode(), rng).encode()
                else:
                    member = mutate_bytes(member, rng)
            changed.writestr(name, member)
    return out.getvalue()


def mutate_netcdf(path: Path, rng: random.Random) -> None:
    """Change attributes, names, values, types and declared sizes of a netCDF file in place.

    Where the library cannot write a change to its end, the file stays as it is then: damaged.
    """
    with contextlib.suppress(RuntimeError), netCDF4.Dataset(path, "a") as file:
        for _ in range(rng.choice((1, 1, 2, 3))):
            # What netCDF itself refuses is no case; the next one is.
            with contextlib.suppress(Exception):
                rng.choice(_NETCDF_CHANGES)(file, rng)


def _attribute(file: netCDF4.Dataset, rng: random.Random) -> None:
    holder = rng.choice((file, *file.variables.values()))
    name = rng.choice(
        (
            *holder.ncattrs(),
            *("scale_factor", "add_offset", "_Encoding", "coordinates", "units", "dtype"),
            *("missing_value", "calendar", "_Unsigned", "valid_range", "ground_truth"),
        )
    )
    if rng.random() < 0.2 and name in holder.ncattrs():
        holder.delncattr(name)
        return
    old = holder.getncattr(name) if name in holder.ncattrs() else None
    if isinstance(old, str) and old.startswith(("{", "[")) and rng.random() < 0.7:
        holder.setncattr(name, mutate_json(old, rng))
        return
    value = rng.choice(
        (
            rng.choice(TEXTS),
            float(rng.choice(NUMBERS)),
            np.array([1.0, 2.0]),
            np.array([], dtype="f4"),
            np.int8(3),
            ["a", "b"],
            DEEP,
            '{"a": NaN}',
            "days since 1900-01-01",
        )
    )
    holder.setncattr(name, value)


def _rename(file: netCDF4.Dataset, rng: random.Random) -> None:
    if rng.random() < 0.3 and file.dimensions:
        file.renameDimension(rng.choice(list(file.dimensions)), rng.choice(("x", "path", "step")))
        return
    name = rng.choice(list(file.variables))
    file.renameVariable(name, rng.choice(("x", "stress", "path_id", "seed", "split", name + "2")))


def _values(file: netCDF4.Dataset, rng: random.Random) -> None:
    variable = file.variables[rng.choice(list(file.variables))]
    variable.set_auto_maskandscale(False)
    where = tuple(rng.randrange(length) for length in variable.shape)
    if variable.dtype is str:
        variable[where] = rng.choice(TEXTS)
    elif variable.dtype.kind == "S":
        variable[where] = rng.choice((b"\xff", b"\x00", b"a"))
    elif variable.dtype.kind == "f":
        variable[where] = rng.choice((np.nan, np.inf, -np.inf, 0.0, -1.0, 1e30, 1e-40))
    else:
        variable[where] = rng.choice((-1, 0, 2**31 - 1, -(2**31)))


def _add(file: netCDF4.Dataset, rng: random.Random) -> None:
    kind = rng.randrange(5)
    label = f"extra{rng.randrange(1000)}"
    if kind == 0:
        length = rng.choice((0, 1, 10**6, 10**9, 10**12))
        dims = [file.createDimension(f"{label}{axis}", length).name for axis in range(2)]
        file.createVariable(label, rng.choice(("f4", "S1", str)), dims, zlib=rng.random() < 0.5)
    elif kind == 1:
        file.createGroup(label)
    elif kind == 2:
        file.createVariable(label, file.createVLType("f4", label), ("path",))
    elif kind == 3:
        file.createDimension(label, None)
        file.createVariable(label, "f8", (label, label), chunksizes=(10_000, 10_000))
    else:
        old = file.variables[rng.choice(list(file.variables))]
        name = old.name
        dims = [*old.dimensions]
        rng.shuffle(dims)
        file.renameVariable(name, label)
        new = file.createVariable(name, rng.choice(("f4", "f8", "i4", "u8", "S1", str)), dims)
        new.units, new.long_name = "1", "extra"


_NETCDF_CHANGES: tuple[Callable[[netCDF4.Dataset, random.Random], None], ...] = (
    _attribute, _attribute, _attribute, _rename, _values, _values, _add,
)  # fmt: skip
