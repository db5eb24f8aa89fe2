"""A WaveBot with the shipped configuration: parameters, constant devices, simulated plant."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from core_runs import plan

from controllers import signal_generator
from controllers.signals import (
    AxisCommand,
    AxisSense,
    DriveSense,
    PanelSense,
    ProbeSense,
    SpringSense,
)
from rig.campaign.record import RecordedCampaign
from rig.config.pydantic_errors import load
from rig.config.yaml_source import load_mapping
from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import CAMPAIGNS
from rig.kinds.wavebot.config import LimitsFile, RigFile
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.rehearsal.devices import WaveBotPlantDevices, connect
from rig.kinds.wavebot.tick import Command, LoadSense, PowerSense, Sense, Setpoints, WaveSense
from rig.realtime import cycle, sequence
from rig.realtime.sequence import WAIT_ARRIVAL, WAIT_DRIVE, Phase

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
DT = 0.001
READY = WAIT_ARRIVAL | WAIT_DRIVE

# Two rows at the initial stator position (490.9 N/m at -13 %): nothing has to move.
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
    count = len(kp)
    columns: dict[str, Any] = dict.fromkeys(Setpoints._fields, (0.0,) * count)
    gains = (kp, ki, (0.0,) * count)
    columns |= {"law": gains, "spring_rate": spring_rate}
    columns |= {"stroke": (0.35,) * count, "surge_kp": (-2500.0,) * count}
    columns |= {"discharge_level": (0,) * count, "realisation": (1,) * count}
    return Setpoints(**columns | {"signal": signal_generator.columns(count)})


SETPOINTS = table((-2000.0, -1000.0), (0.0, 1000.0), (490.9, 490.9))
CALM = {"kind": "calm"}
WAVES = {"kind": "regular", "amplitude_m": 0.05, "frequency_hz": 0.5}


@cache
def shipped_files() -> tuple[CampaignFile, RigFile, LimitsFile]:
    """Return a shipped campaign, its rig and its limits."""
    return (
        load(CONFIGS / "campaigns" / "quick.yaml", CampaignFile)[0],
        load(CONFIGS / "rigs" / "wavebot.yaml", RigFile)[0],
        load(CONFIGS / "limits" / "wavebot.yaml", LimitsFile)[0],
    )


def params(
    segments: sequence.Segments = SHORT, setpoints: Setpoints = SETPOINTS, **bounds: float
) -> cycle.Params:
    """Return parameters of a run; ``bounds`` replace limits outside the axes."""
    campaign = RecordedCampaign(CAMPAIGNS, *shipped_files(), points=(), record=None, seed=1)
    run_params = wavebot_params(campaign, segments, setpoints)
    inner = run_params.rig._replace(limits=run_params.rig.limits._replace(**bounds))
    return run_params._replace(rig=inner)


_OFF = AxisCommand(0.0, 0.0, 0, 0)


class Quiet:
    """Devices of a rig in still water whose body never moves, whatever the force."""

    def __init__(self) -> None:
        self.commands: list[Command] = []
        self.stops: list[int] = []
        self.closed = 0

    def warm_up(self, dt: float) -> None:
        pass

    def read(self, now: float) -> Sense:
        _, heave_current, enabled, _ = self.commands[-1].heave if self.commands else _OFF
        _, surge_current, surge, _ = self.commands[-1].surge if self.commands else _OFF
        target = self.commands[-1].spring.target if self.commands else -13.0
        return Sense(
            AxisSense(183264, 0.001, heave_current, enabled, 0, 0.001),
            AxisSense(-4711, 0.001, surge_current, surge, 0, 0.001),
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


Modifier = Callable[[int, Any], Any]


class ModifiedDevices:
    """Devices with modified signals: ``sense(tick, signals)``, ``command(tick, signals)``."""

    def __init__(
        self, inner: Any, sense: Modifier | None = None, command: Modifier | None = None
    ) -> None:
        self._inner = inner
        self._sense = sense or (lambda tick, signals: signals)
        self._command = command or (lambda tick, signals: signals)
        self.tick = -1
        self.original: list[Any] = []
        self.commands: list[Any] = []
        self.stops: list[int] = []
        self.closed = 0

    def warm_up(self, dt: float) -> None:
        self._inner.warm_up(dt)

    def read(self, now: float) -> Any:
        self.tick = round(now / DT)
        signals = self._inner.read(now)
        self.original.append(signals)
        return self._sense(self.tick, signals)

    def write(self, command: Any) -> None:
        self.commands.append(command)
        self._inner.write(self._command(self.tick, command))

    def stop(self, reason: int) -> None:
        self.stops.append(reason)
        self._inner.stop(reason)

    def close(self) -> None:
        self.closed += 1
        self._inner.close()


def plant(sea: dict[str, Any] = WAVES) -> WaveBotPlantDevices:
    """Return the simulated plant as shipped, interpreted, with a seed."""
    path = CONFIGS / "plants" / "wavebot.yaml"
    mapping, _ = load_mapping(path)
    bem = {
        "bem": str(path.parent / mapping["bem"]),
        "surge_bem": str(path.parent / mapping["surge"]["bem"]),
    }
    config = {"plant": mapping, **bem, "sea": sea, "seed": 1, "compiled": False}
    return connect(config, DT)
