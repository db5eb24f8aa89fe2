"""A bench with the shipped configuration: parameters, motionless devices, the simulated bench."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any

from core_runs import plan

from controllers.oswec_position import Components, EnvelopeTimes
from controllers.signals import PanelSense
from rig.config.yaml_source import load_mapping
from rig.kinds.oswec_bench.rehearsal.devices import BenchPlantDevices, connect
from rig.kinds.oswec_bench.sessions.assemble import bench_params
from rig.kinds.oswec_bench.sessions.files import open_session
from rig.kinds.oswec_bench.sessions.plan import NO_FLUME, Setpoint, plan_session, setpoint_table
from rig.kinds.oswec_bench.tick import Sense
from rig.kinds.oswec_bench.tick.signals import (
    BrakeSense,
    Command,
    EncoderSense,
    ServoSense,
    Setpoints,
    WrenchSense,
)
from rig.realtime import cycle, safety, sequence
from rig.realtime.sequence import WAIT_DRIVE, Phase

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
DT = 0.001


def cosine(amplitude: float, period: float, phase: float = 0.0) -> Components:
    """Return a reference of one cosine (rad or N*m, s, rad) without correction."""
    return Components((amplitude,), (2.0 * math.pi / period,), (phase,), (1.0,), (0.0,))


VELOCITY_REFERENCE = cosine(math.radians(5.0), 0.4)
TORQUE_REFERENCE = cosine(20.0, 0.4, -0.5 * math.pi)
SHORT_ROW = EnvelopeTimes(0.1, 0.8)

SHORT_PLAN = plan(
    (-1, Phase.TARE, 60, 0, 0),
    (0, Phase.MOVING, 200, WAIT_DRIVE, 0),
    (0, Phase.SETTLE, 400, 0, 0),
    (0, Phase.MEASURE, 400, 0, 0),
    (0, Phase.TAIL, 100, 0, 0),
)
QUICK_SAFETY = safety.Params(enable_ticks=300, stop_ticks=200)


def setpoints(
    components: Components = VELOCITY_REFERENCE,
    damping: float = 60.0,
    brake_current: float = 0.0,
    span: EnvelopeTimes = SHORT_ROW,
) -> Setpoints:
    """Return a table of one set point."""
    return setpoint_table((Setpoint(components, span, damping, brake_current, NO_FLUME),))


@cache
def shipped_params(name: str) -> cycle.Params:
    """Return the parameters of a shipped session."""
    session = open_session(CONFIGS / "sessions" / f"{name}.yaml")
    return bench_params(session, plan_session(session))


def params(
    components: Components = VELOCITY_REFERENCE,
    segments: sequence.Segments = SHORT_PLAN,
    name: str = "driveline_short",
    **changes: Any,
) -> cycle.Params:
    """Return parameters of a short run with one set point; ``changes`` replace the kind's own."""
    base = shipped_params(name)
    rig_params = base.rig._replace(**{"setpoints": setpoints(components), **changes})
    return base._replace(rig=rig_params, segments=segments, safety=QUICK_SAFETY)


class Quiet:
    """Devices of a bench whose shaft stands still whatever the command."""

    def __init__(self) -> None:
        self.commands: list[Command] = []

    def read(self, now: float) -> Sense:
        enabled = self.commands[-1].enable if self.commands else 0
        brake = self.commands[-1].brake_current if self.commands else 0.0
        return Sense(
            EncoderSense(31415, -2718, 0.001),
            ServoSense(0.1, enabled, 0, 0.001),
            WrenchSense(1.0, -2.0, 3.0, 0.1, -0.2, 0.12, 0.001),
            BrakeSense(brake, 0.001),
            PanelSense(0, 0, 0.001),
        )

    def write(self, command: Command) -> None:
        self.commands.append(command)

    def stop(self, reason: int) -> None:
        """Nothing moves."""

    def close(self) -> None:
        """Nothing to release."""


def simulated_bench(name: str = "oswec_bench") -> BenchPlantDevices:
    """Return the simulated bench as shipped, interpreted, with a fixed seed."""
    mapping, _ = load_mapping(CONFIGS / "plants" / f"{name}.yaml")
    return connect({"plant": mapping, "seed": 1, "compiled": False}, DT)
