"""The process of the emulated devices of any kind of rig: one world, one event loop, for one run.

`rig sim RIG` starts the process alone, a wired run with `--sim` as its first I/O process. It uses
only the wires' settings of the rig file: addresses, node numbers, units.
"""

import asyncio
import math
import signal
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

from rig.config.rig_file import BaseRigFile
from rig.emulation.addresses import occupied_addresses, unreachable_addresses
from rig.emulation.control import ControlServer
from rig.emulation.devices import EmulatedDevices
from rig.processes.io_process import run_io_process
from rig.processes.io_processes import IoProcess
from rig.processes.messages import IoJob, Notice, Ready, report
from rig.realtime import scheduling
from sim_plant.emulators.running import running
from sim_plant.emulators.schedule import precise_loop

PROCESS_NAME = "emulated devices"
READY_TIMEOUT_S = 30.0  # s until all devices are ready: the plant is compiled first
SHUTDOWN_GRACE_S = 2.0  # s after the loop's end in which I/O processes may still use the devices
_CHECK_INTERVAL_S = 0.1

R = TypeVar("R", bound=BaseRigFile)
Build = Callable[[R, dict[str, Any], asyncio.AbstractEventLoop], EmulatedDevices]
"""Builds the devices of a rig file from the configuration of the process."""


def emulation_process(module: str, rig: BaseRigFile, **config: Any) -> IoProcess:
    """Return the emulated devices of a rig as an I/O process; ``config``: JSON values for it."""
    config["rig"] = rig.model_dump(mode="json")
    return IoProcess(PROCESS_NAME, module, config, {}, READY_TIMEOUT_S, starts_first=True)


def faults_of_devices(
    build: Build[R], rig: R, config: dict[str, Any]
) -> dict[str, dict[str, dict[str, Any]]]:
    """Return every fault of the devices as their control port does, without starting them."""
    loop = asyncio.new_event_loop()  # devices take their time from one
    try:
        return ControlServer(build(rig, config, loop)).list_faults()
    finally:
        loop.close()


def run_devices(model: type[R], build: Build[R]) -> None:
    """Run the process: serve until terminated, or until some time after the loop's end."""

    def serve(job: IoJob) -> None:
        with asyncio.Runner(loop_factory=precise_loop) as runner:
            runner.run(_serve_job(job.config, job.lifeline, model, build))

    run_io_process(serve, prioritised=False)


async def _serve_job(
    config: dict[str, Any], lifeline: int, model: type[R], build: Build[R]
) -> None:
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, ended.set)

    def hung_up() -> None:  # real devices would still answer the last messages
        loop.remove_reader(lifeline)
        loop.call_later(SHUTDOWN_GRACE_S, ended.set)

    loop.add_reader(lifeline, hung_up)
    rig = model.model_validate(config["rig"])
    if rig.wiring is not None and (
        problems := (*unreachable_addresses(rig.wiring), *occupied_addresses(rig.wiring))
    ):
        raise OSError("\n".join(problems))
    devices = build(rig, config, loop)
    if refused := scheduling.acquire_for_emulator():
        report(Notice(f"no priority over other work: {refused}"))
    await _serve(devices, ended)


async def _serve(devices: EmulatedDevices, ended: asyncio.Event) -> None:
    """Serve the devices until ``ended``; report a JSON line with their addresses when ready."""
    control, stepping = ControlServer(devices), None
    try:
        async with running(devices.wires) as addresses:
            await control.start()
            stepping = asyncio.create_task(_step(devices, control))
            report(Ready({"control": control.address, **addresses}))
            while not (ended.is_set() or stepping.done()):
                with suppress(TimeoutError):
                    await asyncio.wait_for(ended.wait(), _CHECK_INTERVAL_S)
            if stepping.done():
                stepping.result()
    finally:
        if stepping is not None:
            stepping.cancel()
        await control.close()


async def _step(devices: EmulatedDevices, control: ControlServer) -> None:
    """Advance the world with the clock.

    The steps are on the grid of the loop's ticks (`rig.realtime.clock`). In every run a message
    that a device sends with a step is therefore as long on its way when a tick begins.
    """
    loop, world = asyncio.get_running_loop(), devices.world
    period = devices.ticks_per_step * world.dt
    due = (math.floor(loop.time() / period) + 1) * period
    world.start(due)
    await asyncio.sleep(due - loop.time())
    while True:
        devices.step()
        control.update_power()
        due = max(due + period, loop.time())
        await asyncio.sleep(due - loop.time())


def without_delay(config: dict[str, Any]) -> dict[str, Any]:
    """Return the plant settings without fieldbus delay: emulated wires have their own."""
    sensors = config["plant"]["sensors"]
    no_delay = {**sensors["delay_ticks"], "value": 0}
    plant = {**config["plant"], "sensors": {**sensors, "delay_ticks": no_delay}}
    return {**config, "plant": plant}
