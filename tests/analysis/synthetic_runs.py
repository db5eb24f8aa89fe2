"""Synthetic WaveBot runs with known answers, written through the logger's own writer."""

import json
from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from controllers import impedance
from rig.analysis.rows import contents_attributes
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.tick import WaveBotRow
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.realtime.reasons import Reason
from rig.realtime.safety import Mode
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording import row_layout
from rig.recording.mcap_writer import RowWriter
from rig.recording.runs.mcap_file import row_dtype
from rig.stations import station_names

START = 1_760_000_000_000_000_000  # ns, UTC
DTYPE = row_dtype(row_layout.leaves(WaveBotRow))
POWERS = station_names(STATIONS)
CONTENTS = row_contents(impedance.COLUMNS)
COLUMNS = CONTENTS.columns
LOG_FIELDS = {column.name: column.field for column in COLUMNS}
STATIONS_ATTRIBUTES = contents_attributes(CONTENTS)  # of a row table
STATOR = {490.9: -13.0, -5715.0: 27.0}


class Row(NamedTuple):
    """A planned row and its mean power (W by station)."""

    point: int
    repetition: int
    spring_rate: float
    kp: float
    ki: float
    power: dict[str, float]
    more: Mapping[str, float] = MappingProxyType({})  # further set points by column name


class Shape(NamedTuple):
    """Timing and noise of a synthetic run."""

    dt: float = 0.01
    frequency: float = 0.5
    lead_in: int = 100  # ticks
    settle: int = 50
    periods: int = 5
    tail: int = 20
    noise: float = 0.0  # W, white, on each power
    wander: float = 0.0  # W, from one wave period to the next
    irregular_repeat: float | None = None  # s; None: a regular sea
    seed: int = 0


def bowl(kp0: float, ki0: float, best: float, floor: float) -> Callable[[float, float], float]:
    """Return a paraboloid of power over the gains with its minimum ``best`` at (kp0, ki0)."""

    def power(kp: float, ki: float) -> float:
        return best + floor * (((kp - kp0) / 2500.0) ** 2 + ((ki - ki0) / 10000.0) ** 2)

    return power


def default_rows() -> list[Row]:
    """Return two spring rates with the gains of the default campaign."""
    rows: list[Row] = []
    grids = {490.9: range(0, 10001, 2000), -5715.0: range(-4000, 4001, 2000)}
    for rate, kis in grids.items():
        shift = 8000.0 if rate > 0.0 else 0.0
        mech = bowl(-2000.0, shift, -91.0, 90.0)
        ac = bowl(-2500.0 if rate > 0.0 else -2000.0, shift / 2, -55.0 if rate > 0 else -61.0, 80.0)
        dc = bowl(-2000.0, shift / 4, -6.0 if rate > 0.0 else -15.0, 75.0)
        for kp in range(-1000, -3501, -500):
            for ki in kis:
                power = {
                    "mechanical_1": mech(kp, ki),
                    "mechanical_2": mech(kp, ki) * 0.8,
                    "ac": ac(kp, ki),
                    "dc": dc(kp, ki),
                }
                rows.append(Row(len(rows), 0, rate, float(kp), float(ki), power))
    return rows


def drive_rows(repetitions: int = 1) -> list[Row]:
    """Return a full factorial of drive parameters, after MASK4 report, section 4.4.

    DC power falls (more is absorbed) by 8 W from 50 to 200 us of switching period, rises by 2 W
    from 60 to 90 V of bus voltage, and falls by 1 W up to a threshold of 0.1 m/s. AC power does not
    depend on them. Kp -1500 instead of -2000 reduces both powers by 3 W.
    """
    rows: list[Row] = []
    for repetition in range(repetitions):
        settings = product((60.0, 75.0, 90.0), (50e-6, 100e-6, 200e-6), (0.0, 0.1), (-2e3, -1.5e3))
        for i, (bus, period, threshold, kp) in enumerate(settings):
            worse = 3.0 * (kp + 2000.0) / 500.0
            gain = 8.0 * (period - 50e-6) / 150e-6 + 1.0 * threshold / 0.1
            dc = -20.0 + 2.0 * (bus - 60.0) / 30.0 - gain + worse
            power = {"mechanical_1": -60.0, "mechanical_2": -50.0, "ac": -40.0 + worse, "dc": dc}
            more = {
                "bus_voltage": bus,
                "switching_period": period,
                "velocity_threshold": threshold,
                "hysteresis_tolerance": 0.5,
                "discharge_level": 15.0,
            }
            rows.append(Row(i, repetition, -5715.0, kp, 0.0, power, more))
    return rows


def phase_block(n: int, row: int, phase: Phase, planned: Row | None = None) -> Any:
    """Return ``n`` ticks of one phase; all other fields are zero."""
    block = np.zeros(n, DTYPE)
    block["plan.row"] = row
    block["plan.phase"] = phase
    block["safety.mode"] = Mode.RUN
    block["tare.samples"] = 500
    if planned is not None:
        block["heave.demand.kp"] = planned.kp
        block["heave.demand.ki"] = planned.ki
        block["spring_command.rate"] = planned.spring_rate
        block["spring_command.target"] = STATOR.get(planned.spring_rate, 0.0)
        for name, value in planned.more.items():
            block[LOG_FIELDS[name]] = value
    return block


