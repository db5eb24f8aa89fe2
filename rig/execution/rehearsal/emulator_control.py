"""The control port of the emulated devices: faults on and off, and what the world does.

JSON lines on a loopback TCP port, one answer to each request, an `error` in place of one that
cannot be heeded. It is for tests and for people who rehearse with a fault; neither loop nor driver
knows of it.

    {"ask": "faults"}                     every fault of every device and link
    {"ask": "switch", "device": "heave", "fault": "drive_fault", "on": true, "value": null}
    {"ask": "clear"}                      all faults off
    {"ask": "restart"}                    all faults off, a world at rest, every node switched on
    {"ask": "world"}                      power, currents and counters now
    {"ask": "power"}                      by motor when it was found without power, null with it
"""

import asyncio
import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple, Protocol

from sim_plant.emulators.canopen_node import CanopenNode
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.link_faults import FAULTS as LINK
from sim_plant.emulators.link_faults import LinkFaults, Toward
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.shared_world import Shared

# A CAN controller's check sum lets no spoilt frame through, and who babbles on a bus is a node.
CAN_LINK = ("drop", "delay", "duplicate", "freeze", "disconnect")
_SETS = {"babble": "babble_period"}  # field of the severity that a fault's number sets
_NUMBERLESS = ("freeze", "disconnect")


class Faulty(Protocol):
    """A device that keeps its own list of faults."""

    @property
    def faults(self) -> DeviceFaults:
        """The list."""
        ...


class Stage(NamedTuple):
    """What can be given a fault, by name."""

    nodes: Mapping[str, CanopenNode]
    units: Mapping[str, Faulty]
    links: Mapping[str, LinkFaults]
    world: Shared[Any, Any]
    renew: Callable[[], None]  # a world at rest in place of the present one
    powered: Mapping[str, Callable[[], bool]]  # whether each motor has power
    told: Callable[[], dict[str, Any]]  # what else is to be known of the world


class Control:
    """The port; `look` is to be called often."""

    def __init__(self, stage: Stage) -> None:
        self.address = ""
        self._stage = stage
        self._server: asyncio.Server | None = None
        self._gone: dict[str, float | None] = dict.fromkeys(stage.powered, 0.0)
        self._asks: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
            "faults": lambda asked: {"faults": self.listed()},
            "switch": self._switch,
            "clear": self._clear,
            "restart": self._restart,
            "world": lambda asked: self._world(),
            "power": self._power,
        }

    async def start(self) -> None:
        """Listen on a free port of loopback; `address` then says which."""
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        host, port = self._server.sockets[0].getsockname()[:2]
        self.address = f"{host}:{port}"

    async def close(self) -> None:
        """Listen no longer."""
        if self._server is not None:
            self._server.close()

    def look(self) -> None:
        """Note which motors have power now: what is told of them is never too early."""
        now = asyncio.get_running_loop().time()
        for motor, powered in self._stage.powered.items():
            if powered():
                self._gone[motor] = None
            elif self._gone[motor] is None:
                self._gone[motor] = now

    def listed(self) -> dict[str, dict[str, Any]]:
        """Every fault by device (or link) and name: what it does, and what its number means."""
        found: dict[str, dict[str, Any]] = {}
        for name, node in self._stage.nodes.items():
            found[name] = {
                fault.name: {"effect": fault.effect, "value": fault.value, "default": fault.default}
                for fault in node.faults()
            }
        for name, unit in self._stage.units.items():
            found[name] = {
                fault: {"effect": effect, "value": ""}
                for fault, effect in unit.faults.listed().items()
            }
        for name in self._stage.links:
            found[name] = {
                fault: {
                    "effect": effect,
                    "value": "" if fault in _NUMBERLESS else "share or s",
                }
                for fault, effect in LINK.items()
                if name != "can" or fault in CAN_LINK
            }
        return found

    def switch(self, device: str, fault: str, on: bool, value: float | None, toward: Any) -> None:
        """Switch a fault of a device or link; ValueError for what is not there."""
        if fault not in self.listed().get(device, {}):
            raise ValueError(f"{device!r} has no fault {fault!r}")
        stage = self._stage
        if device in stage.nodes:
            node = stage.nodes[device]
            if on:
                node.inject(fault, value)
            else:
                node.clear(fault)
        elif device in stage.units:
            stage.units[device].faults.switch(fault, on)
        else:
            way: Toward | None = toward if toward in ("host", "device") else None
            link = stage.links[device]
            if value is not None and fault not in _NUMBERLESS:
                changed: dict[str, Any] = {_SETS.get(fault, fault): value}
                link.set_severity(link.to_host.severity._replace(**changed))
            link.switch(fault, on, toward=way)

    def clear(self) -> None:
        """Switch every fault off."""
        for node in self._stage.nodes.values():
            for name in tuple(node.active):
                node.clear(name)
        for unit in self._stage.units.values():
            unit.faults.clear()
        for link in self._stage.links.values():
            link.clear()

    def _switch(self, asked: dict[str, Any]) -> dict[str, Any]:
        at = asyncio.get_running_loop().time()
        device, fault, on = str(asked["device"]), str(asked["fault"]), bool(asked.get("on", True))
        self.switch(device, fault, on, asked.get("value"), asked.get("toward"))
        self.look()
        return {"at": at}

    def _clear(self, asked: dict[str, Any]) -> dict[str, Any]:
        self.clear()
        return {}

    def _restart(self, asked: dict[str, Any]) -> dict[str, Any]:
        self.clear()
        self._stage.renew()
        for node in self._stage.nodes.values():
            node.inject("powered_off")
            node.clear("powered_off")
        return {}

    def _power(self, asked: dict[str, Any]) -> dict[str, Any]:
        self.look()
        return {"now": asyncio.get_running_loop().time(), "gone": dict(self._gone)}

    def _world(self) -> dict[str, Any]:
        world = self._stage.world
        units = self._stage.units.items()
        return {
            **self._stage.told(),
            "time": world.time,
            "late": world.late,
            "dropped": world.dropped,
            "actuation": world.actuation._asdict(),
            "nodes": {
                name: {"state": node.port.nmt, "errors": sorted(map(int, node.errors.active))}
                for name, node in self._stage.nodes.items()
            },
            "requests": {name: one.requests for name, one in units if isinstance(one, ModbusUnit)},
            "struck": {name: link.counts() for name, link in self._stage.links.items()},
        }

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError):
            while line := await reader.readline():
                writer.write(json.dumps(self._answer(line)).encode() + b"\n")
                await writer.drain()
        writer.close()

    def _answer(self, line: bytes) -> dict[str, Any]:
        try:
            asked = json.loads(line)
            return self._asks[asked["ask"]](asked)
        except (ValueError, KeyError, TypeError) as error:
            return {"error": f"{type(error).__name__}: {error}"}
