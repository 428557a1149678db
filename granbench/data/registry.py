"""The registry: one YAML file for each dataset and version, with the addresses of its file."""

from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from granbench.errors import RegistryError, alternatives
from granbench.files.validation import first_fault

REGISTRY_FOLDER = Path(__file__).parent / "registry"

Sha256 = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
FileName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*\.nc$")]


class RegistryEntry(BaseModel):
    """One version of one dataset; published entries never change.

    Parameters
    ----------
    id : name of the dataset
    version : semantic version
    title : one line for listings
    tier : `mini` (inside the wheel), `core` (of the leaderboard) or `paper` (made on a cluster)
    licence : SPDX identifier
    thesis_section : section of Guan (2023) that it follows
    file : name of the netCDF file on every mirror
    bytes, sha256 : size and hash of that file
    content_sha256 : hash of its values, see `granbench.records.content_hashes`
    attributes_sha256 : hash of its attributes, see `granbench.records.attributes_hash`
    split_sha256 : hash of the frozen split, see `granbench.data.splits.split_hash`
    generator : command that made it
    generator_seconds : approximate duration of that command on two cores; None if it is not a
        `granbench generate` command that anyone can run
    mirrors : folders or http(s) addresses that hold the file, tried in order
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: Annotated[str, StringConstraints(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$")]
    version: Annotated[str, StringConstraints(pattern=r"^\d+\.\d+\.\d+$")]
    title: str
    tier: Literal["mini", "core", "paper"]
    licence: str
    thesis_section: str
    file: FileName
    bytes: int = Field(gt=0)
    sha256: Sha256
    content_sha256: Sha256
    attributes_sha256: Sha256
    split_sha256: Sha256
    generator: str
    generator_seconds: float | None = Field(default=None, gt=0)
    mirrors: tuple[str, ...] = ()

    @property
    def release(self) -> tuple[int, ...]:
        """The version as numbers, for ordering."""
        return tuple(int(part) for part in self.version.split("."))


def entry_path(identifier: str, version: str) -> Path:
    """The file of an entry."""
    return REGISTRY_FOLDER / f"{identifier}-{version}.yaml"


def entries() -> list[RegistryEntry]:
    """Every registered version of every dataset, by name, the newest version first.

    Raises
    ------
    RegistryError
        If a registry file breaks the model; the text names the file and the field.
    """
    found = [_read(path) for path in REGISTRY_FOLDER.glob("*.yaml")]
    newest_first = sorted(found, key=lambda entry: entry.release, reverse=True)
    return sorted(newest_first, key=lambda entry: entry.id)


def checked_entry(fields: Any, source: str) -> RegistryEntry:
    """An entry from plain values.

    Raises
    ------
    RegistryError
        Naming the source and the field that breaks the model.
    """
    try:
        return RegistryEntry.model_validate(fields)
    except ValidationError as error:
        raise RegistryError(f"{source}: {first_fault(error)}; fix the registry entry") from error


def _read(path: Path) -> RegistryEntry:
    try:
        fields = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())
        raise RegistryError(f"{path}: is not YAML ({reason}); fix the entry") from error
    return checked_entry(fields, str(path))


def entry(name: str) -> RegistryEntry:
    """The entry of a dataset: `dem-triaxial` is the newest version, `dem-triaxial@1.0.0` that one.

    Raises
    ------
    RegistryError
        If it is unknown; the text lists similar names.
    """
    identifier, _, version = name.partition("@")
    known = entries()
    named = [candidate for candidate in known if candidate.id == identifier]
    if not named:
        names = list(dict.fromkeys(candidate.id for candidate in known))
        raise RegistryError(f"unknown dataset {identifier!r}: {alternatives(identifier, names)}")
    if not version:
        return named[0]
    for candidate in named:
        if candidate.version == version:
            return candidate
    raise RegistryError(
        f"dataset {identifier!r} has no version {version!r}; use one of "
        f"{', '.join(candidate.version for candidate in named)}"
    )
