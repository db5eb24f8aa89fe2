"""Run one campaign in the compiled loop, and in the interpreted loop with the interpreted plant.

As a program (`python both_ways.py CAMPAIGN`) it prints both results as JSON, for tests that need
another source tree or other compiler settings than their own process.
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

from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import Campaign, Plan, check_campaign
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.rehearsal.devices import connect
from rig.kinds.wavebot.simulation.simulation import KEPT_FIELDS, CampaignSimulator
from rig.kinds.wavebot.tick import kind_with_law
from rig.realtime import cycle
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.safety import STOP_0
from rig.realtime.sequence import MEASURE

STILL_CLOCK = cycle.Timing(0.0, 0.0, 0)


class LoopResult(NamedTuple):
    """Result of one of the two loops."""

    kept: Any  # one line per measured tick, one column per field of KEPT_FIELDS
    reason: str
    incomplete_reason: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """Return a digest and some figures of the result."""
        digest = hashlib.sha256(np.ascontiguousarray(self.kept).tobytes()).hexdigest()
        power = float(self.kept[:, KEPT_FIELDS.index("power.mechanical_1")].sum())
        return {"bits": digest, "ticks": len(self.kept), "power": power, "reason": self.reason}


def open_campaign_plan(path: Path) -> tuple[Campaign, Plan]:
    """Return a campaign and its plan."""
    report = check_campaign(path)
    assert report.campaign is not None, report.text()
    assert report.plan is not None
    return report.campaign, report.plan


def compiled(path: Path) -> LoopResult:
    """Run a campaign in the compiled loop."""
    campaign, plan = open_campaign_plan(path)
    simulation = CampaignSimulator(campaign, plan).simulate(plan)
    lines, reasons = [np.empty((0, len(KEPT_FIELDS)))], []
    for window in simulation:
        columns: Any = window.data
        lines.append(np.array([columns[name].astype(float) for name in KEPT_FIELDS]).T)
        reasons.append(window.incomplete_reason)
    return LoopResult(np.concatenate(lines), simulation.reason, tuple(reasons))


@cache
def interpreted(path: Path) -> LoopResult:
    """Run a campaign in this process, without compiled code."""
    campaign, plan = open_campaign_plan(path)
    params = wavebot_params(campaign, plan.segments, plan.setpoints)
    devices = connect(
        json.loads(json.dumps(job.plant_settings(campaign))) | {"compiled": False}, plan.dt
    )
    kind = kind_with_law(campaign.file.heave_law.module)
    step, state = cycle.make(kind), cycle.start(kind, params, 0)
    fields = attrgetter(*KEPT_FIELDS)
    lines, tick, linger = [], 0, 0
    while linger < LINGER_TICKS:
        sense = devices.read(tick * plan.dt)
        state, command, row = step(params, state, sense, 0, tick, STILL_CLOCK, 1, plan.dt)
        devices.write(command)
        if row.plan.phase == MEASURE:
            lines.append(fields(row))
        linger += row.safety.mode == STOP_0
        tick += 1
    kept = np.array(lines, float).reshape(-1, len(KEPT_FIELDS))
    return LoopResult(kept, kind.reason_table.name(state.safety.reason), ())


if __name__ == "__main__":
    campaign_path = Path(sys.argv[1])
    print(json.dumps([compiled(campaign_path).summary(), interpreted(campaign_path).summary()]))
