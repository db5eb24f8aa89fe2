"""A segment from a list of names, with a simulated bench behind its drives.

Names: coupler, torque_drive, position_drive, digital_in:N, digital_out:N, analog_in, encoder:N.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

from sim_plant.emulators.actuator_units import ActuatorParams
from sim_plant.emulators.eds_file import load_entries
from sim_plant.emulators.ethercat import slaves
from sim_plant.emulators.ethercat.distributed_clock import NS
from sim_plant.emulators.ethercat.flywheel_bench import (
    CarriageCommand,
    Flywheel,
    FlywheelCommand,
    FlywheelParams,
    SlidingCarriage,
    flywheel_motor,
    sliding_carriage,
)
from sim_plant.emulators.ethercat.segment import Segment
from sim_plant.emulators.ethercat.slave import Slave
from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.emulators.stator_actuator import StatorActuator
from sim_plant.emulators.torque_drive import Scaling, TorqueDrive, TorqueDriveParams
from sim_plant.units import Second, Volt

STEP: Second = 0.001  # of the simulated bench
TORQUE_EDS, POSITION_EDS = "amc_torque_drive.eds", "nanotec_actuator.eds"
SINE_VOLTS: Volt = 5.0
SINE_HZ = 1.0
DEFAULT_CHANNELS = {"digital_in": 4, "digital_out": 4, "encoder": 2}
NAMES = ("coupler", "torque_drive", "position_drive", "analog_in", *DEFAULT_CHANNELS)
MAX_CHANNELS = 16


class BenchLine:
    """Slaves by name: the nth digital input terminal is wired to the nth output terminal, encoders
    are on the flywheel of the last torque drive, analog inputs see a sine of 5 V and 1 Hz.
    """

    def __init__(self, names: Iterable[str], devices: Path, clock: Callable[[], int]) -> None:
        """`devices`: the folder of the device files. Raises ValueError for unknown names, all."""
        self.outputs: dict[str, int] = {}  # bits of each digital output terminal
        self.wheel: Flywheel | None = None  # of the last torque drive
        self.carriage: SlidingCarriage | None = None
        self._devices = devices
        self._clock = clock
        self._seconds = slaves.seconds(clock)
        self._still = SharedSimulation(SlidingCarriage(), CarriageCommand(), STEP, self._seconds)
        listed = list(names)
        problems = [problem for name in listed if (problem := _problem(name))]
        if problems or not listed:
            raise ValueError("; ".join(problems) or "a segment needs at least one slave")
        self.segment = Segment([self._slave(*each) for each in _numbered(listed)])

    def _slave(self, name: str, kind: str, channels: int) -> Slave:
        still, clock = self._still, self._clock
        if kind == "coupler":
            return slaves.coupler(name, still, clock)
        if kind == "digital_in":
            wired = name.replace("digital_in", "digital_out")
            read = partial(self._wired_bits, wired)
            return slaves.digital_input(name, channels, read, still, clock)
        if kind == "digital_out":
            return slaves.digital_output(
                name, channels, partial(self.outputs.__setitem__, name), still, clock
            )
        if kind == "analog_in":
            return slaves.analog_input(name, _sine, still, clock)
        if kind == "encoder":
            return slaves.encoder(name, [self._counts] * channels, still, clock)
        if kind == "torque_drive":
            return self._torque_drive(name)
        return self._position_drive(name)

    def _torque_drive(self, name: str) -> Slave:
        params = FlywheelParams()
        self.wheel = Flywheel(params)
        world = SharedSimulation(self.wheel, FlywheelCommand(), STEP, self._seconds)
        device = TorqueDrive(
            slaves.torque_drive_objects(load_entries(self._devices / TORQUE_EDS)),
            TorqueDriveParams(Scaling.AMC, encoder_increments=params.counts_per_turn),
            world,
            self._seconds,
            flywheel_motor(world),
        )
        return slaves.torque_drive(name, device, self._clock)

    def _position_drive(self, name: str) -> Slave:
        self.carriage = SlidingCarriage()
        world = SharedSimulation(self.carriage, CarriageCommand(), STEP, self._seconds)
        device = StatorActuator(
            slaves.position_drive_objects(load_entries(self._devices / POSITION_EDS)),
            ActuatorParams(),
            world,
            self._seconds,
            sliding_carriage(world),
        )
        return slaves.position_drive(name, device, self._clock)

    def _wired_bits(self, terminal: str) -> int:
        return self.outputs.get(terminal, 0)

    def _counts(self) -> int:
        return self.wheel.counts if self.wheel is not None else self._clock() // NS

    def report(self) -> dict[str, Any]:
        """Return frames, and the state of each slave."""
        segment = self.segment
        return {
            "frames": segment.frames,
            "malformed": segment.malformed,
            "lost": segment.lost,
            "outputs": self.outputs,
            "slaves": {
                name: {
                    "powered": slave.is_powered,
                    "state": slave.al.state.name,
                    "error": slave.al.has_error,
                    "faults": sorted(slave.active),
                    "errors": sorted(slave.device.errors.active),
                }
                for name, slave in segment.slaves.items()
            },
        }


def _sine(now: Second) -> Volt:
    return SINE_VOLTS * math.sin(2.0 * math.pi * SINE_HZ * now)


def _problem(name: str) -> str:
    kind, _, number = name.partition(":")
    if kind not in NAMES:
        return f"no slave {name!r}; there are {', '.join(NAMES)}"
    if number and kind not in DEFAULT_CHANNELS:
        return f"{name!r}: {kind} has no number of channels"
    if number and not (number.isdecimal() and 1 <= int(number) <= MAX_CHANNELS):
        return f"{name!r}: channels {number!r} are not within 1 to {MAX_CHANNELS}"
    return ""


def _numbered(names: list[str]) -> list[tuple[str, str, int]]:
    """Return name, kind and channels of each slave; the second of a kind is `kind_2`."""
    seen: dict[str, int] = {}
    numbered = []
    for name in names:
        kind, _, number = name.partition(":")
        seen[kind] = seen.get(kind, 0) + 1
        suffix = f"_{seen[kind]}" if seen[kind] > 1 else ""
        numbered.append((kind + suffix, kind, int(number or DEFAULT_CHANNELS.get(kind, 0))))
    return numbered
