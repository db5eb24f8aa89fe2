"""Benches with constants hidden from the analysis, and sessions simulated on them.

The compiled plant executes a table of commands by tick: no loop, no record. A reading is one tick
old, so each command is paired with the reading of the next tick.
"""

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from rig.compilation import lifting
from rig.config.yaml_source import load_mapping
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.rehearsal.compiled_plant import CompiledStepper
from rig.recording.runs.folder import RunInfo
from rig.recording.runs.state import RecordState
from sim_plant.bench import dynamometer
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.stepper import StepperInputs
from sim_plant.sensors import NOISE_LENGTH

PLANTS = Path(__file__).resolve().parents[2] / "configs" / "plants"
DT = 0.001
TARE = 500  # ticks
NOMINAL_GAIN, NOMINAL_CONSTANT = 1.5708, 16.845
GEAR_RATIO = 15.0  # gear ratio
TORQUE, VELOCITY = 1, 0
_RUN_INFO = RunInfo("blind", "batch", "", {}, {}, {}, {}, {}, {}, {})
_COMPLETE_RECORD = RecordState("complete", 0, 0, False, (), ())

Floats = npt.NDArray[np.float64]

CONSTANT_RANGES: dict[str, tuple[float, float]] = {
    "motor.torque_constant": (1.0, 1.35),
    "velocity_loop.gain": (1.42, 1.66),
    "velocity_loop.offset": (-0.0006, 0.0006),
    "gearbox.dry": (0.4, 1.2),
    "gearbox.share_forward": (0.05, 0.11),
    "gearbox.share_back": (0.05, 0.11),
    "transmission.half_gap": (0.015, 0.035),
    "transmission.soft_deflection": (0.02, 0.05),
    "transmission.gearbox_stiffness": (30_000.0, 60_000.0),
    "bearing.clockwise": (0.03, 0.15),
    "bearing.counter": (0.05, 0.2),
    "bearing.viscous": (0.02, 0.12),
    "brake.half_width": (0.004, 0.012),
}
"""Range of each value of the plant file; the draw is uniform."""


class SessionRow(NamedTuple):
    """One set point: sine of the drive's command, brake current and duration."""

    plan_row: dict[str, float]
    amplitude: float  # V or A
    period: float  # s
    periods: int
    brake: float = 0.0  # A
    damping: float = 0.0  # N*m*s/rad, of the brake


def draw_constants(seed: int) -> dict[str, float]:
    """Return the hidden constants of a bench."""
    random = np.random.default_rng(seed)
    return {name: float(random.uniform(*bounds)) for name, bounds in CONSTANT_RANGES.items()}


def build_plant(values: dict[str, float], *, with_brake: bool) -> BenchPlant:
    """Return a shipped bench with these values instead of its own."""
    name = "oswec_bench" if with_brake else "oswec_bench_unbraked"
    mapping, _ = load_mapping(PLANTS / f"{name}.yaml")
    mapping["sensors"]["travel"]["value"] = 180.0  # the shaft does not return to zero between rows
    for path, value in values.items():
        section, field = path.split(".")
        mapping[section][field]["value"] = value
    return BenchPlant.model_validate(mapping)


@njit
def _run_ticks(
    advance: Any, x: Any, mode: int, commands: Any, locked: int, begin: int, out: Any
) -> None:
    for k in range(len(commands)):
        read = advance(
            x, 1, mode, commands[k, 0], commands[k, 1], commands[k, 2], locked, 1, 0, begin + k
        )
        out[k, 0], out[k, 1], out[k, 2] = read[0], read[1], read[2]
        out[k, 3], out[k, 4] = read[10], read[11]


@cache
def _compiled_step() -> Any:
    """Return the compiled step of a bench; its constants are in its array, so it compiles once."""
    params = build_plant({}, with_brake=True).build()
    start = StepperInputs(params, dynamometer.initial(params), [0.0] * NOISE_LENGTH, DT)
    return CompiledStepper(start)._compiled.code.advance


