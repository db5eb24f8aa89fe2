"""One campaign both ways: the compiled loop, and the interpreted one with the interpreted plant.

As a program (`python both_ways.py CAMPAIGN`) it tells in JSON what either gave, for tests that
want another tree or other settings of the compiler than their own process has.
"""

from __future__ import annotations

import hashlib
import json
import sys
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.execution.rehearsal import job
from rig.execution.rehearsal.devices import connect
from rig.kinds.wavebot import KIND
from rig.kinds.wavebot.build import wavebot_params
from rig.planning.campaign import Campaign, Plan, check_campaign
from rig.realtime import cycle
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.safety import STOP_0, Reason
from rig.realtime.sequence import MEASURE
from rig.sweep.simulation import KEPT, Subject

STILL_CLOCK = cycle.Timing(0.0, 0.0, 0)


class Given(NamedTuple):
    """What one way gave."""

    kept: Any  # one line a measured tick, one column a field of KEPT
    reason: str
    incomplete_reason: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """The same in a few words."""
        digest = hashlib.sha256(np.ascontiguousarray(self.kept).tobytes()).hexdigest()
        power = float(self.kept[:, KEPT.index("power.mechanical_1")].sum())
        return {"bits": digest, "ticks": len(self.kept), "power": power, "reason": self.reason}


def opened(path: Path) -> tuple[Campaign, Plan]:
    """A campaign and its plan."""
    report = check_campaign(path)
    assert report.campaign is not None, report.text()
    assert report.plan is not None
    return report.campaign, report.plan


def compiled(path: Path) -> Given:
    """Walked by the compiled loop."""
    campaign, plan = opened(path)
    walk = Subject(campaign, plan).walk(plan)
    found, why = [np.empty((0, len(KEPT)))], []
    for window in walk:
        columns: Any = window.data
        found.append(np.array([columns[name].astype(float) for name in KEPT]).T)
        why.append(window.incomplete_reason)
    return Given(np.concatenate(found), walk.reason.name, tuple(why))


@cache
def interpreted(path: Path) -> Given:
    """Rehearsed in this process, nothing compiled."""
    campaign, plan = opened(path)
    params = wavebot_params(
        campaign.file, campaign.rig, campaign.limits, plan.segments, plan.setpoints,
        campaign.record,
    )  # fmt: skip
    devices = connect(
        json.loads(json.dumps(job.plant_settings(campaign))) | {"compiled": False}, plan.dt
    )
    step, state = cycle.make(KIND), cycle.start(KIND, params, 0)
    fields = attrgetter(*KEPT)
    found, tick, linger = [], 0, 0
    while linger < LINGER_TICKS:
        sense = devices.read(tick * plan.dt)
        state, command, row = step(params, state, sense, 0, tick, STILL_CLOCK, 1, plan.dt)
        devices.write(command)
        if row.plan.phase == MEASURE:
            found.append(fields(row))
        linger += row.safety.mode == STOP_0
        tick += 1
    kept = np.array(found, float).reshape(-1, len(KEPT))
    return Given(kept, Reason(state.safety.reason).name, ())


if __name__ == "__main__":
    campaign_path = Path(sys.argv[1])
    print(json.dumps([compiled(campaign_path).summary(), interpreted(campaign_path).summary()]))
