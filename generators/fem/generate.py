"""`granbench generate fem-...`: from a preset to a written dataset."""

from functools import partial
from pathlib import Path

from granbench.generators.campaign import CampaignReport, run_campaign
from granbench.generators.campaign.progress import ProgressMode
from granbench.generators.fem.dataset import assemble
from granbench.generators.fem.design import GROUND_TRUTHS, planned_analyses, preset
from granbench.generators.fem.jobs import campaign_job
from granbench.records import write_records


def generate(
    dataset: str,
    preset_name: str,
    out: Path,
    *,
    seed: int = 0,
    workers: int = 1,
    scheduler: str | None = None,
    progress: ProgressMode = "bar",
    retry_failed: bool = False,
) -> tuple[Path, CampaignReport]:
    """Run, or continue, a campaign and write its dataset.

    Parameters
    ----------
    dataset : a key of `GROUND_TRUTHS`
    preset_name : `smoke`, `core` or `paper`
    out : folder of the campaign; the dataset is written into it
    seed : of the random confinements
    workers, scheduler, progress, retry_failed : see `run_campaign`

    Returns
    -------
    path of the dataset, and what became of each job

    Raises
    ------
    GranbenchError
        A clear sentence for whatever a user can correct; see `run_campaign`.
    """
    truth, chosen = GROUND_TRUTHS[dataset], preset(preset_name)
    plans = planned_analyses(truth, chosen, seed)
    report = run_campaign(
        [campaign_job(truth, chosen, plan, seed) for plan in plans],
        Path(out) / "campaign",
        workers=workers,
        scheduler=scheduler,
        progress=progress,
        retry_failed=retry_failed,
    )
    report.require_every_result(dataset)
    path = Path(out) / f"{dataset}-{chosen.version}.nc"
    write_records(assemble(truth, chosen, plans, report.done, seed), path)
    return path, report


fem_ime = partial(generate, "fem-ime")
fem_csuh = partial(generate, "fem-csuh")
