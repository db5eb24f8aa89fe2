"""Execution of one campaign, from its checked file to its run folder, as by `rig run`."""

from pathlib import Path

from rig.execution.task import RunResult, View, run_task
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.tasks import campaign_task
from rig.processes.run_types import ExecutionMode


def run_campaign(
    campaign: Campaign, plan: Plan, runs: Path, view: View, mode: ExecutionMode
) -> RunResult:
    """Run a campaign to its end and return the result; see `rig.execution.task.run_task`."""
    return run_task(campaign_task(campaign, plan), runs, view, mode)
