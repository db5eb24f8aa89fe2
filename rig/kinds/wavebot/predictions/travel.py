"""Stator travel and duration of a campaign, and of the same campaign in another order.

The plan has the minimum time of every segment; the stator's speed is that of the simulated plant.
A move that takes longer than its segment makes the plan wait.
"""

from typing import NamedTuple

from rig.campaign import build_plan
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.predictions.model import CampaignModel
from rig.realtime.sequence import WAIT_ARRIVAL


class Travel(NamedTuple):
    """Travel and duration of one order of the rows."""

    order: str
    moves: int  # spring moves between rows
    distance: float  # % of stator position, including the move to the first row
    moving_time: float  # s, stator in motion
    waiting_time: float  # s, wait for the stator beyond the planned time
    duration: float  # s, of the whole campaign, including waiting


def compute_travel(order: str, planned: Plan, model: CampaignModel) -> Travel:
    """Return the stator travel of a plan."""
    speed, position = model.params.spring.speed, float(model.plant.stator.start.value)
    distance = moving_time = waiting_time = 0.0
    segments = planned.segments
    positions = {row.row: row.place for row in planned.rows}
    first_position = planned.rows[0].place
    for row, wait, ticks in zip(segments.row, segments.wait, segments.ticks, strict=True):
        if not wait & WAIT_ARRIVAL:
            continue
        target = positions.get(row, first_position)
        seconds = abs(target - position) / speed
        distance, moving_time = distance + abs(target - position), moving_time + seconds
        waiting_time += max(0.0, seconds - ticks * planned.dt)
        position = target
    return Travel(
        order,
        planned.moves,
        distance,
        moving_time,
        waiting_time,
        planned.duration + waiting_time,
    )


def compare_orders(campaign: Campaign, planned: Plan, model: CampaignModel) -> tuple[Travel, ...]:
    """Return the travel of the planned order, then of "as given" and "fewest spring moves".

    The rows of an adaptive campaign have no other order.
    """
    travels = [compute_travel(campaign.file.order, planned, model)]
    if campaign.file.adaptive is not None:
        return tuple(travels)
    for alternative in ("as given", "fewest spring moves"):
        if alternative != campaign.file.order:
            file = campaign.file.model_copy(update={"order": alternative})
            reordered = build_plan(campaign._replace(file=file))
            travels.append(compute_travel(alternative, reordered, model))
    return tuple(travels)
