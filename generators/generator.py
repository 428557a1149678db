"""The interface of all generators: from a preset to jobs, and from their results to a dataset.

A family of datasets, such as those of strain paths through classical models, is one `Generator`
object. It says which jobs make a dataset and how their results are put together; running the
campaign, continuing it, and writing the file are the same for all families.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import xarray as xr

from granbench import __version__
from granbench.errors import ConfigurationError, EngineError, RegistryError
from granbench.generators.assembly import Assembled, with_attributes
from granbench.generators.campaign import CampaignReport, Job, run_campaign
from granbench.generators.campaign.progress import ProgressMode
from granbench.records import write_records
from granbench.units.plausible import LARGEST_SEED

CAMPAIGN_FOLDER = "campaign"
LICENCE = "CC-BY-4.0"


class Preset(Protocol):
    """The size of a dataset; a pydantic model in every family.

    Parameters
    ----------
    name : of the preset
    version : of the dataset that is made with it
    """

    @property
    def name(self) -> str:
        """Name of the preset."""

    @property
    def version(self) -> str:
        """Version of the dataset that is made with the preset."""

    def model_dump(self, *, mode: str) -> dict[str, object]:
        """Every setting, as JSON values."""


D = TypeVar("D")
P = TypeVar("P", bound=Preset)


def _nothing_needed() -> None:
    """Accept every machine."""


@dataclass(frozen=True)
class Generator(Generic[D, P]):
    """A family of datasets that the same kinds of jobs make.

    Parameters
    ----------
    datasets : description of each dataset, by name; one more dataset is one more entry. A name is
        that of the family (its entry point in the group `granbench.generators`) or begins with it
        and a hyphen.
    presets : sizes in which each dataset can be made, by name
    jobs : ``jobs(dataset, preset, seed)`` returns the jobs of the campaign in order of priority;
        it depends on nothing but its arguments
    assemble : ``assemble(dataset, preset, seed, results)`` puts the records together; `results`
        holds the folder of each finished job by key
    check_machine : raises an error if this machine lacks something that the jobs need
    permanent_failures : whether jobs that fail permanently are left out of the dataset instead of
        preventing it
    """

    datasets: Mapping[str, D]
    presets: Mapping[str, P]
    jobs: Callable[[D, P, int], Sequence[Job]]
    assemble: Callable[[D, P, int, Mapping[str, Path]], Assembled]
    check_machine: Callable[[], object] = _nothing_needed
    permanent_failures: bool = False

    def dataset(self, name: str) -> D:
        """The description of a dataset.

        Raises
        ------
        RegistryError
            If the family has no such dataset.
        """
        if name not in self.datasets:
            raise RegistryError(f"unknown dataset {name!r}; use one of {', '.join(self.datasets)}")
        return self.datasets[name]

    def preset(self, name: str) -> P:
        """The preset of that name.

        Raises
        ------
        RegistryError
            If the family has no such preset.
        """
        if name not in self.presets:
            raise RegistryError(f"unknown preset {name!r}; use one of {', '.join(self.presets)}")
        return self.presets[name]

    def planned_jobs(self, dataset: str, preset: str, seed: int = 0) -> list[Job]:
        """Every job of a campaign, in order of priority.

        Parameters
        ----------
        dataset, preset : names
        seed : of every random choice, from 0 to `LARGEST_SEED`

        Raises
        ------
        RegistryError
            If there is no such dataset or preset.
        ConfigurationError
            If the seed is out of range.
        """
        if not 0 <= seed <= LARGEST_SEED:
            raise ConfigurationError(f"seed must be from 0 to {LARGEST_SEED}, not {seed}")
        return list(self.jobs(self.dataset(dataset), self.preset(preset), seed))

    def records(
        self, dataset: str, preset: str, seed: int, results: Mapping[str, Path]
    ) -> xr.Dataset:
        """Put the results of a campaign together, with the attributes that every dataset has.

        Parameters
        ----------
        dataset, preset, seed : of the campaign
        results : folder of each finished job, by key

        Returns
        -------
        Dataset that follows `granbench.records.schema.SCHEMA`, not sealed yet; units are added on
        writing
        """
        chosen = self.preset(preset)
        assembled = self.assemble(self.dataset(dataset), chosen, seed, results)
        command = f"granbench generate {dataset} --preset {preset}"
        attributes = {
            "dataset": dataset,
            "version": chosen.version,
            "title": assembled.title,
            "generator": command + (f" --seed {seed}" if seed else ""),
            "generator_version": __version__,
            "engine": assembled.engine,
            "engine_version": assembled.engine_version,
            "configuration": {
                **assembled.configuration,
                "preset": chosen.model_dump(mode="json"),
                "seed": seed,
            },
            "seed": seed,
            "licence": LICENCE,
            "thesis_section": assembled.thesis_section,
            **assembled.attributes,
        }
        return with_attributes(assembled.dataset(), attributes)

    def generate(
        self,
        dataset: str,
        preset: str,
        out: Path,
        *,
        seed: int = 0,
        workers: int = 1,
        scheduler: str | None = None,
        progress: ProgressMode = "bar",
        retry_failed: bool = False,
    ) -> tuple[Path, CampaignReport]:
        """Run, or continue, the campaign of a dataset and write its file.

        Parameters
        ----------
        dataset, preset : names
        out : folder of the campaign and of the file ``DATASET-VERSION.nc``
        seed : of every random choice
        workers, scheduler, progress, retry_failed : see `run_campaign`

        Returns
        -------
        Path of the file, and the state of each job

        Raises
        ------
        RegistryError
            If there is no such dataset or preset.
        ConfigurationError
            If the seed or the folder cannot be used; see also `run_campaign`.
        MissingResults
            If a job that the dataset needs has failed.
        EngineError
            If no job succeeded whose result goes into the dataset.
        """
        out = Path(out)
        jobs = self.planned_jobs(dataset, preset, seed)
        require_netcdf_name(out)
        self.check_machine()
        report = run_campaign(
            jobs,
            out / CAMPAIGN_FOLDER,
            workers=workers,
            scheduler=scheduler,
            progress=progress,
            retry_failed=retry_failed,
        )
        report.require_every_result(dataset, except_permanent=self.permanent_failures)
        needed = {key for job in jobs for key in job.needs}
        if not any(job.key in report.done for job in jobs if job.key not in needed):
            reason = next(iter(report.failed.values()), "the campaign has no jobs")
            raise EngineError(
                f"{dataset} was not written: no job in {out} succeeded whose result goes into it; "
                f"the first failure was: {reason}"
            )
        records = self.records(dataset, preset, seed, report.done)
        path = out / f"{dataset}-{self.preset(preset).version}.nc"
        write_records(records, path)
        return path, report


def require_netcdf_name(folder: Path) -> None:
    """Refuse, before hours of work, a folder into which no file could be written.

    Raises
    ------
    ConfigurationError
        If the netCDF library cannot write to a file below a folder of that name.
    """
    raw = os.fsencode(folder)
    try:
        text = raw.decode()
    except UnicodeDecodeError:
        text = ""
    if not text or "\\" in text:
        shown = raw.decode(errors="replace")
        raise ConfigurationError(
            f"{shown}: netCDF cannot write below a folder whose name has a backslash or is not "
            "UTF-8; choose another folder"
        )
