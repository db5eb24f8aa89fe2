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


async def answer(request: Any) -> dict[str, Any]:
    """Return the answer of a control port whose rig has one motor without power."""
    no_world: Any = None
    server = ControlServer(EmulatedDevices(no_world, {}, int, int, powered={"pto": lambda: False}))
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


def test_the_client_sends_the_key_of_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    near, far = socket.socketpair()
    monkeypatch.setattr(socket, "create_connection", lambda *_, **__: near)
    with far, ControlClient("localhost:1") as client:
        far.sendall(b"{}\n")
        client.request("clear")
        assert json.loads(far.recv(1000)) == {"request": "clear"}
