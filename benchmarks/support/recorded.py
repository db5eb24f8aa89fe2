"""A campaign of any length, and recorded ticks of its rehearsal to be repeated."""

import gc
import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.support.campaigns import open_checked
from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.rehearsal.devices import WaveBotPlantDevices, connect
from rig.kinds.wavebot.tick import KIND
from rig.realtime import cycle
from rig.realtime.requests import NO_REQUEST

ROOT = Path(__file__).resolve().parent.parent.parent
_OPENING = 6.5  # s of tare, readiness and lead-in of the campaign below
_ROW = 12.0  # s

# A stall of the host must appear in the figures and not end the run.
_LIMITS = """\
extends: {limits}
loop: {{lost_ticks_stop: 100000}}
"""
_RIG = """\
extends: {rig}
limits: benchmark_limits.yaml
rate_hz: {rate_hz}
"""
_CAMPAIGN = """\
name: benchmark
rig: benchmark_rig.yaml
sea: {{kind: regular, amplitude_m: 0.127, frequency_hz: 0.5}}
tare: {{duration_s: 1}}
start: {{set_point_s: 1, lead_in_s: 5}}
timing: {{settle_s: 4, interval_s: 12}}
repeat: {repeat}
matrix:
  list:
"""
_POINTS = """\
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0}
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 4000}
    - {spring_n_per_m: -2763, kp_n_s_per_m: -2000, ki_n_per_m: 4000}
    - {spring_n_per_m: -2763, kp_n_s_per_m: -2000, ki_n_per_m: 0}
"""


def write_campaign_file(folder: Path, seconds: float, rate_hz: int = 1000) -> Path:
    """Write a campaign that lasts at least ``seconds``; return its path.

    The drive is enabled after a tare of 1 s. Rows last 12 s, with two spring rates in turn; one row
    if that is long enough. The rig is the WaveBot, but lost ticks never trip it.
    """
    rows = max(1, math.ceil((seconds - _OPENING) / _ROW))
    points = _POINTS.splitlines(keepends=True)[:rows]
    repeat = math.ceil(rows / len(points))
    path = folder / f"benchmark_{rows}.yaml"
    configs = ROOT / "configs"
    for name, text in (
        ("limits", _LIMITS.format(limits=_quoted(configs / "limits" / "wavebot.yaml"))),
        ("rig", _RIG.format(rig=_quoted(configs / "rigs" / "wavebot.yaml"), rate_hz=rate_hz)),
    ):
        (folder / f"benchmark_{name}.yaml").write_text(text)
    path.write_text(_CAMPAIGN.format(repeat=repeat) + "".join(points))
    return path


def _quoted(path: Path) -> str:
    return json.dumps(str(path))


class LoopParts(NamedTuple):
    """Parts of a loop that is to run in this process."""

    campaign: Campaign
    plan: Plan
    params: cycle.Params
    devices: dict[str, Any]

    def connect(self) -> WaveBotPlantDevices:
        """Return new devices with the plant at rest."""
        return connect(self.devices, self.plan.dt)


def build_loop_parts(path: Path) -> LoopParts:
    """Return the parts of a campaign's loop; raises ValueError with the errors of the file."""
    campaign, plan = open_checked(path)
    params = wavebot_params(campaign, plan.segments, plan.setpoints)
    devices = json.loads(json.dumps(job.plant_settings(campaign)))
    return LoopParts(campaign, plan, params, devices)


class RecordedTicks(NamedTuple):
    """Ticks of a rehearsal with the drive enabled and waves at full height."""

    params: cycle.Params
    dt: float
    first: int  # tick of the first sense
    state: cycle.State  # before that tick
    senses: tuple[Any, ...]
    rows: tuple[Any, ...]


def record_ticks(path: Path, ticks: int, skip: int = 12_000) -> RecordedTicks:
    """Rehearse a campaign in this process; return ``ticks`` ticks after the first ``skip``."""
    loop_parts = build_loop_parts(path)
    devices, dt = loop_parts.connect(), loop_parts.plan.dt
    step = cycle.make(KIND)
    state = start = cycle.start(KIND, loop_parts.params, 0)
    senses, rows = [], []
    no_timing = cycle.Timing(0.0, 0.0, 0)
    for tick in range(skip + ticks):
        sense = devices.read(tick * dt)
        if tick == skip:
            start = state
        state, command, row = step(
            loop_parts.params, state, sense, NO_REQUEST, tick, no_timing, 1, dt
        )
        devices.write(command)
        if tick >= skip:
            senses.append(sense)
            rows.append(row)
    return RecordedTicks(loop_parts.params, dt, skip, start, tuple(senses), tuple(rows))


@contextmanager
def garbage_collection_off() -> Iterator[None]:
    """Switch garbage collection off, as in the loop process, while the context is open."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()
