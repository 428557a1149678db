"""The scatter between packings of a board's dataset: a lower bound of a model's error."""

from collections.abc import Iterable

from granbench.data.replicates import ReplicateScatter, replicate_scatter
from granbench.data.store import load
from granbench.errors import DatasetError, DownloadError, RegistryError
from granbench.leaderboard.submission import DatasetReference


def replicate_scatters(
    datasets: Iterable[DatasetReference],
) -> dict[tuple[str, str], ReplicateScatter]:
    """The scatter of each dataset that is available and has replicates, by (name, version).

    The pages of other datasets are built without the reference line.
    """
    found: dict[tuple[str, str], ReplicateScatter] = {}
    for name, version in dict.fromkeys((item.name, item.version) for item in datasets):
        try:
            with load(f"{name}@{version}") as records:
                found[name, version] = replicate_scatter(records)
        except (RegistryError, DownloadError, DatasetError):
            continue
    return found
