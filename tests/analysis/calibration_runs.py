"""Synthetic wave calibrations: runs with three 50 Hz probes and a known sea."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from controllers.signals import Count, Metre, Second, Tick
from rig.kinds.wavebot import WaveSense
from rig.planning.campaign.multisine import Multisine, design_multisine
from rig.realtime import safety
from rig.realtime.cycle import PlanRecord
from rig.realtime.safety import Mode, Reason
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
    """The part of a rig's row that a wave calibration reads."""

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
    """The same with the loop's own count of the periods that it skipped."""

    tick: Tick
    time: Second
    plan: PlanRecord
    safety: safety.State
    probes: ProbeSense
    wave: WaveSense
    timing: Skipped
    tick_end: Tick


class BareRow(NamedTuple):
    """A row of a basin that tells nothing but the truth."""

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
    late: float = 0.0,
    noise: float = 0.0,
    seed: int = 0,
    kind: type = ProbedRow,
) -> Any:
    """All ticks of a calibration; probes are read ``late`` s after they sampled, held 20 ms.

    Probe 2 sees half of the sea a quarter of a second later, probe 3 the sea with an offset.
    """
    leading, measuring = round(lead_in / DT), round(periods * sea.repeat / DT)
    count = leading + measuring + 20
    data = np.zeros(count, row_dtype(row_layout.leaves(kind)))
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
    if kind is not BareRow:
        sample = np.floor((clock - late) / 0.02 + 1e-9)
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
            heard = value + noise * random.standard_normal(moments.size)
            data[f"probes.probe_{i + 1}"] = heard[place]
    return data


def plan_of(sea: Multisine = SEA) -> dict[str, Any]:
    """The plan as the supervisor attaches it."""
    return {
        "dt": DT,
        "device": "absent",
        "rows": [],
        "repeat_s": sea.repeat,
        "sea": {"kind": "pink", "words": "pink, for a test"},
        "asked_sea": {
            "repeat_s": sea.repeat,
            "cycles": sea.cycles.tolist(),
            "amplitude_m": sea.amplitude.tolist(),
            "phase_rad": sea.phase.tolist(),
        },
    }


def write(
    folder: Path, data: Any, plan: dict[str, Any] | None = None, kind: type = ProbedRow
) -> Path:
    """A run folder with these ticks."""
    folder.mkdir(parents=True)
    told = {"status": "complete", "reason": "PLAN_END", "mode": "rehearsal", "campaign": "pink"}
    files = {"plan.json": plan if plan is not None else plan_of(), "config.json": {"name": "pink"}}
    attached = {name: json.dumps(value).encode() for name, value in files.items()}
    writer = RowWriter(
        folder / "run.mcap", kind, attached, {"run": {"run": folder.name}}, start_utc_ns=0
    )
    for begin in range(0, len(data), 5000):
        writer.append(data[begin : begin + 5000].tobytes())
    writer.attach("status.json", json.dumps(told).encode())
    writer.finish()
    return folder
