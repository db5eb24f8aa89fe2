"""How far the stator goes in a campaign, how long all takes, and what another order would save.

The plan knows the least time of every segment; the stator's speed is the simulated plant's. A move
that takes longer than its segment makes the plan wait.
"""

from __future__ import annotations

from typing import NamedTuple

from rig.design.predictions import plant
from rig.planning.campaign import Campaign
from rig.planning.campaign.plan import Plan, build_plan
from rig.realtime.sequence import NO_ROW, WAIT_STATOR, Phase


class Travel(NamedTuple):
    """One order of the rows."""

    order: str
    moves: int  # between rows, of the spring
    way: float  # % of stator position, between rows and to the first of them
    moving: float  # s that the stator is on its way
    waiting: float  # s that the plan waits for it beyond what it has planned
    duration: float  # s, of the whole campaign, waiting included


def travel(order: str, planned: Plan, given: plant.Given) -> Travel:
    """The stator's way through a plan."""
    speed, at = plant.stator_speed(given), plant.stator_start(given)
    way = moving = waiting = 0.0
    segments = planned.segments
    positions = {row.row: row.stator_position for row in planned.rows}
    first = planned.rows[0].stator_position
    for row, wait, ticks in zip(segments.row, segments.wait, segments.ticks, strict=True):
        if not wait & WAIT_STATOR:
            continue
        target = positions.get(row, first)
        seconds = abs(target - at) / speed
        way, moving = way + abs(target - at), moving + seconds
        waiting += max(0.0, seconds - ticks * planned.dt)
        at = target
    return Travel(order, planned.spring_moves, way, moving, waiting, planned.duration + waiting)


def to_the_first(planned: Plan, given: plant.Given) -> float:
    """Seconds that the drive is on before the first wave: the stator goes to the first row."""
    segments = planned.segments
    ticks = sum(
        n
        for row, phase, n in zip(segments.row, segments.phase, segments.ticks, strict=True)
        if row == NO_ROW and phase == Phase.MOVING
    )
    way = abs(planned.rows[0].stator_position - plant.stator_start(given))
    return max(ticks * planned.dt, way / plant.stator_speed(given))


def orders(campaign: Campaign, planned: Plan, given: plant.Given) -> tuple[Travel, ...]:
    """The plan as it is, then as given and with the fewest moves where that is another order."""
    out = [travel(campaign.file.order, planned, given)]
    for other in ("as given", "fewest spring moves"):
        if other != campaign.file.order:
            file = campaign.file.model_copy(update={"order": other})
            out.append(travel(other, build_plan(file, campaign.rig, campaign.points), given))
    return tuple(out)
