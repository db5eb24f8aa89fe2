"""Campaign files of the benchmarks: write them, open them, rehearse them."""

from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from rig.execution.task import run_task
from rig.kinds.wavebot.campaign import Campaign, Plan, check_campaign
from rig.kinds.wavebot.tasks import execution_task, rehearsal_mode
from rig.processes.run_types import Snapshot


class SilentView:
    """A view of a run that shows nothing."""

    notice = ""

    def __call__(self, snapshot: Snapshot) -> None:
        """Ignore the snapshot."""


def write_yaml(path: Path, content: dict[str, Any]) -> Path:
    """Write a YAML file, in a new folder if necessary; return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        YAML(typ="safe").dump(content, file)
    return path


def open_checked(path: Path, rig: Path | None = None) -> tuple[Campaign, Plan]:
    """Return a campaign and its plan, on ``rig`` instead of its own rig file if given.

    Raises ValueError with the errors of the file.
    """
    report = check_campaign(path, rig=rig)
    if report.campaign is None or report.plan is None:
        raise ValueError(report.text())
    return report.campaign, report.plan


def rehearse(path: Path, runs: Path) -> tuple[Path, Plan]:
    """Rehearse a campaign on the virtual clock; return its run folder (in ``runs``) and its plan.

    Raises RuntimeError if the run is not complete.
    """
    campaign, plan = open_checked(path)
    mode = rehearsal_mode(campaign, real_clock=False)
    result = run_task(execution_task(campaign, plan), runs, SilentView(), mode)
    if result.outcome.status != "complete":
        raise RuntimeError(f"{path.name}: {result.outcome.reason}")
    return result.folder, plan
