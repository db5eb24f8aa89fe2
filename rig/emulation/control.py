"""The control port of the emulated devices: it switches faults and reports the world's state.

The protocol is JSON lines on a loopback TCP port, with one answer to each request; a refused
request has the answer `error`. The port is for tests and for rehearsals of faults; neither loop nor
driver uses it.

    {"request": "faults"}                 every fault of every device and link
    {"request": "switch", "device": "heave", "fault": "drive_fault", "on": true, "value": null}
    {"request": "clear"}                  all faults off
    {"request": "restart"}                all faults off, a world at rest, every node switched on
    {"request": "world"}                  power, currents and counters now
    {"request": "power"}                  by motor the time at which it lost power, null with power

The key `ask`, the earlier name of `request`, is accepted, too.
"""

import asyncio
import json
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from rig.emulation.devices import EmulatedDevices
from sim_plant.emulators.link_faults import FAULTS as LINK
from sim_plant.emulators.link_faults import SHARE, Toward
from sim_plant.emulators.link_faults import VALUES as LINK_VALUES
from sim_plant.emulators.modbus_unit import ModbusUnit

# The check sums of CAN and Ethernet reject every corrupted frame, and a babbling device on a bus is
# a node.
BUS_LINK_FAULTS = ("drop", "delay", "duplicate", "freeze", "disconnect")
_LINK_UNITS = {name: "of 1" if limits == SHARE else "s" for name, limits in LINK_VALUES.items()}
_SEVERITY_FIELDS = {"babble": "babble_period"}  # field of the severity that a fault's number sets


class ControlServer:
    """The control port; the caller must call `update_power` often."""

    def __init__(self, devices: EmulatedDevices) -> None:
        self.address = ""
        self._devices = devices
        self._server: asyncio.Server | None = None
        self._power_lost_at: dict[str, float | None] = dict.fromkeys(devices.powered, 0.0)
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
        for motor, powered in self._devices.powered.items():
            if powered():
                self._power_lost_at[motor] = None
            elif self._power_lost_at[motor] is None:
                self._power_lost_at[motor] = now

    def list_faults(self) -> dict[str, dict[str, Any]]:
        """Return every fault by device (or link) and name: effect, meaning and limits of its value.

        The limits of a fault without a value are empty.
        """
        listed: dict[str, dict[str, Any]] = {}
        for name, node in self._devices.nodes.items():
            listed[name] = {
                fault.name: {
                    "effect": fault.effect,
                    "value": fault.value,
                    "default": fault.default,
                    "limits": fault.limits if fault.value else (),
                }
                for fault in node.faults()
            }
        for name, unit in self._devices.units.items():
            listed[name] = {
                fault: {"effect": effect, "value": "", "limits": ()}
                for fault, effect in unit.faults.descriptions().items()
            }
        for name in self._devices.wires:
            listed[name] = {
                fault: {
                    "effect": effect,
                    "value": _LINK_UNITS.get(fault, ""),
                    "limits": LINK_VALUES.get(fault, ()),
                }
                for fault, effect in LINK.items()
                if name not in ("can", "ethercat") or fault in BUS_LINK_FAULTS
            }
        return listed

    def switch(self, device: str, fault: str, on: bool, value: float | None, toward: Any) -> None:
        """Switch a fault of a device or link; ValueError for an unknown one or an odd value."""
        if fault not in self.list_faults().get(device, {}):
            raise ValueError(f"{device!r} has no fault {fault!r}")
        devices = self._devices
        if device in devices.nodes:
            node = devices.nodes[device]
            if on:
                node.inject(fault, value)
            else:
                node.clear(fault)
        elif device in devices.units:
            devices.units[device].faults.switch(fault, on)
        else:
            direction: Toward | None = toward if toward in ("host", "device") else None
            link = devices.wires[device].link
            if value is not None and fault in LINK_VALUES:
                number = LINK_VALUES[fault].checked(f"{device}: {fault}", value)
                changed: dict[str, Any] = {_SEVERITY_FIELDS.get(fault, fault): number}
                link.set_severity(link.to_host.severity._replace(**changed))
            link.switch(fault, on, toward=direction)

    def clear(self) -> None:
        """Switch every fault off."""
        for node in self._devices.nodes.values():
            for name in tuple(node.active):
                node.clear(name)
        for unit in self._devices.units.values():
            unit.faults.clear()
        for wire in self._devices.wires.values():
            wire.link.clear()

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
        self._devices.restart()
        for node in self._devices.nodes.values():
            node.restart()
        return {}

    def _power(self, request: dict[str, Any]) -> dict[str, Any]:
        self.update_power()
        return {"now": asyncio.get_running_loop().time(), "gone": dict(self._power_lost_at)}

    def _world(self) -> dict[str, Any]:
        world = self._devices.world
        units = self._devices.units.items()
        return {
            **self._devices.report(),
            "time": world.time,
            "late": world.late_ticks,
            "dropped": world.dropped_ticks,
            "actuation": world.actuation._asdict(),
            "nodes": {
                name: {"state": node.state, "errors": node.error_codes}
                for name, node in self._devices.nodes.items()
            },
            "requests": {name: one.requests for name, one in units if isinstance(one, ModbusUnit)},
            "struck": {name: wire.link.counts() for name, wire in self._devices.wires.items()},
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
            kind = request["ask" if "ask" in request else "request"]
            return self._handlers[kind](request)
        except (ValueError, KeyError, TypeError) as error:
            return {"error": f"{type(error).__name__}: {error}"}
