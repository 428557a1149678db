"""A registry, cache and checkout of a test's own."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest
import xarray as xr
import yaml

from granbench.benchmark.task import Task
from granbench.data.publish import register
from granbench.data.registry import RegistryEntry
from granbench.records import open_records, write_records


@dataclass
class Shelf:
    """Where a test's datasets are, away from the user's."""

    checkout: Path
    mirror: Path
    cache: Path
    monkeypatch: pytest.MonkeyPatch

    def publish(
        self, ds: xr.Dataset, version: str = "1.0.0", mirrors: Iterable[str] = ()
    ) -> RegistryEntry:
        """Write the dataset into the mirror folder, which no setting names, and register it."""
        file = self.mirror / f"synthetic-{version}.nc"
        write_records(ds.assign_attrs(version=version), file)
        return register(
            file, identifier="synthetic", title="Made up", command="none", mirrors=mirrors
        )

    def add_task(self, entry: RegistryEntry) -> Path:
        """Register the task of a published dataset alone, under the dataset's name."""
        with open_records(self.mirror / entry.file) as records:
            task = Task.of_records(records)
        folder = self.mirror.parent / "tasks"
        folder.mkdir(exist_ok=True)
        file = folder / f"{task.id}-{task.version}.yaml"
        file.write_text(yaml.safe_dump(task.model_dump(mode="json", exclude_none=True)))
        return file

    def use_mirror(self, place: Path | str) -> None:
        """Point GRANBENCH_MIRROR to a folder or address."""
        self.monkeypatch.setenv("GRANBENCH_MIRROR", str(place))


def make_shelf(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Shelf:
    """An empty registry and cache, a checkout without data, and no mirror."""
    shelf = Shelf(folder / "datasets", folder / "mirror", folder / "cache", monkeypatch)
    shelf.checkout.mkdir()
    monkeypatch.setattr("granbench.data.registry.REGISTRY_FOLDER", folder / "registry")
    monkeypatch.setattr("granbench.data.publish.REGISTRY_FOLDER", folder / "registry")
    monkeypatch.setattr("granbench.benchmark.task_registry.TASK_FOLDER", folder / "tasks")
    monkeypatch.setattr("granbench.data.fetch.MINI_FOLDER", folder / "mini")
    monkeypatch.setattr("granbench.data.publish.MINI_FOLDER", folder / "mini")
    monkeypatch.setattr("granbench.data.fetch.checkout_datasets", lambda: shelf.checkout)
    monkeypatch.setattr("granbench.data.download.PAUSE", 0.0)
    monkeypatch.setenv("GRANBENCH_CACHE", str(shelf.cache))
    monkeypatch.delenv("GRANBENCH_MIRROR", raising=False)
    return shelf
