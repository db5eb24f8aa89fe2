"""Run one campaign in the compiled loop, and in the interpreted loop with the interpreted plant.

As a program (`python both_ways.py CAMPAIGN`) it prints both results as JSON, for tests that need
another source tree or other compiler settings than their own process.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import sys
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.campaign import AnyCampaign, AnyPlan, build_plan, open_campaign
from rig.kinds.rig_file import kind_of_task
from rig.realtime import cycle
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.requests import NO_REQUEST
from rig.realtime.safety import STOP_0
from rig.realtime.sequence import MEASURE
from rig.sweeps.simulator import campaign_kind, simulation_of

STILL_CLOCK = cycle.Timing(0.0, 0.0, 0)


class LoopResult(NamedTuple):
    """Result of one of the two loops."""

    fields: tuple[str, ...]  # that a sweep stores
    kept: Any  # one line per measured tick, one column per field
    reason: str
    incomplete_reason: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """Return a digest and some figures of the result."""
        digest = hashlib.sha256(np.ascontiguousarray(self.kept).tobytes()).hexdigest()
        station = next(name for name in self.fields if name.startswith("power."))
        power = float(self.kept[:, self.fields.index(station)].sum())
        return {"bits": digest, "ticks": len(self.kept), "power": power, "reason": self.reason}


def differing_fields(one: LoopResult, other: LoopResult) -> list[str]:
    """Return the fields whose bits differ, of two results of the same length."""
    assert one.reason == other.reason
    assert one.kept.shape == other.kept.shape
    return [
        name
        for i, name in enumerate(one.fields)
        if one.kept[:, i].tobytes() != other.kept[:, i].tobytes()
    ]


def open_campaign_plan(path: Path) -> tuple[AnyCampaign, AnyPlan]:
    """Return a campaign and its plan."""
    campaign = open_campaign(campaign_kind(kind_of_task(path)), path)
    return campaign, build_plan(campaign)


def open_simulator(path: Path) -> tuple[Any, AnyPlan]:
    """Return the compiled loop of a campaign, and its plan."""
    campaign, plan = open_campaign_plan(path)
    return simulation_of(campaign).open_simulator(campaign, plan), plan


def compiled(path: Path) -> LoopResult:
    """Run a campaign in the compiled loop."""
    simulator, plan = open_simulator(path)
    fields, simulation = simulator.stored.fields, simulator.simulate(plan)
    lines, reasons = [np.empty((0, len(fields)))], []
    for window in simulation:
        columns: Any = window.data
        lines.append(np.array([columns[name].astype(float) for name in fields]).T)
        reasons.append(window.incomplete_reason)
    return LoopResult(fields, np.concatenate(lines), simulation.reason, tuple(reasons))


@cache
def interpreted(path: Path) -> LoopResult:
    """Run a campaign as a rehearsal in this process, without compiled code."""
    campaign, plan = open_campaign_plan(path)
    tasks = kind_of_task(path).room("tasks")
    task = tasks.execution_task(campaign, plan)
    mode = tasks.rehearsal_mode(campaign, real_clock=False)
    settings = json.loads(json.dumps(mode.devices)) | {"compiled": False}
    devices = importlib.import_module(mode.device_module).connect(settings, plan.dt)
    step, state = cycle.make(task.kind), cycle.start(task.kind, task.params, 0)
    names = open_simulator(path)[0].stored.fields
    fields = attrgetter(*names)
    lines, tick, linger = [], 0, 0
    while linger < LINGER_TICKS:
        sense = devices.read(tick * plan.dt)
        state, command, row = step(
            task.params, state, sense, NO_REQUEST, tick, STILL_CLOCK, 1, plan.dt
        )
        devices.write(command)
        if row.plan.phase == MEASURE:
            lines.append(fields(row))
        linger += row.safety.mode == STOP_0
        tick += 1
    kept = np.array(lines, float).reshape(-1, len(names))
    return LoopResult(names, kept, task.kind.reason_table.name(state.safety.reason), ())


if __name__ == "__main__":
    campaign_path = Path(sys.argv[1])
    print(json.dumps([compiled(campaign_path).summary(), interpreted(campaign_path).summary()]))