def simulate_session(
    values: dict[str, float], seed: int, kind: str, rows: list[SessionRow]
) -> SessionRun:
    """Simulate the rows of a session, one after another, and return their data."""
    braked = kind in ("driveline", "brake_map", "torque_constant")
    params = build_plant(values, with_brake=braked).build()
    normals = np.random.default_rng(seed).standard_normal(NOISE_LENGTH).tolist()
    state = dynamometer.initial(params)
    # A new array of the compiled step (rig/compilation/plant_step.py); its code is shared.
    x = np.array([*lifting.flatten(state), DT, *lifting.flatten(params), *normals])
    mode = TORQUE if kind == "torque_constant" else VELOCITY
    locked = 1 if kind == "torque_constant" else 0
    advance = _compiled_step()
    tare = np.zeros((TARE, 5))
    _run_ticks(advance, x, mode, np.zeros((TARE, 3)), locked, 1, tare)
    zero, tick, points = tare.mean(axis=0), TARE + 1, []
    for number, row in enumerate(rows):
        settle = round(row.period / DT)
        ticks = settle + round(row.periods * row.period / DT)
        commands, angle = _command_table(params, row, mode, ticks + 1)
        readings = np.empty((ticks + 1, 5))
        _run_ticks(advance, x, mode, commands, locked, tick, readings)
        tick += ticks + 1
        reading_ticks, command_ticks = slice(settle, ticks), slice(settle + 1, ticks + 1)
        columns = (readings[reading_ticks] - [zero[0], zero[1], 0.0, zero[3], 0.0]).T
        points.append(
            _setpoint_data(
                number,
                row,
                params,
                columns,
                commands[command_ticks],
                angle[command_ticks],
                tick - ticks,
            )
        )
    return SessionRun(_RUN_INFO, kind, kind, points, NOMINAL_CONSTANT, False, _COMPLETE_RECORD, ())


def _command_table(params: Any, row: SessionRow, mode: int, ticks: int) -> tuple[Floats, Floats]:
    """Return volts, amperes and brake amperes by tick, and the reference angle of the volts."""
    t, omega = DT * np.arange(ticks), 2.0 * np.pi / row.period
    # The cosine grows over one period, so the angle oscillates about its value at the row's start.
    ramp = 0.5 - 0.5 * np.cos(0.5 * omega * np.minimum(t, row.period))
    sine = ramp * (np.sin(omega * t) if mode == TORQUE else np.cos(omega * t))
    commands = np.zeros((ticks, 3))
    if mode == TORQUE:
        commands[:, 1] = row.amplitude * sine
        return commands, np.zeros(ticks)
    commands[:, 0] = row.amplitude * sine
    commands[:, 2] = row.brake
    if row.damping:
        torque = row.damping * NOMINAL_GAIN * np.abs(commands[:, 0])
        commands[:, 2] = np.interp(torque, params.brake.torques, params.brake.currents)
    angle = np.asarray(row.amplitude * NOMINAL_GAIN / omega * np.sin(omega * t), np.float64)
    return commands, angle


def _setpoint_data(
    number: int,
    row: SessionRow,
    params: Any,
    readings: Floats,
    commands: Floats,
    angle: Floats,
    tick: int,
) -> SetpointData:
    motor, shaft, current, torque, brake = readings
    volts, amperes = commands[:, 0].copy(), commands[:, 1].copy()
    return SetpointData(
        row=number, plan_row=row.plan_row, incomplete_reason="", lost_ticks=0, limited_ticks=0,
        period=row.period, dt=DT,
        start_time=tick * DT, wave_clock=0.0, encoder_age=0.0, tare_samples=TARE,
        motor=motor / params.sensors.motor_counts, shaft=shaft / params.sensors.shaft_counts,
        torque=torque, current=current, current_command=amperes, volts=volts, brake_current=brake,
        reference_angle=angle, reference_velocity=NOMINAL_GAIN * volts,
        reference_torque=NOMINAL_CONSTANT * amperes,
    )  # fmt: skip
