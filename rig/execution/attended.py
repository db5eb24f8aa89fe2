"""The task of a run that people attend: they hold, skip and repeat rows, and choose set points."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rig.kinds import registry
from rig.people.attendance import Attendance, attended, record
from rig.people.orders import People
from rig.people.set_points import LiveColumns, RefusedError
from rig.processes.run_types import Task

NOWHERE: Mapping[int, float] = {}


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
    places: Mapping[int, float] = NOWHERE,
) -> Task:
    """Return the task with all that people may do in its run.

    ``path``: its file, of a manual run the one that a person named; ``kept``: file of the rows that
    people keep. They choose set points of kinds with the room `manual`. ``arming``: power waits for
    them; ``manual``: one open segment in place of the rows; ``unattended``: without the dead man's
    time; ``places``: of the candidate rows of an adaptive campaign (`People`).
    """
    operator, people = checked.rig.operator, People()
    try:
        people = people._replace(live=_live_columns(task, checked, plan, path, examine, kept))
    except RefusedError as error:
        people = people._replace(no_live=str(error))
    how = Attendance(people.live is not None, arming, manual)
    people = people._replace(
        arming=arming,
        manual=manual,
        dead_man_s=None if unattended else operator.dead_man_s,
        stop_by_anyone=operator.stop_by_viewers,
        places=places,
    )
    return task._replace(
        params=attended(task.params, how), plan=task.plan | record(how), people=people
    )


def _live_columns(task: Task, *arguments: Any) -> LiveColumns | None:
    """Return the set points of a task; None for a kind of rig without manual mode."""
    try:
        room = registry.find(task.kind_name).room("manual")
    except registry.KindError:
        return None
    found: LiveColumns | None = room.live_columns(task, *arguments)
    return found
