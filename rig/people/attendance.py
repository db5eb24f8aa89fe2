"""Additions to a plan when people attend the run: arming, set points of their own, manual mode.

The loop executes a table of segments (`rig.realtime.sequence`); these functions change it. Nothing
is added to a run that nobody attends, so its ticks stay as they are.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from rig.realtime import cycle
from rig.realtime.live_setpoints import with_live_entries
from rig.realtime.sequence import NO_ROW, WAIT_ARMED, WAIT_ORDER, Phase, Segments

_NEVER = 2**62  # ticks: longer than any run


class Attendance(NamedTuple):
    """The ways in which people attend a run; the record of its plan has them."""

    live: bool = False  # they may choose set points: on hold, or in manual mode
    arming: bool = False  # power waits for them
    manual: bool = False  # instead of rows the plan has one open segment in manual mode


NOBODY = Attendance()
_KEY = "attendance"  # in the record of a plan


def record(attendance: Attendance) -> dict[str, Any]:
    """Return the entry of a plan's record; none for a run that nobody attends."""
    return {} if attendance == NOBODY else {_KEY: attendance._asdict()}


def attendance(plan: Mapping[str, Any]) -> Attendance:
    """Return the attendance in the record of a plan."""
    recorded = plan.get(_KEY)
    return Attendance(**recorded) if isinstance(recorded, dict) else NOBODY


def attended(params: cycle.Params, how: Attendance) -> cycle.Params:
    """Return the parameters of a run that people attend."""
    segments = params.segments
    if how.manual:
        segments = _manual(segments)
    if how.arming:
        segments = _with_standby(segments)
    if segments is not params.segments:
        params = params._replace(segments=segments)
    return with_live_entries(params) if how.live else params


def _manual(segments: Segments) -> Segments:
    """Return a plan with an open segment in place of the rows; set points as of the first row."""
    first = next((i for i, row in enumerate(segments.row) if row != NO_ROW), len(segments.row) - 1)
    kept = [i for i in range(first) if segments.phase[i] != Phase.LEAD_IN]
    last = len(segments.row) - 1
    columns = {
        name: [column[i] for i in kept] + [column[first], column[last]]
        for name, column in segments._asdict().items()
    }
    at = len(kept)
    columns["row"][at], columns["phase"][at] = NO_ROW, int(Phase.MANUAL)
    columns["ticks"][at], columns["wait"][at], columns["timeout"][at] = 1, WAIT_ORDER, _NEVER
    columns["restart"] = list(range(len(kept) + 2))
    return Segments(**{name: tuple(column) for name, column in columns.items()})


def _with_standby(segments: Segments) -> Segments:
    """Return the plan with a segment that waits for people before the drive is switched on."""
    at = next((i for i, drive in enumerate(segments.drive) if drive == 1), -1)
    if at < 0:
        return segments
    own = Segments(
        row=(NO_ROW,),
        phase=(int(Phase.STANDBY),),
        ticks=(1,),
        wait=(WAIT_ARMED,),
        timeout=(_NEVER,),
        restart=(at,),
        drive=(0,),
        waves=(0,),
        setpoint=(segments.setpoint[at],),
    )
    moved = segments._replace(restart=tuple(i + (i >= at) for i in segments.restart))
    return Segments(
        *(column[:at] + new + column[at:] for column, new in zip(moved, own, strict=True))
    )
