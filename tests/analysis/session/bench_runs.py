"""Runs of the simulated bench as run folders: each session's set points, driven without a loop.

The world is driven tick by tick by the set point itself (and T = R theta_dot for the brake), so
what an analysis finds here rests on the plant and on the record alone, not on rig code between.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from bench_files import DT, brake_current, changed
from synthetic_runs import write_run

from rig.execution.rehearsal.compiled_bench import CompiledStepper
from rig.kinds.oswec_bench.signals import BenchRow
from rig.realtime.safety import Mode, Reason
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording import row_layout
from rig.recording.runs.mcap_file import row_dtype
from sim_plant.bench.world import OFF, Actuation, BenchWorld

DTYPE = row_dtype(row_layout.leaves(BenchRow))
NOMINAL_GAIN = 1.5708  # rad/s/V
NOMINAL_CONSTANT = 16.845  # N*m/A
LATE = 15  # ticks over which the shaft's speed is taken

Asked = dict[str, Any]


class Bench(NamedTuple):
    """A world with what a run has to know of it."""

    world: BenchWorld
    gain: float  # rad/s/V believed in


def bench(
    name: str = "oswec_bench", *, seed: int = 1, gain: float | None = None, **values: Any
) -> Bench:
    """A compiled bench with some plant values replaced; ``gain`` as believed, or the true one."""
    world = BenchWorld(changed(name, **values), dt=DT, seed=seed, stepper=CompiledStepper)
    for _ in range(200):
        world.actuate(OFF)
        world.advance(DT)
    return Bench(world, world.params.servo.gain if gain is None else gain)


Law = Callable[[int, float, float], tuple[Actuation, tuple[float, float, float, float, float]]]
"""Tick, shaft speed, torque -> actuation; reference angle, velocity, torque; volts, current."""


def velocity_law(on: Bench, asked: Asked) -> Law:
    """A cos w t grown over one period, the brake by damping or by current."""
    omega = 2.0 * math.pi / asked["period_s"]
    amplitude = math.radians(asked["amplitude_deg"])
    more, ahead = asked.get("more_deg", 0.0), asked.get("advance_s", 0.0)
    ticks = round(asked["period_s"] / DT)

    def law(k: int, speed: float, torque: float) -> Any:
        share = min(1.0, k / ticks)
        rate = 1.0 / (ticks * DT) if k < ticks else 0.0
        angle = amplitude * share * math.cos(omega * k * DT)
        velocity = -amplitude * omega * share * math.sin(omega * k * DT)
        velocity += amplitude * rate * math.cos(omega * k * DT)
        asked_for = velocity
        if k >= ticks and (more or ahead):
            larger = amplitude + math.radians(more)
            asked_for = -larger * omega * math.sin(omega * (k * DT + ahead))
        volts = asked_for / on.gain
        damping = asked.get("damping_n_m_s_per_rad", 0.0)
        current = asked.get("brake_current_a", 0.0)
        if damping:
            current += brake_current(on.world, damping * abs(speed))
        return Actuation(1, 0, volts, 0.0, current, 0), (angle, velocity, 0.0, volts, 0.0)

    return law


def torque_law(on: Bench, asked: Asked) -> Law:
    """A sinusoid of current on the clamped shaft; with a gain, fed back from the load cell."""
    omega = 2.0 * math.pi / asked["period_s"]
    amplitude = asked.get("current_amplitude_a", 0.0) * NOMINAL_CONSTANT
    amplitude = asked.get("torque_amplitude_n_m", amplitude)
    gain = asked.get("integral_per_s", 0.0)
    summed = 0.0

    def law(k: int, speed: float, torque: float) -> Any:
        nonlocal summed
        wanted = amplitude * min(1.0, k * DT / 5.0) * math.sin(omega * k * DT)
        summed += DT * gain * (wanted - torque)
        current = (wanted + summed) / NOMINAL_CONSTANT
        return Actuation(1, 1, 0.0, current, 0.0, 1), (0.0, 0.0, wanted, 0.0, current)

    return law


def _homed(on: Bench, home: int, brake: float) -> None:
    """Bring the shaft back to where it was, not logged: else it drifts out of its travel.

    ``brake`` (A) stays on, so that a branch of the brake is not left.
    """
    world = on.world
    scale = world.params.sensors.shaft_counts
    for _ in range(2500):
        off = (world.sense().shaft_counts - home) / scale
        world.actuate(Actuation(1, 0, -3.0 * off / on.gain, 0.0, brake, 0))
        world.advance(DT)


def _driven(on: Bench, law: Law, ticks: int, row: int, settle: int) -> Any:
    world = on.world
    block = np.zeros(ticks, DTYPE)
    scale, cell = world.params.sensors, world.params.load_cell
    zero = float(cell.channels[5].bias)
    seen = [world.sense().shaft_counts] * LATE
    told = np.empty((ticks, 12))
    for k in range(ticks):
        sense = world.sense()
        seen.append(sense.shaft_counts)
        speed = (seen[-1] - seen.pop(0)) / (LATE * DT * scale.shaft_counts)
        actuation, (angle, velocity, torque, volts, current) = law(k, speed, sense.tz - zero)
        told[k] = (
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
    for name, column in zip(names, told.T, strict=True):
        block[name] = column
    block["encoders.age"] = on.world.delay
    block["tared.samples"] = 2000
    block["plan.row"] = row
    block["plan.phase"] = np.where(np.arange(ticks) < settle, int(Phase.SETTLE), int(Phase.MEASURE))
    block["safety.mode"] = Mode.RUN
    return block


def write_session(
    folder: Path,
    on: Bench,
    kind: str,
    rows: Sequence[Asked],
    *,
    periods: int,
    settle: int = 1,
    plan_periods: int | None = None,
    change: Callable[[Any], Any] = lambda data: data,
    status: Mapping[str, Any] = MappingProxyType({}),
    **told: Any,
) -> Path:
    """A finished run of a session on a bench; ``told`` goes into the session's file.

    ``change`` gives the ticks that the record holds of all; ``status``: how the run ended.
    """
    blocks, table = [], []
    home = on.world.sense().shaft_counts
    for i, asked in enumerate(rows):
        per = round(asked["period_s"] / DT)
        if not kind.startswith("torque"):
            _homed(on, home, asked.get("brake_current_a", 0.0))
        law = (torque_law if kind.startswith("torque") else velocity_law)(on, asked)
        blocks.append(_driven(on, law, (settle + periods) * per, i, settle * per))
        table.append({"row": i, **asked, "measure_s": (plan_periods or periods) * per * DT})
    done = np.zeros(20, DTYPE)
    done["plan.row"], done["plan.phase"], done["safety.mode"] = NO_ROW, Phase.DONE, Mode.STOP_1
    done["safety.reason"] = Reason.PLAN_END
    data = np.concatenate([*blocks, done])
    data["tick"] = data["tick_end"] = np.arange(len(data))
    data["time"] = data["tick"] * DT
    scale = on.world.params.sensors
    scales = {
        "motor_rad_per_count": 1.0 / scale.motor_counts,
        "shaft_rad_per_count": 1.0 / scale.shaft_counts,
        "torque_constant_n_m_per_a": NOMINAL_CONSTANT,
        "velocity_constant_rad_per_s_per_v": on.gain,
    }
    config = {
        "name": kind,
        "session": {"name": kind, "session": kind, **told},
        "rig": {"name": "oswec bench"},
    }
    plan = {"dt": DT, "rows": table, "scales": scales}
    kept = change(data)
    return write_run(
        folder, kept, plan, row_type=BenchRow, config=config, ticks=len(data), **status
    )


def driveline_rows(table: Sequence[tuple[float, float]], period: float = 1.5) -> list[Asked]:
    """Amplitudes (deg) and dampings (N*m*s/rad)."""
    return [{"amplitude_deg": a, "damping_n_m_s_per_rad": r, "period_s": period} for a, r in table]
