"""Splits of a dataset, which are stored in its file: selection, hash and check for leaks."""

import hashlib
import json
from dataclasses import asdict, dataclass

import numpy as np
import xarray as xr

from granbench.errors import RegistryError
from granbench.records.schema import path_blocks

FEATURE_STEPS = 61
"""Evenly spaced steps of a path for the nearest-path distance: enough for the shape of a curve, and
the distances of a thousand paths fit in a few MB."""


class MissingSplitError(RegistryError):
    """A dataset lacks a split.

    Attributes
    ----------
    split : its name
    """

    def __init__(self, split: str, text: str) -> None:
        self.split = split
        super().__init__(text)


def split_names(ds: xr.Dataset) -> tuple[str, ...]:
    """The splits of a dataset: train, validation, test, then the others by name."""
    known = ("train", "validation", "test")
    found = set(ds["split"].values.astype(str))
    return tuple(n for n in known if n in found) + tuple(sorted(found - set(known)))


def select_split(ds: xr.Dataset, split: str) -> xr.Dataset:
    """The paths of one split.

    Raises
    ------
    MissingSplitError
        If the dataset has no such split; the text lists those it has.
    """
    chosen = np.flatnonzero(ds["split"].values.astype(str) == split)
    if not chosen.size:
        raise MissingSplitError(
            split,
            f"{ds.attrs.get('dataset', 'the dataset')} has no split {split!r}; use one of "
            f"{', '.join(split_names(ds))}",
        )
    return ds.isel(path=chosen)


def split_hash(ds: xr.Dataset) -> str:
    """SHA-256 over the (path, specimen, split) triples, independent of their order."""
    columns = (ds[name].values.astype(str).tolist() for name in ("path_id", "specimen", "split"))
    triples = sorted(zip(*columns, strict=True))
    return hashlib.sha256(json.dumps(triples, ensure_ascii=False).encode()).hexdigest()


@dataclass(frozen=True)
class LeakReport:
    """Common elements of splits; a dataset without leaks has three empty tuples.

    Parameters
    ----------
    shared_specimens : packings in more than one split
    shared_preparations : "grading, mu0" pairs in more than one split: packings made alike with
        another seed are nearly the same packing
    identical_paths : pairs of path names with equal strain and stress, in any two splits or one
    nearest_path_distance : RMS distance of the closest pair of paths, per pair of splits
        ("test-train"), over strain and stress divided by their standard deviations
    """

    shared_specimens: tuple[str, ...]
    shared_preparations: tuple[str, ...]
    identical_paths: tuple[tuple[str, str], ...]
    nearest_path_distance: dict[str, float]

    @property
    def clean(self) -> bool:
        """Whether nothing leaks from one split into another."""
        return not (self.shared_specimens or self.shared_preparations or self.identical_paths)

    def as_dict(self) -> dict[str, object]:
        """Plain values for JSON."""
        return asdict(self)


def leak_report(ds: xr.Dataset) -> LeakReport:
    """Find specimens, preparations and paths that two splits share.

    Parameters
    ----------
    ds : the whole dataset
    """
    split = ds["split"].values.astype(str)
    preparations = None
    if "grading" in ds.coords and "preparation_friction" in ds.coords:
        preparations = [
            f"{grading}, mu0 = {friction:g}"
            for grading, friction in zip(
                ds["grading"].values, ds["preparation_friction"].values, strict=True
            )
        ]
    return LeakReport(
        shared_specimens=_shared(ds["specimen"].values.astype(str), split),
        shared_preparations=_shared(preparations, split) if preparations else (),
        identical_paths=_identical(ds),
        nearest_path_distance=_nearest(ds, split),
    )


def _shared(labels: np.ndarray | list[str], split: np.ndarray) -> tuple[str, ...]:
    splits_of: dict[str, set[str]] = {}
    for label, name in zip(labels, split, strict=True):
        splits_of.setdefault(str(label), set()).add(str(name))
    return tuple(sorted(label for label, names in splits_of.items() if len(names) > 1))


def _identical(ds: xr.Dataset) -> tuple[tuple[str, str], ...]:
    names = iter(ds["path_id"].values.astype(str).tolist())
    first_of: dict[bytes, str] = {}
    pairs = []
    for block in zip(path_blocks(ds["strain"]), path_blocks(ds["stress"]), strict=True):
        for record in zip(*block, strict=True):
            digest = hashlib.sha256(b"".join(values.tobytes() for values in record)).digest()
            name = next(names)
            if (earlier := first_of.setdefault(digest, name)) != name:
                pairs.append((earlier, name))
    return tuple(pairs)


def _nearest(ds: xr.Dataset, split: np.ndarray) -> dict[str, float]:
    steps = np.linspace(0, ds.sizes["step"] - 1, FEATURE_STEPS).round().astype(int)
    parts = []
    for name in ("strain", "stress"):
        values = ds[name].isel(step=np.unique(steps)).values.astype(np.float64)
        spread = values.std(axis=(0, 1))
        parts.append(values / np.where(spread > 0.0, spread, 1.0))
    features = np.concatenate(parts, axis=-1).reshape(ds.sizes["path"], -1)
    names = split_names(ds)
    nearest = {}
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            a, b = features[split == one], features[split == other]
            squared = (a**2).sum(1)[:, None] + (b**2).sum(1) - 2.0 * a @ b.T
            # Through cancellation the squared distance of equal paths may be slightly negative.
            nearest[f"{one}-{other}"] = float(np.sqrt(max(0.0, squared.min()) / features.shape[1]))
    return nearest
