"""The process of a rig's emulated devices, whatever rig it is: one event loop, until it is time."""

import asyncio
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from rig.config.wiring import RtuLine, TcpLine
from rig.processes.io_process import report
from rig.realtime import scheduling
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.modbus_rtu import RtuLine as RtuUnits
from sim_plant.emulators.modbus_tcp import TcpUnits
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.running import Emulator
from sim_plant.emulators.schedule import precise_loop
from sim_plant.emulators.serial_line import LineSettings, SerialLine


class EmulatedDevices(Protocol):
    """All emulated devices of a rig."""

    async def serve(self, ended: asyncio.Event) -> None:
        """Be there until ``ended``; says in JSON lines when, and where."""
        ...


Make = Callable[[dict[str, Any], asyncio.AbstractEventLoop], EmulatedDevices]

SHUTDOWN_GRACE_S = (
    2.0  # s after the loop's end in which I/O processes may still speak to the devices
)


def host(job: dict[str, Any], make: Make) -> None:
    """Serve until terminated, or until some time after the loop's end.

    An OSError of the devices is reported as a refusal.
    """
    with asyncio.Runner(loop_factory=precise_loop) as runner:
        runner.run(_host(job["config"], job["lifeline"], make))


async def _host(config: dict[str, Any], lifeline: int, make: Make) -> None:
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, ended.set)

    def hung_up() -> None:  # real devices would still be there for the last words
        loop.remove_reader(lifeline)
        loop.call_later(SHUTDOWN_GRACE_S, ended.set)

    loop.add_reader(lifeline, hung_up)
    try:
        guests = make(config, loop)
        if refused := scheduling.acquire_for_emulator():
            report(event="say", text=f"no priority over other work: {refused}")
        await guests.serve(ended)
    except OSError as error:  # an address is taken: another run, or another rig's devices
        report(event="refused", why=str(error))


def modbus_line(line: TcpLine | RtuLine, units: dict[int, ModbusUnit]) -> Emulator:
    """A Modbus line with the units that hang on it."""
    if isinstance(line, TcpLine):
        return TcpUnits(units, port=line.port)
    return RtuUnits(serial_line(line.port, line.baud, line.parity, line.stop_bits), units)


def serial_line(port: str, baud: int, parity: str, stop_bits: int) -> SerialLine:
    """A serial line under a path, which is made as far as it is not there."""
    bits = 11 if parity != "N" or stop_bits == 2 else 10
    path = Path(port)
    path.parent.mkdir(parents=True, exist_ok=True)
    return SerialLine(LineSettings(path, baud, bits), LinkFaults(seed=1))


def without_delay(config: dict[str, Any]) -> dict[str, Any]:
    """The plant with its fieldbus taken out: here the wires are real and delay by themselves."""
    sensors = config["plant"]["sensors"]
    at_once = {**sensors["delay_ticks"], "value": 0}
    plant = {**config["plant"], "sensors": {**sensors, "delay_ticks": at_once}}
    return {**config, "plant": plant}
