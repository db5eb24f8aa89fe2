"""The process of a rig's emulated devices, whatever rig it is: one event loop, until it is time."""

import asyncio
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from rig import realtime
from rig.companion_process import say
from rig.config.wiring import RtuLine, TcpLine
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.modbus_rtu import RtuLine as RtuUnits
from sim_plant.emulators.modbus_tcp import TcpUnits
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.running import Emulator
from sim_plant.emulators.schedule import precise_loop
from sim_plant.emulators.serial_line import LineSettings, SerialLine


class Guests(Protocol):
    """All emulated devices of a rig."""

    async def serve(self, ended: asyncio.Event) -> None:
        """Be there until ``ended``; says in JSON lines when, and where."""
        ...


Make = Callable[[dict[str, Any], asyncio.AbstractEventLoop], Guests]


def host(job: dict[str, Any], make: Make) -> None:
    """Serve until told to end, or left alone; an OSError of the guests is told as a refusal."""
    with asyncio.Runner(loop_factory=precise_loop) as runner:
        runner.run(_host(job["config"], job["supervisor"], make))


async def _host(config: dict[str, Any], supervisor: int, make: Make) -> None:
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, ended.set)

    def look() -> None:
        if supervisor and os.getppid() != supervisor:
            ended.set()
        loop.call_later(0.5, look)

    try:
        guests = make(config, loop)
        look()
        if refused := realtime.beside_the_loop():
            say(event="say", text=f"no priority over other work: {refused}")
        await guests.serve(ended)
    except OSError as error:  # an address is taken: another run, or another rig's devices
        say(event="refused", why=str(error))


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
