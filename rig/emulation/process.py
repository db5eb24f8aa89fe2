"""The process of the emulated devices of any kind of rig: one event loop for one run."""

import asyncio
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from rig.config.wiring import RtuLine, TcpLine
from rig.processes.messages import IoJob, Notice, Refused, report
from rig.realtime import scheduling
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.modbus_rtu import RtuLine as RtuUnits
from sim_plant.emulators.modbus_tcp import TcpUnits
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.running import Emulator
from sim_plant.emulators.schedule import precise_loop
from sim_plant.emulators.serial_line import SerialLine, SerialLineSettings


class EmulatedDevices(Protocol):
    """All emulated devices of a rig."""

    async def serve(self, ended: asyncio.Event) -> None:
        """Serve the devices until ``ended``; report their addresses when ready."""
        ...


DeviceFactory = Callable[[dict[str, Any], asyncio.AbstractEventLoop], EmulatedDevices]

SHUTDOWN_GRACE_S = 2.0  # s after the loop's end in which I/O processes may still use the devices


def serve_devices(job: IoJob, make: DeviceFactory) -> None:
    """Serve until terminated, or until some time after the loop's end.

    An OSError of the devices is reported as a refusal.
    """
    with asyncio.Runner(loop_factory=precise_loop) as runner:
        runner.run(_serve_devices(job.config, job.lifeline, make))


async def _serve_devices(config: dict[str, Any], lifeline: int, make: DeviceFactory) -> None:
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, ended.set)

    def hung_up() -> None:  # real devices would still answer the last messages
        loop.remove_reader(lifeline)
        loop.call_later(SHUTDOWN_GRACE_S, ended.set)

    loop.add_reader(lifeline, hung_up)
    try:
        devices = make(config, loop)
        if refused := scheduling.acquire_for_emulator():
            report(Notice(f"no priority over other work: {refused}"))
        await devices.serve(ended)
    except OSError as error:  # an address is taken by another run or another rig's devices
        report(Refused(str(error)))


def modbus_line(line: TcpLine | RtuLine, units: dict[int, ModbusUnit]) -> Emulator:
    """Return a Modbus line with its units."""
    if isinstance(line, TcpLine):
        return TcpUnits(units, port=line.port)
    return RtuUnits(serial_line(line.port, line.baud, line.parity, line.stop_bits), units)


def serial_line(port: str, baud: int, parity: str, stop_bits: int) -> SerialLine:
    """Return a serial line under a path, whose missing folders are created."""
    bits = 11 if parity != "N" or stop_bits == 2 else 10
    path = Path(port)
    path.parent.mkdir(parents=True, exist_ok=True)
    return SerialLine(SerialLineSettings(path, baud, bits), LinkFaults(seed=1))


def without_delay(config: dict[str, Any]) -> dict[str, Any]:
    """Return the plant settings without fieldbus delay: emulated wires have their own."""
    sensors = config["plant"]["sensors"]
    no_delay = {**sensors["delay_ticks"], "value": 0}
    plant = {**config["plant"], "sensors": {**sensors, "delay_ticks": no_delay}}
    return {**config, "plant": plant}
