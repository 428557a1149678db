"""`granbench generate dem-triaxial`: from a preset to a written dataset."""

from pathlib import Path
from typing import Any

from granbench.errors import EngineError
from granbench.generators.campaign import CampaignReport, run_campaign
from granbench.generators.campaign.progress import ProgressMode
from granbench.generators.dem.dataset import DATASET, assemble
from granbench.generators.dem.design import planned_tests, preset
from granbench.generators.dem.engine import engine_version
from granbench.generators.dem.jobs import campaign_jobs
from granbench.generators.dem.material import ContactMaterial
from granbench.records import write_records


def generate(
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

    The design leaves out tests that miss the dataset's limits or that the simulation cannot
    finish; the dataset says how many were planned. A job without a result for any other reason
    means no dataset.

    Parameters
    ----------
    preset_name : `smoke`, `core` or `paper`
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
    chosen = preset(preset_name)
    plans = planned_tests(chosen, seed)
    version = engine_version()
    report = run_campaign(
        campaign_jobs(chosen, plans),
        Path(out) / "campaign",
        workers=workers,
        scheduler=scheduler,
        progress=progress,
        retry_failed=retry_failed,
    )
    report.require_every_result(DATASET, except_permanent=True)
    results = {plan.name: report.done[plan.name] for plan in plans if plan.name in report.done}
    if not results:
        first = next(iter(report.failed.values()), "no job ran")
        raise EngineError(
            f"no test of the campaign in {out} succeeded; the first reason was: {first}"
        )
    configuration: dict[str, Any] = {
        "preset": chosen.model_dump(mode="json"),
        "seed": seed,
        "material": ContactMaterial().model_dump(),
    }
    dataset = assemble(
        sorted(plans, key=lambda plan: plan.name),
        results,
        preset=chosen,
        seed=seed,
        configuration=configuration,
        engine_version=version,
    )
    path = Path(out) / f"{DATASET}-{chosen.version}.nc"
    write_records(dataset, path)
    return path, report
