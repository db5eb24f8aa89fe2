"""The control port of the emulated devices: it switches faults and reports the world's state.

The protocol is JSON lines on a loopback TCP port, with one answer to each request; a refused
request has the answer `error`. The port is for tests and for rehearsals of faults; neither loop nor
driver uses it.

    {"ask": "faults"}                     every fault of every device and link
    {"ask": "switch", "device": "heave", "fault": "drive_fault", "on": true, "value": null}
    {"ask": "clear"}                      all faults off
    {"ask": "restart"}                    all faults off, a world at rest, every node switched on
    {"ask": "world"}                      power, currents and counters now
    {"ask": "power"}                      by motor the time at which it lost power, null with power
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
from sim_plant.emulators.shared_world import SharedSimulation

# A CAN controller's check sum rejects every corrupted frame, and a babbling device on a bus is a
# node.
CAN_LINK_FAULTS = ("drop", "delay", "duplicate", "freeze", "disconnect")
_SEVERITY_FIELDS = {"babble": "babble_period"}  # field of the severity that a fault's number sets
_WITHOUT_VALUE = ("freeze", "disconnect")


class HasFaults(Protocol):
    """A device with its own list of faults."""

    @property
    def faults(self) -> DeviceFaults:
        """The faults of the device."""
        ...


class FaultTargets(NamedTuple):
    """The devices and links that can have faults, by name, and their world."""

    nodes: Mapping[str, CanopenNode]
    units: Mapping[str, HasFaults]
    links: Mapping[str, LinkFaults]
    world: SharedSimulation[Any, Any]
    restart_world: Callable[[], None]  # replace the present world by one at rest
    powered: Mapping[str, Callable[[], bool]]  # by motor: whether it has power
    report: Callable[[], dict[str, Any]]  # further values for the answer to "world"


class ControlServer:
    """The control port; the caller must call `update_power` often."""

    def __init__(self, targets: FaultTargets) -> None:
        self.address = ""
        self._targets = targets
        self._server: asyncio.Server | None = None
        self._power_lost_at: dict[str, float | None] = dict.fromkeys(targets.powered, 0.0)
        self._handlers: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
            "faults": lambda request: {"faults": self.list_faults()},
            "switch": self._switch,
            "clear": self._clear,
            "restart": self._restart,
            "world": lambda request: self._world(),
            "power": self._power,
        }

    async def start(self) -> None:
        """Listen on a free loopback port and set `address` to it."""
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        host, port = self._server.sockets[0].getsockname()[:2]
        self.address = f"{host}:{port}"

    async def close(self) -> None:
        """Stop listening."""
        if self._server is not None:
            self._server.close()

    def update_power(self) -> None:
        """Update when each motor lost power; the reported times are never too early."""
        now = asyncio.get_running_loop().time()
        for motor, powered in self._targets.powered.items():
            if powered():
                self._power_lost_at[motor] = None
            elif self._power_lost_at[motor] is None:
                self._power_lost_at[motor] = now

    def list_faults(self) -> dict[str, dict[str, Any]]:
        """Return every fault by device (or link) and name: its effect and its value's meaning."""
        listed: dict[str, dict[str, Any]] = {}
        for name, node in self._targets.nodes.items():
            listed[name] = {
                fault.name: {"effect": fault.effect, "value": fault.value, "default": fault.default}
                for fault in node.faults()
            }
        for name, unit in self._targets.units.items():
            listed[name] = {
                fault: {"effect": effect, "value": ""}
                for fault, effect in unit.faults.descriptions().items()
            }
        for name in self._targets.links:
            listed[name] = {
                fault: {
                    "effect": effect,
                    "value": "" if fault in _WITHOUT_VALUE else "share or s",
                }
                for fault, effect in LINK.items()
                if name != "can" or fault in CAN_LINK_FAULTS
            }
        return listed

    def switch(self, device: str, fault: str, on: bool, value: float | None, toward: Any) -> None:
        """Switch a fault of a device or link; ValueError for an unknown one."""
        if fault not in self.list_faults().get(device, {}):
            raise ValueError(f"{device!r} has no fault {fault!r}")
        targets = self._targets
        if device in targets.nodes:
            node = targets.nodes[device]
            if on:
                node.inject(fault, value)
            else:
                node.clear(fault)
        elif device in targets.units:
            targets.units[device].faults.switch(fault, on)
        else:
            direction: Toward | None = toward if toward in ("host", "device") else None
            link = targets.links[device]
            if value is not None and fault not in _WITHOUT_VALUE:
                changed: dict[str, Any] = {_SEVERITY_FIELDS.get(fault, fault): value}
                link.set_severity(link.to_host.severity._replace(**changed))
            link.switch(fault, on, toward=direction)

    def clear(self) -> None:
        """Switch every fault off."""
        for node in self._targets.nodes.values():
            for name in tuple(node.active):
                node.clear(name)
        for unit in self._targets.units.values():
            unit.faults.clear()
        for link in self._targets.links.values():
            link.clear()

    def _switch(self, request: dict[str, Any]) -> dict[str, Any]:
        at = asyncio.get_running_loop().time()
        device, fault, on = (
            str(request["device"]),
            str(request["fault"]),
            bool(request.get("on", True)),
        )
        self.switch(device, fault, on, request.get("value"), request.get("toward"))
        self.update_power()
        return {"at": at}

    def _clear(self, request: dict[str, Any]) -> dict[str, Any]:
        self.clear()
        return {}

    def _restart(self, request: dict[str, Any]) -> dict[str, Any]:
        self.clear()
        self._targets.restart_world()
        for node in self._targets.nodes.values():
            node.inject("powered_off")
            node.clear("powered_off")
        return {}

    def _power(self, request: dict[str, Any]) -> dict[str, Any]:
        self.update_power()
        return {"now": asyncio.get_running_loop().time(), "gone": dict(self._power_lost_at)}

    def _world(self) -> dict[str, Any]:
        world = self._targets.world
        units = self._targets.units.items()
        return {
            **self._targets.report(),
            "time": world.time,
            "late": world.late_ticks,
            "dropped": world.dropped_ticks,
            "actuation": world.actuation._asdict(),
            "nodes": {
                name: {"state": node.port.nmt, "errors": sorted(map(int, node.errors.active))}
                for name, node in self._targets.nodes.items()
            },
            "requests": {name: one.requests for name, one in units if isinstance(one, ModbusUnit)},
            "struck": {name: link.counts() for name, link in self._targets.links.items()},
        }

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError):
            while line := await reader.readline():
                writer.write(json.dumps(self._answer(line)).encode() + b"\n")
                await writer.drain()
        writer.close()

    def _answer(self, line: bytes) -> dict[str, Any]:
        try:
            request = json.loads(line)
            return self._handlers[request["ask"]](request)
        except (ValueError, KeyError, TypeError) as error:
            return {"error": f"{type(error).__name__}: {error}"}
