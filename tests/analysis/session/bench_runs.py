"""Runs of the simulated bench as run folders, each driven by its set points without a loop.

The set point itself drives the simulation tick by tick (with T = R theta_dot for the brake), so the
results of an analysis depend only on the plant and the record, not on rig code in between.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from bench_files import DT, brake_current, changed
from synthetic_runs import write_run

from rig.kinds.oswec_bench.rehearsal.compiled_plant import CompiledStepper
from rig.kinds.oswec_bench.tick.signals import BenchRow
from rig.realtime.reasons import Reason
from rig.realtime.safety import Mode
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording import row_layout
from rig.recording.runs.mcap_file import row_dtype
from sim_plant.bench.world import OFF, Actuation, BenchWorld

DTYPE = row_dtype(row_layout.leaves(BenchRow))
NOMINAL_GAIN = 1.5708  # rad/s/V
NOMINAL_TORQUE_CONSTANT = 16.845  # N*m/A
VELOCITY_LAG_TICKS = 15  # ticks over which the shaft's speed is computed

PlanRow = dict[str, Any]


class Bench(NamedTuple):
    """A simulated bench and its gain as the run assumes it."""

    world: BenchWorld
    assumed_gain: float  # rad/s/V


def make_bench(
    name: str = "oswec_bench", *, seed: int = 1, gain: float | None = None, **values: Any
) -> Bench:
    """Return a compiled bench with some plant values replaced; the assumed gain is the true one by
    default.
    """
    world = BenchWorld(changed(name, **values), dt=DT, seed=seed, stepper=CompiledStepper)
    for _ in range(200):
        world.actuate(OFF)
        world.advance(DT)
    return Bench(world, world.params.servo.gain if gain is None else gain)


Law = Callable[[int, float, float], tuple[Actuation, tuple[float, float, float, float, float]]]
"""Tick, shaft speed, torque -> actuation; reference angle, velocity, torque; volts, current."""


def velocity_law(bench: Bench, row: PlanRow) -> Law:
    """Return a law of A cos w t, ramped up over a period; the brake acts by damping or current."""
    omega = 2.0 * math.pi / row["period_s"]
    amplitude = math.radians(row["amplitude_deg"])
    extra_amplitude_deg, advance_s = row.get("more_deg", 0.0), row.get("advance_s", 0.0)
    ticks = round(row["period_s"] / DT)

    def law(k: int, speed: float, torque: float) -> Any:
        ramp = min(1.0, k / ticks)
        ramp_rate = 1.0 / (ticks * DT) if k < ticks else 0.0
        angle = amplitude * ramp * math.cos(omega * k * DT)
        velocity = -amplitude * omega * ramp * math.sin(omega * k * DT)
        velocity += amplitude * ramp_rate * math.cos(omega * k * DT)
        velocity_command = velocity
        if k >= ticks and (extra_amplitude_deg or advance_s):
            corrected_amplitude = amplitude + math.radians(extra_amplitude_deg)
            velocity_command = -corrected_amplitude * omega * math.sin(omega * (k * DT + advance_s))
        volts = velocity_command / bench.assumed_gain
        damping = row.get("damping_n_m_s_per_rad", 0.0)
        current = row.get("brake_current_a", 0.0)
        if damping:
            current += brake_current(bench.world, damping * abs(speed))
        return Actuation(1, 0, volts, 0.0, current, 0), (angle, velocity, 0.0, volts, 0.0)

    return law


def torque_law(bench: Bench, row: PlanRow) -> Law:
    """Return a law of sinusoidal current on the clamped shaft; with a gain, the load cell feeds
    back.
    """
    omega = 2.0 * math.pi / row["period_s"]
    amplitude = row.get("current_amplitude_a", 0.0) * NOMINAL_TORQUE_CONSTANT
    amplitude = row.get("torque_amplitude_n_m", amplitude)
    gain = row.get("integral_per_s", 0.0)
    integral = 0.0

    def law(k: int, speed: float, torque: float) -> Any:
        nonlocal integral
        reference = amplitude * min(1.0, k * DT / 5.0) * math.sin(omega * k * DT)
        integral += DT * gain * (reference - torque)
        current = (reference + integral) / NOMINAL_TORQUE_CONSTANT
        return Actuation(1, 1, 0.0, current, 0.0, 1), (0.0, 0.0, reference, 0.0, current)

    return law


def _bring_home(bench: Bench, home: int, brake: float) -> None:
    """Bring the shaft back to its start angle without logging; otherwise it drifts out of its
    travel.

    ``brake`` (A) stays on, so that the brake stays on its branch.
    """
    world = bench.world
    scale = world.params.sensors.shaft_counts
    for _ in range(2500):
        offset = (world.sense().shaft_counts - home) / scale
        world.actuate(Actuation(1, 0, -3.0 * offset / bench.assumed_gain, 0.0, brake, 0))
        world.advance(DT)


def _drive_row(bench: Bench, law: Law, ticks: int, row: int, settle: int) -> Any:
    world = bench.world
    block = np.zeros(ticks, DTYPE)
    scale, cell = world.params.sensors, world.params.load_cell
    zero = float(cell.channels[5].bias)
    shaft_history = [world.sense().shaft_counts] * VELOCITY_LAG_TICKS
    columns = np.empty((ticks, 12))
    for k in range(ticks):
        sense = world.sense()
        shaft_history.append(sense.shaft_counts)
        speed = (shaft_history[-1] - shaft_history.pop(0)) / (
            VELOCITY_LAG_TICKS * DT * scale.shaft_counts
        )
        actuation, (angle, velocity, torque, volts, current) = law(k, speed, sense.tz - zero)
        columns[k] = (
            *(sense.motor_counts, sense.shaft_counts, sense.tz, sense.current_a),
            *(sense.brake_current_a, angle, velocity, torque, volts, current, actuation[4], zero),
        )
        world.actuate(actuation)
        world.advance(DT)
    names = (
        *("encoders.motor_counts", "encoders.shaft_counts", "load.tz", "servo.current"),
        *("brake.current", "reference.angle", "reference.velocity", "reference.torque"),
        *("command.volts", "command.current", "command.brake_current", "tared.torque"),
    )
    for name, column in zip(names, columns.T, strict=True):
        block[name] = column
    block["encoders.age"] = bench.world.delay
    block["tared.samples"] = 2000
    block["plan.row"] = row
    block["plan.phase"] = np.where(np.arange(ticks) < settle, int(Phase.SETTLE), int(Phase.MEASURE))
    block["safety.mode"] = Mode.RUN
    return block


def write_session(
    folder: Path,
    bench: Bench,
    kind: str,
    rows: Sequence[PlanRow],
    *,
    periods: int,
    settle: int = 1,
    plan_periods: int | None = None,
    edit_record: Callable[[Any], Any] = lambda data: data,
    status: Mapping[str, Any] = MappingProxyType({}),
    **session_settings: Any,
) -> Path:
    """Write a finished run of a session on a bench; ``session_settings`` goes into the session's
    file.

    ``edit_record`` returns the ticks that the record contains; ``status`` is the end of the run.
    """
    blocks, table = [], []
    home = bench.world.sense().shaft_counts
    for i, row in enumerate(rows):
        period_ticks = round(row["period_s"] / DT)
        if not kind.startswith("torque"):
            _bring_home(bench, home, row.get("brake_current_a", 0.0))
        law = (torque_law if kind.startswith("torque") else velocity_law)(bench, row)
        blocks.append(
            _drive_row(bench, law, (settle + periods) * period_ticks, i, settle * period_ticks)
        )
        table.append({"row": i, **row, "measure_s": (plan_periods or periods) * period_ticks * DT})
    end_block = np.zeros(20, DTYPE)
    end_block["plan.row"], end_block["plan.phase"], end_block["safety.mode"] = (
        NO_ROW,
        Phase.DONE,
        Mode.STOP_1,
    )
    end_block["safety.reason"] = Reason.PLAN_END
    data = np.concatenate([*blocks, end_block])
    data["tick"] = data["tick_end"] = np.arange(len(data))
    data["time"] = data["tick"] * DT
    scale = bench.world.params.sensors
    scales = {
        "motor_rad_per_count": 1.0 / scale.motor_counts,
        "shaft_rad_per_count": 1.0 / scale.shaft_counts,
        "torque_constant_n_m_per_a": NOMINAL_TORQUE_CONSTANT,
        "velocity_constant_rad_per_s_per_v": bench.assumed_gain,
    }
    config = {
        "name": kind,
        "session": {"name": kind, "session": kind, **session_settings},
        "rig": {"name": "oswec bench", "kind": "oswec bench"},
    }
    plan = {"dt": DT, "rows": table, "scales": scales}
    logged = edit_record(data)
    return write_run(
        folder, logged, plan, row_type=BenchRow, config=config, ticks=len(data), **status
    )


def driveline_rows(table: Sequence[tuple[float, float]], period: float = 1.5) -> list[PlanRow]:
    """Return rows from pairs of amplitude (deg) and damping (N*m*s/rad)."""
    return [{"amplitude_deg": a, "damping_n_m_s_per_rad": r, "period_s": period} for a, r in table]
