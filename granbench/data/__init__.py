"""Datasets: registry, fetching, splits and torch adapters (`granbench.data.adapters`)."""

from granbench.data.normalisation import Normalisation
from granbench.data.registry import RegistryEntry, entries, entry
from granbench.data.splits import leak_report, select_split, split_hash, split_names
from granbench.data.store import dataset_file, load

__all__ = [
    "Normalisation",
    "RegistryEntry",
    "dataset_file",
    "entries",
    "entry",
    "leak_report",
    "load",
    "select_split",
    "split_hash",
    "split_names",
]
