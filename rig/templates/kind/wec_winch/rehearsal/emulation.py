"""The emulated drive of the rig, with the float at its motor."""

import asyncio
from pathlib import Path
from typing import Any

from rig.config.pydantic_errors import validate
from rig.config.wiring import wiring_of
from rig.config.yaml_source import SourceMap
from rig.emulation.devices import EmulatedBus, EmulatedDevices
from rig.emulation.process import emulation_process, run_devices
from rig.processes.io_processes import IoProcess
from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.emulators.torque_drive import Motor, MotorReading

from wec_winch.config import PlantFile, RigFile
from wec_winch.rehearsal.devices import REST, Float


def emulator_process(rig: RigFile, plant: PlantFile) -> IoProcess:
    return emulation_process(f"{__package__}.emulation", rig, plant=plant.model_dump())


def emulate_rig(rig: RigFile, plant: dict[str, Any], locate: SourceMap) -> tuple[IoProcess, str]:
    return emulator_process(rig, validate(plant, locate, PlantFile)), "a float at rest"


def emulate_task(path: Path, rig: Path) -> tuple[RigFile, IoProcess, str]:
    from wec_winch.tasks import examine

    checked = examine(path, rig).checked
    assert checked is not None
    return checked.rig, emulator_process(checked.rig, checked.plant), "a float at rest"


def build_devices(
    rig: RigFile, config: dict[str, Any], loop: asyncio.AbstractEventLoop
) -> EmulatedDevices:
    world = SharedSimulation(Float(config), REST, 1.0 / rig.rate_hz, loop.time)

    def read() -> MotorReading:
        current, on = world.world.actuation
        return MotorReading(world.world.counts, current, on)

    motor = Motor(read, lambda current, enable: world.actuate(current=current, enable=enable))
    wiring = wiring_of(rig)
    bus = EmulatedBus(wiring.can, world, loop)
    bus.add_torque_drive("motor", wiring.motor, motor)
    return EmulatedDevices(
        world, {"can": bus}, bus.step, lambda: world.replace_world(Float(config)), bus.nodes
    )


if __name__ == "__main__":
    run_devices(RigFile, build_devices)
