"""The task of a run that people attend: they hold, skip and repeat rows, and choose set points."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rig.campaign import Campaign
from rig.campaign.manual import ManualSetPoints
from rig.people.attendance import Attendance, attended, record
from rig.people.orders import People
from rig.processes.run_types import Task
from rig.realtime import axis


def attended_task(
    task: Task,
    checked: Any,
    plan: Any,
    path: Path,
    examine: Callable[[Path], Any],
    kept: Path,
    *,
    arming: bool = False,
    manual: bool = False,
    unattended: bool = False,
) -> Task:
    """Return the task with all that people may do in its run.

    ``path``: its file, of a manual run the one that a person named; ``kept``: file of the rows that
    people keep. They choose set points of campaigns with rows, not of sessions. ``arming``: power
    waits for them; ``manual``: one open segment in place of the rows; ``unattended``: without the
    dead man's time.
    """
    operator = checked.rig.operator
    live = None
    if isinstance(checked, Campaign) and plan.rows:
        force = _largest_force(task.params.rig)
        live = ManualSetPoints(path, checked, plan, examine, kept, force)
    how = Attendance(live is not None, arming, manual)
    people = People(
        live,
        arming,
        manual,
        None if unattended else operator.dead_man_s,
        operator.stop_by_viewers,
    )
    return task._replace(
        params=attended(task.params, how), plan=task.plan | record(how), people=people
    )


def _largest_force(params: Any) -> float:
    """Return the largest force of the axis that references and signals excite, N or N m."""
    axes = [each for each in params if isinstance(each, axis.Params)]
    limits = axes[params.reference_axis].limits
    return float(limits.current_peak * limits.newtons_per_ampere)
