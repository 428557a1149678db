"""What the folder of a trained model says about it: its baseline, seed, duration and data."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from granbench.cells.baseline import DESCRIPTION_FILE
from granbench.errors import ConfigurationError, ModelError
from granbench.files.json_reading import read_json_object

REMEDY = "train the model again or copy the file anew"


def is_trained_folder(path: Path) -> bool:
    """Whether a folder holds a trained model."""
    return (path / DESCRIPTION_FILE).is_file()


@dataclass(frozen=True)
class TrainedFolder:
    """A folder that training wrote, as far as its description can be read.

    Parameters
    ----------
    path : the folder
    description : what its `model.json` holds; empty where that is missing or damaged, which
        `Baseline.load` reports
    """

    path: Path
    description: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path) -> "TrainedFolder":
        """The folder with its description, or without one where it cannot be read."""
        try:
            return cls(path, read_json_object(path / DESCRIPTION_FILE, ModelError, remedy=REMEDY))
        except ModelError:
            return cls(path)

    @property
    def training(self) -> dict[str, Any]:
        """What the description records of the training; empty where that is nothing."""
        training = self.description.get("training", {})
        return training if isinstance(training, dict) else {}

    @property
    def seed(self) -> int | None:
        """The seed that it was trained with."""
        seed = self.training.get("seed")
        return seed if isinstance(seed, int) else None

    @property
    def seconds(self) -> float | None:
        """How long it was trained, s."""
        seconds = self.training.get("seconds")
        return float(seconds) if isinstance(seconds, int | float) else None

    def training_data(self, content_sha256: object) -> str | None:
        """What it was trained on, in words.

        Parameters
        ----------
        content_sha256 : of the records that it is evaluated on; other data are named by their hash
        """
        about = self.training
        if "dataset" not in about:
            return None
        preset = f", preset {about['preset']}" if about.get("preset") else ""
        content = str(about.get("dataset_content_sha256", ""))
        other = "" if content == content_sha256 else f", content {content[:12] or 'unknown'}"
        text = f"{about['dataset']} {about.get('dataset_version', '')}".strip()
        return f"{text}, split train, checkpoint chosen on validation{preset}{other}"


def baseline_of_folder(path: Path) -> str:
    """Name of the baseline that a trained model's folder holds.

    Raises
    ------
    ModelError
        If the description is damaged.
    """
    file = path / DESCRIPTION_FILE
    name = read_json_object(file, ModelError, remedy=REMEDY).get("baseline")
    if not isinstance(name, str):
        raise ModelError(f"{file}: is damaged ('baseline' must be text); {REMEDY}")
    return name


def seeds_of_folders(
    folders: Sequence[TrainedFolder], seeds: Sequence[int] | None
) -> tuple[int, ...]:
    """The seed of each folder: the given ones, or else those recorded, or else 0, 1, 2 ...

    Raises
    ------
    ConfigurationError
        If there is not one seed for each folder, or two are the same.
    """
    if seeds is None:
        known = [folder.seed for folder in folders if folder.seed is not None]
        seeds = known if len(known) == len(folders) else range(len(folders))
    if len(seeds) != len(folders):
        raise ConfigurationError(
            f"there are {len(seeds)} seeds for {len(folders)} folders of trained models; give one "
            "for each"
        )
    if len(set(seeds)) < len(seeds):
        raise ConfigurationError(
            f"seeds {', '.join(map(str, seeds))} are not all different; give models of "
            "different seeds"
        )
    return tuple(seeds)
