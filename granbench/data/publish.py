"""For maintainers: make the mini tier of a core dataset, and register a file.

``python -m granbench.data.publish`` computes `attributes_sha256` of the registered files in the
checkout and writes it into their entries.
"""

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pooch
import xarray as xr
import yaml

from granbench.data.fetch import MINI_FOLDER, folders_of, why_not
from granbench.data.registry import (
    REGISTRY_FOLDER,
    RegistryEntry,
    checked_entry,
    entries,
    entry_path,
)
from granbench.data.splits import leak_report, split_hash
from granbench.errors import DatasetError, RegistryError
from granbench.files.whole_file import whole_file
from granbench.records import attributes_hash, open_records, verify, write_records

MINI_BYTES = 1_000_000
MINI_SPECIMENS = {"train": 3, "validation": 1, "test": 2}
"""Packings of each split in the mini tier; two of any other split. Replicates are added."""
MINI_REPLICATES = 2
MINI_PATHS = {"train": 64, "validation": 16, "test": 24}
"""Strain paths of each split in the mini tier, of a dataset where each is a specimen of its own;
eight of any other split."""


def make_mini(ds: xr.Dataset) -> xr.Dataset:
    """A few paths of a dataset: every split, every loading family, and two replicated packings.

    The first path of every family is taken from each chosen packing, with all its steps, so that
    the mini tier covers everything in the core dataset. If every strain path is its own specimen,
    more are taken.

    Parameters
    ----------
    ds : the core dataset
    """
    rows = []
    for specimen in _mini_specimens(ds):
        of_specimen = np.flatnonzero(ds["specimen"].values.astype(str) == specimen)
        _, first = np.unique(ds["loading_family"].values[of_specimen], return_index=True)
        rows.extend(of_specimen[first].tolist())
    mini = ds.isel(path=sorted(rows))
    mini.attrs = {
        **ds.attrs,
        "dataset": f"{ds.attrs['dataset']}-mini",
        "title": f"A few paths of {ds.attrs['dataset']} {ds.attrs['version']}",
        "derived_from": f"{ds.attrs['dataset']} {ds.attrs['version']} "
        f"{ds.attrs.get('content_sha256', '')}",
    }
    return mini


def _mini_specimens(ds: xr.Dataset) -> list[str]:
    """Names of the chosen packings: replicated ones first, then the most different ones.

    Without a recorded preparation, every specimen is a kind of its own.
    """
    names = ds["specimen"].values.astype(str).tolist()
    replicates_of = ds["replicate"].values if "replicate" in ds.coords else np.zeros(len(names))
    kinds: list[tuple[object, ...]] = [(name,) for name in names]
    on_packings = "grading" in ds.coords
    if on_packings:
        preparation = (ds["grading"].values.tolist(), ds["preparation_friction"].values.tolist())
        kinds = list(zip(*preparation, strict=True))
    facts: dict[str, tuple[str, int, tuple[object, ...]]] = {}
    for row, name in enumerate(names):
        facts.setdefault(name, (str(ds["split"].values[row]), int(replicates_of[row]), kinds[row]))
    again = {kind: name for name, (_, replicate, kind) in facts.items() if replicate}
    chosen: list[str] = []
    replicates: list[str] = []
    for split in dict.fromkeys(split for split, _, _ in facts.values()):
        originals = [n for n, (s, replicate, _) in facts.items() if s == split and not replicate]
        with_partner = [n for n in originals if facts[n][2] in again]
        room = MINI_SPECIMENS.get(split, 2) if on_packings else MINI_PATHS.get(split, 8)
        # One replicated packing of a split, the others spread over its list of packings.
        picks = with_partner[:1] if len(replicates) < MINI_REPLICATES else []
        replicates.extend(again[facts[name][2]] for name in picks)
        others = [name for name in originals if name not in picks]
        spread = np.linspace(0, len(others) - 1, min(len(others), room - len(picks)))
        chosen.extend(picks + [others[int(i)] for i in spread.round()])
    return chosen + replicates


def write_mini(ds: xr.Dataset, folder: Path) -> Path:
    """Write the mini tier of a dataset.

    Raises
    ------
    DatasetError
        If it comes out at a megabyte or more, too much for the wheel.
    """
    mini = make_mini(ds.load())
    path = folder / f"{mini.attrs['dataset']}-{mini.attrs['version']}.nc"
    write_records(mini, path)
    if (size := path.stat().st_size) >= MINI_BYTES:
        path.unlink()
        raise DatasetError(
            f"{path}: the mini tier would have {size} bytes and must stay below {MINI_BYTES}; "
            "choose fewer packings in MINI_SPECIMENS"
        )
    return path


