"""The campaign executor: runs jobs that depend on each other, once each, and can be continued."""

from granbench.generators.campaign.report import CampaignReport
from granbench.generators.campaign.run import run_campaign
from granbench.generators.campaign.schedule import Job

__all__ = ["CampaignReport", "Job", "run_campaign"]
