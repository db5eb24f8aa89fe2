"""A WaveBot with the shipped configuration: parameters, quiet devices, the simulated plant."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from core_runs import plan

from controllers.signals import (
    AxisCommand,
    AxisSense,
    DriveSense,
    PanelSense,
    ProbeSense,
    SpringSense,
)
from rig.config import CampaignFile, LimitsFile, RigFile, load, load_mapping
from rig.execution.rehearsal.devices import PlantDevices, connect
from rig.kinds.wavebot import Command, LoadSense, PowerSense, Sense, Setpoints, WaveSense
from rig.kinds.wavebot.build import wavebot_params
from rig.realtime import cycle, sequence
from rig.realtime.sequence import WAIT_DRIVE, WAIT_STATOR, Phase

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
DT = 0.001
READY = WAIT_STATOR | WAIT_DRIVE

# Two rows at the spring's station of the start (490.9 N/m at -13 %): nothing has to travel.
SHORT = plan(
    (-1, Phase.TARE, 300, 0, 0),
    (-1, Phase.MOVING, 100, READY, 0),
    (-1, Phase.LEAD_IN, 500, 0, 0),
    (0, Phase.SETTLE, 600, 0, 0),
    (0, Phase.MEASURE, 1000, 0, 0),
    (1, Phase.SETTLE, 600, 0, 1),
    (1, Phase.MEASURE, 1000, 0, 1),
    timeout=400,
)


def table(
    kp: tuple[float, ...], ki: tuple[float, ...], spring_rate: tuple[float, ...]
) -> Setpoints:
    """Set points of heave gains (N*s/m, N/m) and spring rates (N/m); surge is damped."""
    many = len(kp)
    columns: dict[str, Any] = dict.fromkeys(Setpoints._fields, (0.0,) * many)
    columns |= {"kp": kp, "ki": ki, "spring_rate": spring_rate}
    columns |= {"stroke": (0.35,) * many, "surge_kp": (-2500.0,) * many}
    return Setpoints(**columns | {"discharge_level": (0,) * many, "realisation": (1,) * many})


SETPOINTS = table((-2000.0, -1000.0), (0.0, 1000.0), (490.9, 490.9))
CALM = {"kind": "calm"}
WAVES = {"kind": "regular", "amplitude_m": 0.05, "frequency_hz": 0.5}


@cache
def configured() -> tuple[CampaignFile, RigFile, LimitsFile]:
    """A shipped campaign, its rig and its limits."""
    return (
        load(CONFIGS / "campaigns" / "quick.yaml", CampaignFile)[0],
        load(CONFIGS / "rigs" / "wavebot.yaml", RigFile)[0],
        load(CONFIGS / "limits" / "wavebot.yaml", LimitsFile)[0],
    )


def params(
    segments: sequence.Segments = SHORT, setpoints: Setpoints = SETPOINTS, **bounds: float
) -> cycle.Params:
    """Parameters of a run; ``bounds`` replace limits of what is not an axis."""
    campaign, rig, limits = configured()
    made = wavebot_params(campaign, rig, limits, segments, setpoints)
    inner = made.rig._replace(limits=made.rig.limits._replace(**bounds))
    return made._replace(rig=inner)


_OFF = AxisCommand(0.0, 0.0, 0, 0)


class Quiet:
    """The devices of a rig in still water that stays where it is, even when it is pushed."""

    def __init__(self) -> None:
        self.commands: list[Command] = []
        self.stops: list[int] = []
        self.closed = 0

    def warm_up(self, dt: float) -> None:
        pass

    def read(self, now: float) -> Sense:
        _, push, enabled, _ = self.commands[-1].heave if self.commands else _OFF
        _, aside, surge, _ = self.commands[-1].surge if self.commands else _OFF
        target = self.commands[-1].spring.target if self.commands else -13.0
        return Sense(
            AxisSense(183264, 0.001, push, enabled, 0, 0.001),
            AxisSense(-4711, 0.001, aside, surge, 0, 0.001),
            LoadSense(15.0, -6.0, 1.0, 40.0, 42.0, 0.004, 0.0, 0.001),
            SpringSense(target, 1, 0.001),
            PowerSense(0.0, 30.0, 150.0, 0.001),
            DriveSense(1, 0, 0),
            ProbeSense(0.0, 0.0, 0.0, 0.01),
            WaveSense(0.0),
            PanelSense(0, 0, 0.001),
        )

    def write(self, command: Command) -> None:
        self.commands.append(command)

    def stop(self, reason: int) -> None:
        self.stops.append(reason)

    def close(self) -> None:
        self.closed += 1


Bend = Callable[[int, Any], Any]


class Bent:
    """Devices whose words are bent on the way: ``sense(tick, word)``, ``command(tick, word)``."""

    def __init__(self, inner: Any, sense: Bend | None = None, command: Bend | None = None) -> None:
        self._inner = inner
        self._sense = sense or (lambda tick, word: word)
        self._command = command or (lambda tick, word: word)
        self.tick = -1
        self.true: list[Any] = []
        self.commands: list[Any] = []
        self.stops: list[int] = []
        self.closed = 0

    def warm_up(self, dt: float) -> None:
        self._inner.warm_up(dt)

    def read(self, now: float) -> Any:
        self.tick = round(now / DT)
        word = self._inner.read(now)
        self.true.append(word)
        return self._sense(self.tick, word)

    def write(self, command: Any) -> None:
        self.commands.append(command)
        self._inner.write(self._command(self.tick, command))

    def stop(self, reason: int) -> None:
        self.stops.append(reason)
        self._inner.stop(reason)

    def close(self) -> None:
        self.closed += 1
        self._inner.close()


def plant(sea: dict[str, Any] = WAVES) -> PlantDevices:
    """The simulated plant as shipped, interpreted, seeded."""
    path = CONFIGS / "plants" / "wavebot.yaml"
    mapping, _ = load_mapping(path)
    bem = str(path.parent / mapping["bem"])
    config = {"plant": mapping, "bem": bem, "sea": sea, "seed": 1, "compiled": False}
    return connect(config, DT)
