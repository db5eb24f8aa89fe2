"""Emulated devices of a wired bench: one process, one world, on the far end of the bench's wires.

`rig sim RIG` starts it by itself, `rig bench ... --sim` as the first of a session's companions. It
knows of the rig only what its wires are: ports, addresses, units, counts of a turn.
"""

import asyncio
import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from rig.config.bench_rig_file import BenchRigFile
from rig.execution.rehearsal.addresses import impossible, taken
from rig.execution.rehearsal.bench_devices import build_bench
from rig.execution.rehearsal.bench_emulators import (
    Terminal,
    brake_amplifier,
    bridge,
    cell,
    couplers,
    servo,
)
from rig.execution.rehearsal.emulator_control import Control, Stage
from rig.execution.rehearsal.emulator_process import host, modbus_line, without_delay
from rig.kinds.oswec_bench.signals import TORQUE, VELOCITY
from rig.planning.session.files import Session
from rig.processes.io_process import report, run
from rig.processes.io_processes import IoProcess
from sim_plant.bench.world import BenchWorld
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.running import Emulator, running
from sim_plant.emulators.shared_world import SharedBench

NAME = "emulated devices"
READY_TIMEOUT_S = 30.0  # s until all devices are there: the bench is compiled first
_SLIP = math.radians(3.0)
_BENCH_FAULTS = {
    "coupling_slips": "the shaft slips by 3 deg in its coupling, and stays there",
    "brake_lost": "the brake has no current, whatever it is told",
}


def emulator_process(session: Session) -> IoProcess:
    """The emulated devices of a session's bench, as a companion of the run."""
    locked = 1 if session.file.shaft == "clamped" else 0
    return emulated_bench(session.rig, session.plant, session.file.seed, session.file.loop, locked)


def emulated_bench(
    rig: BenchRigFile, plant: dict[str, Any], seed: int, loop: str, locked: int
) -> IoProcess:
    """The emulated devices of a bench; ``loop``: which one its drive is set up for.

    ``locked`` 1: somebody has clamped the shaft.
    """
    config = {
        "rig": rig.model_dump(mode="json"),
        "plant": {"plant": plant, "seed": seed},
        "loop": loop,
        "locked": locked,
    }
    return IoProcess(
        NAME, "rig.execution.rehearsal.bench_emulation", config, (), READY_TIMEOUT_S, first=True
    )


class _Driveline:
    """What can happen to the bench itself."""

    def __init__(self) -> None:
        self.faults = DeviceFaults(_BENCH_FAULTS)
        self._slipped = False

    def happen(self, world: BenchWorld) -> None:
        """Let the world suffer it."""
        world.lose_brake(self.faults.on("brake_lost"))
        slips = self.faults.on("coupling_slips")
        if slips and not self._slipped:
            world.slip_coupling(_SLIP)
        self._slipped = slips


class EmulatedBench:
    """All devices of one bench."""

    def __init__(
        self,
        rig: BenchRigFile,
        world: SharedBench,
        anew: Callable[[], BenchWorld],
        loop: str,
        locked: int,
    ) -> None:
        """``anew`` makes a world at rest, for a restart."""
        wiring = rig.wiring
        if wiring is None:
            raise ValueError(f"{rig.name} has no wiring to hang emulated devices on")
        self._world, self._locked = world, locked
        self._mode = TORQUE if loop == "torque" else VELOCITY
        self._driveline = _Driveline()
        self._input = Terminal()
        self.bridge = bridge(rig, wiring.encoders, world)
        self.servo = servo(wiring.servo, world, self._input, self._mode)
        self.cell = cell(wiring.load_cell, world)
        self.units: dict[str, ModbusUnit] = {
            **couplers(wiring, world, self._input),
            "brake": brake_amplifier(world),
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
        self.control = Control(
            Stage(
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
                lambda: self._renew(anew),
                {"servo_drive": lambda: bool(world.actuation.enable)},
                lambda: {"reading": world.sense()._asdict()},
            )
        )

    async def serve(self, ended: asyncio.Event) -> None:
        """Be there until ``ended``; says in JSON lines when, and where."""
        self._world.actuate(mode=self._mode, locked=self._locked)
        ticking = None
        try:
            async with running(self.lines) as addresses:
                await self.control.start()
                ticking = asyncio.create_task(self._tick())
                report(event="ready", facts={"control": self.control.address, **addresses})
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
        """Move the world on with its time, and latch both encoders after every move.

        Its moves are on the grid of the loop's ticks (`rig.realtime.clock`): a frame is half a
        period on its way when a tick begins, in every run.
        """
        loop, world, dt = asyncio.get_running_loop(), self._world, self._world.dt
        due = (math.floor(loop.time() / dt) + 1) * dt
        world.start(due)
        await asyncio.sleep(due - loop.time())
        while True:
            self.servo.drive.advance(loop.time())
            self._driveline.happen(world.world)
            done = world.catch_up()
            if done > 1:
                self.bridge.skip(done - 1)
            if done > 0:
                self.bridge.pulse()
            self.control.look()
            due = max(due + dt, loop.time())
            await asyncio.sleep(due - loop.time())

    def _renew(self, anew: Callable[[], BenchWorld]) -> None:
        drive = self.servo.drive
        drive.error, drive.powered = drive.settings.errors.none, False
        self._input.volts = 0.0
        self._world.renew(anew())
        self._world.actuate(mode=self._mode, locked=self._locked)


def _guests(config: dict[str, Any], loop: asyncio.AbstractEventLoop) -> EmulatedBench:
    rig = BenchRigFile.model_validate(config["rig"])
    if rig.wiring is not None and (why := (*impossible(rig.wiring), *taken(rig.wiring))):
        raise OSError("\n".join(why))
    dt, plant = 1.0 / rig.rate_hz, without_delay(config["plant"])

    def anew() -> BenchWorld:
        return build_bench(plant, dt)

    world = SharedBench(anew(), dt, loop.time)
    return EmulatedBench(rig, world, anew, config["loop"], config["locked"])


def serve(job: dict[str, Any]) -> None:
    """Serve until told to end, or until the loop and the I/O processes have ended."""
    host(job, _guests)


if __name__ == "__main__":
    run(serve)
