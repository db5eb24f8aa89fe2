"""Synthetic wave calibrations: runs with three 50 Hz probes and a known sea."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from controllers.signals import Count, Metre, Second, Tick
from rig.kinds.wavebot.tick import WaveSense
from rig.planning.multisine import Multisine, design_multisine
from rig.realtime import safety
from rig.realtime.cycle import PlanRecord
from rig.realtime.reasons import Reason
from rig.realtime.safety import Mode
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording import row_layout
from rig.recording.mcap_writer import RowWriter
from rig.recording.runs.mcap_file import row_dtype

DT = 0.001


class ProbeSense(NamedTuple):
    probe_1: Metre
    probe_2: Metre
    probe_3: Metre
    probe_age: Second


class ProbedRow(NamedTuple):
    """The part of a rig's log row that a wave calibration reads."""

    tick: Tick
    time: Second
    plan: PlanRecord
    safety: safety.State
    probes: ProbeSense
    wave: WaveSense
    tick_end: Tick


class Skipped(NamedTuple):
    skipped: Count


class TimedRow(NamedTuple):
    """`ProbedRow` with the loop's count of skipped periods."""

    tick: Tick
    time: Second
    plan: PlanRecord
    safety: safety.State
    probes: ProbeSense
    wave: WaveSense
    timing: Skipped
    tick_end: Tick


class BareRow(NamedTuple):
    """A log row of a basin without probes, with the undisturbed elevation only."""

    tick: Tick
    time: Second
    plan: PlanRecord
    safety: safety.State
    wave: WaveSense
    tick_end: Tick


SEA = design_multisine(0.2, 1.0, 20.0, rms=0.05, exponent=-0.5, seed=1)


def elevation(sea: Multisine, time: Any) -> Any:
    angle = 2.0 * np.pi * np.outer(time, sea.cycles) / sea.repeat + sea.phase
    return np.cos(angle) @ sea.amplitude


def rows(
    sea: Multisine = SEA,
    *,
    periods: int = 3,
    lead_in: float = 5.0,
    latency: float = 0.0,
    noise: float = 0.0,
    seed: int = 0,
    row_type: type = ProbedRow,
) -> Any:
    """Return all ticks of a calibration with probes sampled every 20 ms.

    The loop reads a sample ``latency`` s after it was taken. Probe 1 measures the sea, probe 2 half
    of it 0.25 s later, probe 3 the sea with an offset of 12 mm.
    """
    leading, measuring = round(lead_in / DT), round(periods * sea.repeat / DT)
    count = leading + measuring + 20
    data = np.zeros(count, row_dtype(row_layout.leaves(row_type)))
    data["tick"] = data["tick_end"] = np.arange(count)
    data["time"] = clock = np.arange(count) * DT
    data["plan.row"] = NO_ROW
    data["plan.phase"] = Phase.LEAD_IN
    data["plan.phase"][leading : leading + measuring] = Phase.MEASURE
    data["plan.phase"][leading + measuring :] = Phase.DONE
    data["plan.wave_clock"] = clock
    data["plan.wave_clock"][leading + measuring :] = -1.0
    data["safety.mode"] = Mode.OFF
    data["safety.reason"][leading + measuring :] = Reason.PLAN_END
    data["wave.elevation"] = elevation(sea, clock)
    if row_type is not BareRow:
        sample = np.floor((clock - latency) / 0.02 + 1e-9)
        taken = 0.02 * sample
        random = np.random.default_rng(seed)
        data["probes.probe_age"] = clock - taken
        moments, place = np.unique(taken, return_inverse=True)
        for i, value in enumerate(
            (
                elevation(sea, moments),
                0.5 * elevation(sea, moments - 0.25),
                elevation(sea, moments) + 0.012,
            )
        ):
            reading = value + noise * random.standard_normal(moments.size)
            data[f"probes.probe_{i + 1}"] = reading[place]
    return data


def plan_of(sea: Multisine = SEA) -> dict[str, Any]:
    """Return the plan as attached by the supervisor."""
    return {
        "dt": DT,
        "device": "absent",
        "rows": [],
        "repeat_s": sea.repeat,
        "sea": {"kind": "pink", "words": "pink, for a test"},
        "requested_sea": {
            "repeat_s": sea.repeat,
            "cycles": sea.cycles.tolist(),
            "amplitude_m": sea.amplitude.tolist(),
            "phase_rad": sea.phase.tolist(),
        },
    }


def write(
    folder: Path, data: Any, plan: dict[str, Any] | None = None, row_type: type = ProbedRow
) -> Path:
    """Write a run folder with these ticks."""
    folder.mkdir(parents=True)
    status = {"status": "complete", "reason": "PLAN_END", "mode": "rehearsal", "campaign": "pink"}
    attachments = {
        "plan.json": plan if plan is not None else plan_of(),
        "config.json": {"name": "pink"},
    }
    encoded = {name: json.dumps(value).encode() for name, value in attachments.items()}
    writer = RowWriter(
        folder / "run.mcap",
        row_layout.schema(row_type),
        encoded,
        {"run": {"run": folder.name}},
        start_utc_ns=0,
    )
    for begin in range(0, len(data), 5000):
        writer.append(data[begin : begin + 5000].tobytes())
    writer.attach("status.json", json.dumps(status).encode())
    writer.finish()
    return folder
