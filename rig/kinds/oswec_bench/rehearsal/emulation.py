"""Emulated devices of a wired bench: one process, one world, on the far end of the bench's wires.

`rig sim RIG` starts the process alone, `rig bench ... --sim` as the first I/O process of a session.
It uses only the wires' settings of the rig file: ports, addresses, units, counts per turn.
"""

import asyncio
import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from rig.emulation.addresses import occupied_addresses, unreachable_addresses
from rig.emulation.control import ControlServer, FaultTargets
from rig.emulation.process import modbus_line, serve_devices, without_delay
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
from rig.kinds.oswec_bench.sessions.files import Session
from rig.kinds.oswec_bench.tick.signals import TORQUE, VELOCITY
from rig.processes.io_process import run_io_process
from rig.processes.io_processes import IoProcess
from rig.processes.messages import IoJob, Ready, report
from sim_plant.bench.world import BenchWorld
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.running import Emulator, running
from sim_plant.emulators.shared_world import SharedBench

PROCESS_NAME = "emulated devices"
READY_TIMEOUT_S = 30.0  # s until all devices are ready: the bench is compiled first
_SLIP_ANGLE = math.radians(3.0)
_BENCH_FAULTS = {
    "coupling_slips": "the shaft slips by 3 deg in its coupling, and stays there",
    "brake_lost": "the brake has no current, whatever its command",
}


def emulator_process(session: Session) -> IoProcess:
    """Return the emulated devices of a session's bench, as an I/O process of the run."""
    locked = 1 if session.file.shaft == "clamped" else 0
    return emulated_bench_process(
        session.rig, session.plant, session.file.seed, session.file.loop, locked
    )


def emulated_bench_process(
    rig: BenchRigFile, plant: dict[str, Any], seed: int, loop: str, locked: int
) -> IoProcess:
    """Return the emulated devices of a bench as an I/O process.

    ``loop``: the control loop that its drive is set up for. ``locked`` 1: the shaft is clamped.
    """
    config = {
        "rig": rig.model_dump(mode="json"),
        "plant": {"plant": plant, "seed": seed},
        "loop": loop,
        "locked": locked,
    }
    return IoProcess(
        PROCESS_NAME,
        "rig.kinds.oswec_bench.rehearsal.emulation",
        config,
        (),
        READY_TIMEOUT_S,
        starts_first=True,
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


class EmulatedBench:
    """All devices of one bench."""

    def __init__(
        self,
        rig: BenchRigFile,
        world: SharedBench,
        create_world: Callable[[], BenchWorld],
        loop: str,
        locked: int,
    ) -> None:
        """``create_world`` returns a world at rest, for a restart."""
        wiring = rig.wiring
        if wiring is None:
            raise ValueError(f"{rig.name} has no wiring to hang emulated devices on")
        self._world, self._locked = world, locked
        self._mode = TORQUE if loop == "torque" else VELOCITY
        self._driveline = _DrivelineFaults()
        self._input = AnalogTerminal()
        self.bridge = create_bridge(rig, wiring.encoders, world)
        self.servo = create_servo(wiring.servo, world, self._input, self._mode)
        self.cell = create_load_cell(wiring.load_cell, world)
        self.units: dict[str, ModbusUnit] = {
            **create_couplers(wiring, world, self._input),
            "brake": create_brake_amplifier(world),
        }
        placed = {"outputs": wiring.analog, "inputs": wiring.inputs, "brake": wiring.brake}
        lines = {
            f"line {name}": modbus_line(
                line,
                {
                    placed[one].unit: unit
                    for one, unit in self.units.items()
                    if placed[one].line == name
                },
            )
            for name, line in wiring.lines.items()
        }
        self.lines: dict[str, Emulator] = {
            "encoders": self.bridge, "servo": self.servo, "load_cell": self.cell, **lines,
        }  # fmt: skip
        self.control = ControlServer(
            FaultTargets(
                {},
                {
                    "bridge": self.bridge,
                    "motor_encoder": self.bridge.motor,
                    "shaft_encoder": self.bridge.shaft,
                    "servo_drive": self.servo,
                    "cell": self.cell,
                    "driveline": self._driveline,
                    **self.units,
                },
                {name: one.link for name, one in self.lines.items()},
                world,
                lambda: self._renew(create_world),
                {"servo_drive": lambda: bool(world.actuation.enable)},
                lambda: {"reading": world.sense()._asdict()},
            )
        )

    async def serve(self, ended: asyncio.Event) -> None:
        """Serve the devices until ``ended``; report their addresses when ready."""
        self._world.actuate(mode=self._mode, locked=self._locked)
        ticking = None
        try:
            async with running(self.lines) as addresses:
                await self.control.start()
                ticking = asyncio.create_task(self._tick())
                report(Ready({"control": self.control.address, **addresses}))
                while not (ended.is_set() or ticking.done()):
                    with suppress(TimeoutError):
                        await asyncio.wait_for(ended.wait(), 0.1)
                if ticking.done():
                    ticking.result()
        finally:
            if ticking is not None:
                ticking.cancel()
            await self.control.close()

    async def _tick(self) -> None:
        """Advance the world with the clock, and latch both encoders after every step.

        The steps are on the grid of the loop's ticks (`rig.realtime.clock`). In every run a frame
        is therefore half a period on its way when a tick begins.
        """
        loop, world, dt = asyncio.get_running_loop(), self._world, self._world.dt
        due = (math.floor(loop.time() / dt) + 1) * dt
        world.start(due)
        await asyncio.sleep(due - loop.time())
        while True:
            self.servo.drive.advance(loop.time())
            self._driveline.apply(world.world)
            steps = world.catch_up()
            if steps > 1:
                self.bridge.skip(steps - 1)
            if steps > 0:
                self.bridge.pulse()
            self.control.update_power()
            due = max(due + dt, loop.time())
            await asyncio.sleep(due - loop.time())

    def _renew(self, create_world: Callable[[], BenchWorld]) -> None:
        drive = self.servo.drive
        drive.error, drive.powered = drive.settings.errors.none, False
        self._input.volts = 0.0
        self._world.replace_world(create_world())
        self._world.actuate(mode=self._mode, locked=self._locked)


def _create_devices(config: dict[str, Any], loop: asyncio.AbstractEventLoop) -> EmulatedBench:
    rig = BenchRigFile.model_validate(config["rig"])
    if rig.wiring is not None and (
        problems := (*unreachable_addresses(rig.wiring), *occupied_addresses(rig.wiring))
    ):
        raise OSError("\n".join(problems))
    dt, plant = 1.0 / rig.rate_hz, without_delay(config["plant"])

    def create_world() -> BenchWorld:
        return build_bench(plant, dt)

    world = SharedBench(create_world(), dt, loop.time)
    return EmulatedBench(rig, world, create_world, config["loop"], config["locked"])


def serve(job: IoJob) -> None:
    """Serve until terminated, or until the loop and the I/O processes have ended."""
    serve_devices(job, _create_devices)


if __name__ == "__main__":
    run_io_process(serve)
