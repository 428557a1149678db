"""`granbench generate gp-...`: from a preset to a written dataset."""

from functools import partial
from pathlib import Path

from granbench.generators.campaign import CampaignReport, run_campaign
from granbench.generators.campaign.progress import ProgressMode
from granbench.generators.classical.dataset import assemble
from granbench.generators.classical.design import GROUND_TRUTHS, preset, splits
from granbench.generators.classical.jobs import campaign_job
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
    preset_name : `smoke`, `core`, `tangents` or `paper`
    out : folder of the campaign; the dataset is written into it
    seed : of every random choice
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
    plans = splits(truth, chosen)
    report = run_campaign(
        [campaign_job(truth, chosen, plans, seed)],
        Path(out) / "campaign",
        workers=workers,
        scheduler=scheduler,
        progress=progress,
        retry_failed=retry_failed,
    )
    report.require_every_result(dataset)
    path = Path(out) / f"{dataset}-{chosen.version}.nc"
    write_records(assemble(truth, chosen, plans, report.done[dataset], seed), path)
    return path, report


gp_j2 = partial(generate, "gp-j2")
gp_dp = partial(generate, "gp-dp")
gp_j2_hardening = partial(generate, "gp-j2-hardening")
gp_ime = partial(generate, "gp-ime")
gp_csuh = partial(generate, "gp-csuh")