def measured(row: int, planned: Row, shape: Shape, random: np.random.Generator) -> Any:
    """Return a MEASURE window with F in phase with v; the mean of F v is exactly the power."""
    period = shape.irregular_repeat or 1.0 / shape.frequency
    n = round(shape.periods * period / shape.dt)
    block = phase_block(n, row, Phase.MEASURE, planned)
    angle = 2.0 * np.pi * np.arange(n) * shape.dt / period
    speed = 0.2
    block["heave.estimate.position"] = -speed * period / (2.0 * np.pi) * np.cos(angle)
    block["heave.estimate.velocity"] = speed * np.sin(angle)
    per_period = np.minimum(np.arange(n) * shape.periods // n, shape.periods - 1)
    for kind, mean in planned.power.items():
        wander = shape.wander * random.normal(size=shape.periods)
        power = 2.0 * mean * np.sin(angle) ** 2 + wander[per_period]
        block[f"power.{kind}"] = power + shape.noise * random.normal(size=n)
    for station in STATIONS:
        if station.force:
            block[station.force] = 2.0 * planned.power[station.name] / speed * np.sin(angle) + 12.0
    block["heave.command.force"] = 300.0 * np.sin(angle)
    block["heave.sense.current"] = 4.0 * np.sin(angle)
    return block


def run_rows(rows: list[Row], shape: Shape) -> Any:
    """Return all ticks of a complete run of the planned rows."""
    random = np.random.default_rng(shape.seed)
    pieces = [phase_block(shape.lead_in, NO_ROW, Phase.LEAD_IN)]
    for i, row in enumerate(rows):
        pieces += [
            phase_block(shape.settle, i, Phase.SETTLE, row),
            measured(i, row, shape, random),
            phase_block(shape.tail, i, Phase.TAIL, row),
        ]
    done = phase_block(20, NO_ROW, Phase.DONE)
    done["safety.mode"] = Mode.STOP_1
    done["safety.reason"] = Reason.PLAN_END
    return stamped(np.concatenate([*pieces, done]), shape.dt)


def stamped(data: Any, dt: float) -> Any:
    """Number the ticks from 0 and set their times."""
    data["tick"] = data["tick_end"] = np.arange(len(data))
    data["time"] = data["tick"] * dt
    return data


def plan_json(rows: list[Row], shape: Shape) -> dict[str, Any]:
    """Return the plan as attached by the supervisor."""
    sea: dict[str, Any] = {
        "kind": "regular",
        "amplitude_m": 0.127,
        "frequency_hz": shape.frequency,
        "words": f"regular, amplitude 0.127 m, {shape.frequency:g} Hz",
    }
    repeat = 1.0 / shape.frequency
    if shape.irregular_repeat is not None:
        repeat = shape.irregular_repeat
        sea = {"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.5, "gamma": 3.3}
    return {
        "dt": shape.dt,
        "repeat_s": repeat,
        "sea": sea,
        "rows": [
            {
                "row": i,
                "point": row.point,
                "repetition": row.repetition,
                "spring_rate": row.spring_rate,
                "stator": STATOR.get(row.spring_rate, 0.0),
                "kp": row.kp,
                "ki": row.ki,
                **row.more,
            }
            for i, row in enumerate(rows)
        ],
    }


CONFIG = {"name": "default", "rig": {"name": "wavebot"}, "campaign": {"name": "default"}}
CODE = {"version": "0.1.0", "git": "0123abc", "dirty": False, "python": "3.11.7", "packages": {}}
TIMING = {
    "clock": "virtual",
    "rate_hz": 1000.0,
    "ticks": 1000,
    "skipped": 0,
    "dropped_rows": 0,
    "lateness_us": {"p50": 0.0, "p99": 0.0, "p999": 0.0, "max": 0.0},
    "privileges": {},
    "summary": "Virtual clock: every tick ran in order, none was skipped, no row was dropped.",
}
STATUS = {
    "status": "complete",
    "reason": "PLAN_END",
    "rows_done": 66,
    "rows_planned": 66,
    "mode": "rehearsal",
    "started_utc": "2026-05-04T09:30:00Z",
    "ended_utc": "2026-05-04T09:55:12Z",
}


def write_run(
    folder: Path,
    data: Any,
    plan: dict[str, Any],
    *,
    finish: bool = True,
    row_type: type = WaveBotRow,
    config: dict[str, Any] | None = None,
    code: dict[str, Any] | None = None,
    **status: Any,
) -> Path:
    """Write a run folder like the supervisor; without ``finish`` like a killed logger."""
    folder.mkdir(parents=True, exist_ok=True)
    config = CONFIG if config is None else config
    files: dict[str, Any] = {"config.json": config, "plan.json": plan, "code.json": code or CODE}
    files["host.json"] = {"hostname": "basin-1", "cpu": "2 cores"}
    run_status = {**STATUS, **status}
    writer = RowWriter(
        folder / "run.mcap",
        row_layout.schema(row_type),
        {name: json.dumps(value).encode() for name, value in files.items()},
        {"run": {"run": folder.name}},
        start_utc_ns=START,
    )
    size = 500
    for begin in range(0, len(data), size):
        writer.append(data[begin : begin + size].tobytes())
        writer.flush()
    if finish:
        writer.attach("timing.json", json.dumps(TIMING).encode())
        writer.attach("status.json", json.dumps(run_status).encode())
        writer.finish()
        (folder / "run.json").write_text(json.dumps(run_status))
        (folder / "config.json").write_text(json.dumps(config))
    else:
        writer.close()
    return folder