def publish_mini(file: Path, *, replace: bool = False) -> RegistryEntry:
    """Write the mini tier of a core dataset into the package and register it.

    Parameters
    ----------
    file : the sealed core dataset
    replace : write over an entry of the same version, before it is published

    Raises
    ------
    DatasetError, RegistryError
        See `write_mini` and `register`.
    """
    with open_records(file) as ds:
        mini = write_mini(ds, MINI_FOLDER)
        parent = f"{ds.attrs['dataset']} {ds.attrs['version']}"
        return register(
            mini,
            identifier=f"{ds.attrs['dataset']}-mini",
            title=f"A few paths of {parent}, inside the package",
            command=f"granbench data mini {file.name}",
            tier="mini",
            replace=replace,
        )


def register(
    file: Path,
    *,
    identifier: str,
    title: str,
    command: str,
    seconds: float | None = None,
    tier: str = "core",
    mirrors: Iterable[str] = (),
    replace: bool = False,
) -> RegistryEntry:
    """Verify a file, check it for leaks between splits and write its registry entry.

    Parameters
    ----------
    file : sealed dataset whose attribute `dataset` is `identifier`
    title : one line for listings
    command : the command that made it
    seconds : see `RegistryEntry.generator_seconds`
    tier : see `RegistryEntry`
    mirrors : folders or addresses that hold it
    replace : write over an entry of the same version, before it is published

    Raises
    ------
    DatasetError
        If the file is damaged or its splits leak.
    RegistryError
        If its version is registered with other content, it calls itself otherwise, or a field
        of the entry is not allowed.
    """
    with open_records(file) as ds:
        verify(ds, str(file))
        if str(ds.attrs["dataset"]) != identifier:
            raise RegistryError(
                f"{file}: its attribute 'dataset' is {ds.attrs['dataset']!r}, not {identifier!r}"
            )
        leaks = leak_report(ds)
        if not leaks.clean:
            raise DatasetError(f"{file}: its splits leak: {json.dumps(leaks.as_dict())}")
        entry = checked_entry(
            {
                "id": identifier,
                "version": str(ds.attrs["version"]),
                "title": title,
                "tier": tier,
                "licence": str(ds.attrs["licence"]),
                "thesis_section": str(ds.attrs["thesis_section"]),
                "file": file.name,
                "bytes": file.stat().st_size,
                "sha256": pooch.file_hash(str(file), alg="sha256"),
                "content_sha256": str(ds.attrs["content_sha256"]),
                "attributes_sha256": attributes_hash(ds),
                "split_sha256": split_hash(ds),
                "generator": command,
                "generator_seconds": seconds,
                "mirrors": tuple(mirrors),
            },
            source=str(file),
        )
    known = {(e.id, e.version): e for e in entries()}.get((entry.id, entry.version))
    if known is not None and known.sha256 != entry.sha256 and not replace:
        raise RegistryError(
            f"{identifier} {entry.version} is registered with another file; published files never "
            "change: give the dataset a new version"
        )
    _write_entry(entry, entry_path(entry.id, entry.version))
    return entry


def write_attributes_hash(path: Path) -> RegistryEntry:
    """Compute `attributes_sha256` of a registered file and write it into its entry.

    Parameters
    ----------
    path : the entry, which may lack the hash

    Raises
    ------
    RegistryError
        If the checkout does not have the registered file.
    """
    fields = yaml.safe_load(path.read_text(encoding="utf-8"))
    entry = checked_entry({"attributes_sha256": "0" * 64} | fields, str(path))
    files = [folder / entry.file for folder in folders_of(entry)]
    file = next((file for file in files if why_not(file, entry) is None), None)
    if file is None:
        raise RegistryError(f"{path}: {entry.file} is not in the checkout; copy it there")
    with open_records(file) as ds:
        entry = entry.model_copy(update={"attributes_sha256": attributes_hash(ds)})
    _write_entry(entry, path)
    return entry


def _write_entry(entry: RegistryEntry, path: Path) -> None:
    text = yaml.safe_dump(
        entry.model_dump(mode="json", exclude_none=True), sort_keys=False, allow_unicode=True
    )
    with whole_file(path, RegistryError) as partial:
        partial.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    for file in sorted(REGISTRY_FOLDER.glob("*.yaml")):
        print(f"{file.name}: attributes_sha256 {write_attributes_hash(file).attributes_sha256}")
