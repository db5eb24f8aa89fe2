"""The control port of the emulated devices: requests, their earlier key, refusals."""

from __future__ import annotations

import asyncio
import json
import socket
from typing import Any

import pytest

from rig.emulation.control import ControlServer
from rig.emulation.control_client import ControlClient
from rig.emulation.devices import EmulatedDevices
from sim_plant.emulators.fault_list import SIGNED, Fault, FaultList
from sim_plant.emulators.link_faults import LinkFaults, Severity
from sim_plant.emulators.node_faults import NODE_FAULTS


class Wire:
    """An emulated wire: faults of its link."""

    address = ""

    def __init__(self) -> None:
        self.link = LinkFaults()


class Node(FaultList):
    """The faults of an emulated node."""

    faults = FaultList.all
    inject = FaultList.begin
    clear = FaultList.end

    def __init__(self) -> None:
        super().__init__()
        self.add(
            *NODE_FAULTS, Fault("creep", "position drifts away", "counts/s", 1.0, limits=SIGNED)
        )


async def answer(
    request: Any, wire: Wire | None = None, node: Node | None = None
) -> dict[str, Any]:
    """Return the answer of a control port whose rig has one motor without power."""
    no_world: Any = None
    wires: Any = {"line": wire or Wire()}
    nodes: Any = {"heave": node or Node()}
    devices = EmulatedDevices(
        no_world, wires, int, int, nodes=nodes, powered={"pto": lambda: False}
    )
    server = ControlServer(devices)
    await server.start()
    host, port = server.address.split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    writer.write(json.dumps(request).encode() + b"\n")
    writer.write_eof()
    received = await reader.read()  # until the server has closed the connection
    writer.close()
    await writer.wait_closed()
    await server.close()
    return dict(json.loads(received))


@pytest.mark.parametrize("key", ["request", "ask"])
def test_requests_are_answered(key: str) -> None:
    assert asyncio.run(answer({key: "power"}))["gone"] == {"pto": 0.0}


@pytest.mark.parametrize(
    ("request_", "error"),
    [
        ({"request": "coffee"}, "KeyError: 'coffee'"),
        ({}, "KeyError: 'request'"),
        ([], "TypeError"),
        ({"request": "switch", "device": "pto", "fault": "silent"}, "'pto' has no fault 'silent'"),
    ],
)
def test_a_request_is_refused_with_the_reason(request_: Any, error: str) -> None:
    assert error in asyncio.run(answer(request_))["error"]


def switch(device: str, fault: str, value: object) -> dict[str, object]:
    return {"request": "switch", "device": device, "fault": fault, "value": value}


@pytest.mark.parametrize(
    ("device", "fault", "value", "allowed"),
    [
        ("line", "delay", -3, "0 .. 60"),
        ("line", "delay", 61, "0 .. 60"),
        ("line", "drop", 1.5, "0 .. 1"),
        ("line", "corrupt", -0.1, "0 .. 1"),
        ("line", "babble", 0, "0.0001 .. 60"),
        ("line", "delay", float("nan"), "0 .. 60"),
        ("heave", "tpdo_delay", -0.1, "0 .. 60"),
        ("heave", "babble", -1, "0 .. 1e+09"),
        ("heave", "creep", float("-inf"), "-1e+09 .. 1e+09"),
    ],
)
def test_a_value_outside_its_limits_is_refused(
    device: str, fault: str, value: float, allowed: str
) -> None:
    """The fault stays off, and its severity as before."""
    wire, node = Wire(), Node()
    error = asyncio.run(answer(switch(device, fault, value), wire, node))["error"]
    assert f"{fault}: {value} is out of range; allowed {allowed}" in error
    assert wire.link.to_host.severity == Severity()
    assert not wire.link.to_host.is_on(fault)
    assert not node.active
    limits = asyncio.run(answer({"request": "faults"}))["faults"][device][fault]["limits"]
    assert "{:g} .. {:g}".format(*limits) == allowed


def test_values_at_their_limits_are_taken() -> None:
    wire, node = Wire(), Node()
    cases = (("line", "delay", 0), ("line", "drop", 1), ("heave", "tpdo_delay", 60))
    for device, fault, value in (*cases, ("heave", "creep", -5)):
        assert "error" not in asyncio.run(answer(switch(device, fault, value), wire, node))
    assert (wire.link.to_host.severity.delay, wire.link.to_host.severity.drop) == (0.0, 1.0)
    assert node.active == {"tpdo_delay": 60.0, "creep": -5.0}


def test_the_client_sends_the_key_of_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    near, far = socket.socketpair()
    monkeypatch.setattr(socket, "create_connection", lambda *_, **__: near)
    with far, ControlClient("localhost:1") as client:
        far.sendall(b"{}\n")
        client.request("clear")
        assert json.loads(far.recv(1000)) == {"request": "clear"}
