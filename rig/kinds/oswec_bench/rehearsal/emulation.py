"""Emulated devices of a wired bench, on the far end of the bench's wires (`rig.emulation`)."""

import asyncio
import math
from pathlib import Path
from typing import Any

from rig.config.pydantic_errors import validate
from rig.config.yaml_source import SourceMap
from rig.emulation.devices import EmulatedDevices, modbus_lines
from rig.emulation.process import emulation_process, serve_devices, without_delay
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.rehearsal.devices import build_bench
from rig.kinds.oswec_bench.rehearsal.emulators import (
    AnalogTerminal,
    create_brake_amplifier,
    create_bridge,
    create_couplers,
    create_load_cell,
    create_servo,
)
from rig.kinds.oswec_bench.rehearsal.job import session_problems
from rig.kinds.oswec_bench.sessions.files import Session, open_session
from rig.kinds.oswec_bench.tick.signals import TORQUE, VELOCITY
from rig.processes.io_process import run_io_process
from rig.processes.io_processes import IoProcess
from rig.wires.job import wiring_of
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.world import BenchWorld
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.shared_world import SharedBench

_SLIP_ANGLE = math.radians(3.0)
_BENCH_FAULTS = {
    "coupling_slips": "the shaft slips by 3 deg in its coupling, and stays there",
    "brake_lost": "the brake has no current, whatever its command",
}


def emulator_process(session: Session) -> IoProcess:
    """Return the emulated devices of a session's bench, as an I/O process of the run."""
    file = session.file
    locked = 1 if file.shaft == "clamped" else 0
    return _emulated_bench(session.rig, session.plant, file.seed, file.loop, locked)


def emulate_rig(
    rig: BenchRigFile, plant: dict[str, Any], locate_plant: SourceMap
) -> tuple[IoProcess, str]:
    """Return the emulated devices of a bench without a session, and their setting for people.

    The servo is set up for velocity, the shaft is free. ConfigError has all problems of the plant.
    """
    validate(plant, locate_plant, BenchPlant)
    setting = "a bench at rest, its servo drive set up for velocity"
    return _emulated_bench(rig, plant, 0, "velocity", 0), setting


def emulate_task(path: Path, rig: Path) -> tuple[BenchRigFile, IoProcess, str]:
    """Return the rig of a session run on a rig file, its emulated devices and their setting."""
    session = open_session(path, session_problems, rig)
    setting = f"a bench, its servo drive set up for {session.file.loop}"
    return session.rig, emulator_process(session), setting


def _emulated_bench(
    rig: BenchRigFile, plant: dict[str, Any], seed: int, loop: str, locked: int
) -> IoProcess:
    """``loop``: the drive's control loop that is set up. ``locked`` 1: the shaft is clamped."""
    return emulation_process(
        "rig.kinds.oswec_bench.rehearsal.emulation",
        rig,
        plant={"plant": plant, "seed": seed},
        loop=loop,
        locked=locked,
    )


class _DrivelineFaults:
    """Faults of the bench's driveline."""

    def __init__(self) -> None:
        self.faults = DeviceFaults(_BENCH_FAULTS)
        self._slipped = False

    def apply(self, world: BenchWorld) -> None:
        """Apply the faults that are on to the world."""
        world.cut_brake_current(self.faults.is_on("brake_lost"))
        slips = self.faults.is_on("coupling_slips")
        if slips and not self._slipped:
            world.slip_coupling(_SLIP_ANGLE)
        self._slipped = slips


def _build_devices(
    rig: BenchRigFile, config: dict[str, Any], loop: asyncio.AbstractEventLoop
) -> EmulatedDevices:
    wiring, dt, plant = wiring_of(rig), 1.0 / rig.rate_hz, without_delay(config["plant"])
    mode = TORQUE if config["loop"] == "torque" else VELOCITY

    def create_world() -> BenchWorld:
        return build_bench(plant, dt)

    world = SharedBench(create_world(), dt, loop.time)
    world.actuate(mode=mode, locked=config["locked"])
    driveline, terminal = _DrivelineFaults(), AnalogTerminal()
    bridge = create_bridge(rig, wiring.encoders, world)
    servo = create_servo(wiring.servo, world, terminal, mode)
    cell = create_load_cell(wiring.load_cell, world)
    units: dict[str, ModbusUnit] = {
        **create_couplers(wiring, world, terminal),
        "brake": create_brake_amplifier(world),
    }
    placed = {"outputs": wiring.analog, "inputs": wiring.inputs, "brake": wiring.brake}

    def step() -> None:
        """Advance the world, and latch both encoders after every step."""
        servo.drive.advance(loop.time())
        driveline.apply(world.world)
        steps = world.catch_up()
        if steps > 1:
            bridge.skip(steps - 1)
        if steps > 0:
            bridge.pulse()

    def restart() -> None:
        drive = servo.drive
        drive.error, drive.powered = drive.settings.errors.none, False
        terminal.volts = 0.0
        world.replace_world(create_world())
        world.actuate(mode=mode, locked=config["locked"])

    return EmulatedDevices(
        world,
        {
            "encoders": bridge,
            "servo": servo,
            "load_cell": cell,
            **modbus_lines(wiring.lines, ((placed[name], unit) for name, unit in units.items())),
        },
        {
            "bridge": bridge,
            "motor_encoder": bridge.motor,
            "shaft_encoder": bridge.shaft,
            "servo_drive": servo,
            "cell": cell,
            "driveline": driveline,
            **units,
        },
        step,
        restart,
        {"servo_drive": lambda: bool(world.actuation.enable)},
        lambda: {"reading": world.sense()._asdict()},
    )


if __name__ == "__main__":
    run_io_process(lambda job: serve_devices(job, BenchRigFile, _build_devices))
