"""Benches with constants hidden from the analysis, and sessions simulated on them.

Commands are a table of ticks made beforehand, played into the compiled plant at once: no loop, no
record. What is read is a tick old, so a command stands beside what was read a tick after it.
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
_COMPLETE_RECORD = RecordState("complete", 0, 0, (), (), False)

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
"""Values of the plant file, and between which bounds each is drawn, evenly."""


class SessionRow(NamedTuple):
    """One set point: sine of the drive's command, brake current and duration."""

    plan_row: dict[str, float]
    amplitude: float  # V or A
    period: float  # s
    periods: int
    brake: float = 0.0  # A
    damping: float = 0.0  # N*m*s/rad, of the brake


def draw_constants(seed: int) -> dict[str, float]:
    """The hidden values of a bench."""
    random = np.random.default_rng(seed)
    return {name: float(random.uniform(*bounds)) for name, bounds in CONSTANT_RANGES.items()}


def build_plant(values: dict[str, float], *, with_brake: bool) -> BenchPlant:
    """A shipped bench with these values in the place of its own."""
    name = "oswec_bench" if with_brake else "oswec_bench_unbraked"
    mapping, _ = load_mapping(PLANTS / f"{name}.yaml")
    mapping["sensors"]["travel"]["value"] = 180.0  # nobody brings the shaft home between rows
    for path, value in values.items():
        section, field = path.split(".")
        mapping[section][field]["value"] = value
    return BenchPlant.model_validate(mapping)


@njit
def _run_ticks(
    advance: Any, x: Any, mode: int, wires: Any, locked: int, begin: int, out: Any
) -> None:
    for k in range(len(wires)):
        read = advance(x, 1, mode, wires[k, 0], wires[k, 1], wires[k, 2], locked, 1, 0, begin + k)
        out[k, 0], out[k, 1], out[k, 2] = read[0], read[1], read[2]
        out[k, 3], out[k, 4] = read[10], read[11]


@cache
def _compiled_step() -> Any:
    """The compiled step of a bench; compiled once, the constants are in its array."""
    params = build_plant({}, with_brake=True).build()
    start = StepperInputs(params, dynamometer.initial(params), [0.0] * NOISE_LENGTH, DT)
    return CompiledStepper(start)._compiled.code.advance


def simulate_session(
    values: dict[str, float], seed: int, kind: str, rows: list[SessionRow]
) -> SessionRun:
    """Play a session's rows, one after the other, and hand over what was read."""
    braked = kind in ("driveline", "brake_map", "torque_constant")
    params = build_plant(values, with_brake=braked).build()
    normals = np.random.default_rng(seed).standard_normal(NOISE_LENGTH).tolist()
    state = dynamometer.initial(params)
    # The array of a compiled step (rig/compilation/plant_step.py),
    # made anew; the code is one.
    x = np.array([*lifting.flatten(state), DT, *lifting.flatten(params), *normals])
    mode = TORQUE if kind == "torque_constant" else VELOCITY
    locked = 1 if kind == "torque_constant" else 0
    advance = _compiled_step()
    still = np.zeros((TARE, 5))
    _run_ticks(advance, x, mode, np.zeros((TARE, 3)), locked, 1, still)
    zero, tick, points = still.mean(axis=0), TARE + 1, []
    for number, row in enumerate(rows):
        settle = round(row.period / DT)
        ticks = settle + round(row.periods * row.period / DT)
        wires, angle = _command_table(params, row, mode, ticks + 1)
        told = np.empty((ticks + 1, 5))
        _run_ticks(advance, x, mode, wires, locked, tick, told)
        tick += ticks + 1
        there, then = slice(settle, ticks), slice(settle + 1, ticks + 1)
        columns = (told[there] - [zero[0], zero[1], 0.0, zero[3], 0.0]).T
        points.append(
            _setpoint_data(number, row, params, columns, wires[then], angle[then], tick - ticks)
        )
    return SessionRun(_RUN_INFO, kind, kind, points, NOMINAL_CONSTANT, False, _COMPLETE_RECORD, ())


def _command_table(params: Any, row: SessionRow, mode: int, ticks: int) -> tuple[Floats, Floats]:
    """Volts, amperes and amperes of the brake by tick, and the angle that volts ask for."""
    t, omega = DT * np.arange(ticks), 2.0 * np.pi / row.period
    # A cosine grown over one period: the angle then swings about where the row began.
    grown = 0.5 - 0.5 * np.cos(0.5 * omega * np.minimum(t, row.period))
    sine = grown * (np.sin(omega * t) if mode == TORQUE else np.cos(omega * t))
    wires = np.zeros((ticks, 3))
    if mode == TORQUE:
        wires[:, 1] = row.amplitude * sine
        return wires, np.zeros(ticks)
    wires[:, 0] = row.amplitude * sine
    wires[:, 2] = row.brake
    if row.damping:
        torque = row.damping * NOMINAL_GAIN * np.abs(wires[:, 0])
        wires[:, 2] = np.interp(torque, params.brake.torques, params.brake.currents)
    angle = np.asarray(row.amplitude * NOMINAL_GAIN / omega * np.sin(omega * t), np.float64)
    return wires, angle


def _setpoint_data(
    number: int, row: SessionRow, params: Any, told: Floats, wires: Floats, angle: Floats, tick: int
) -> SetpointData:
    motor, shaft, current, torque, brake = told
    volts, amperes = wires[:, 0].copy(), wires[:, 1].copy()
    return SetpointData(
        row=number, plan_row=row.plan_row, incomplete_reason="", lost_ticks=0, limited_ticks=0,
        period=row.period, dt=DT,
        start_time=tick * DT, wave_clock=0.0, encoder_age=0.0, tare_samples=TARE,
        motor=motor / params.sensors.motor_counts, shaft=shaft / params.sensors.shaft_counts,
        torque=torque, current=current, current_command=amperes, volts=volts, brake_current=brake,
        reference_angle=angle, reference_velocity=NOMINAL_GAIN * volts,
        reference_torque=NOMINAL_CONSTANT * amperes,
    )  # fmt: skip
