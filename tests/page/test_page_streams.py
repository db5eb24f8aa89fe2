"""Live streams: datagrams for PlotJuggler, the WebSocket of Foxglove; nobody is waited for."""

from __future__ import annotations

import json
import socket
import struct
import time
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from websockets.sync.client import connect

from controllers.signals import Count, Metre, Second, Tick
from rig.page.streams import Foxglove, PlotJuggler, StreamError
from rig.page.subject import replay
from rig.recording.row_layout import schema

START = 1_800_000_000 * 10**9  # ns


class Motion(NamedTuple):
    position: Metre
    speed: Annotated[float, "m/s"]


class Row(NamedTuple):
    tick: Tick
    time: Second
    body: Motion
    count: Count
    tick_end: Tick


SCHEMA = schema(Row)


def rows(first: int, count: int) -> Any:
    """Return rows whose position is a tenth of the tick; the speed is not a number."""
    ticks = np.arange(first, first + count, dtype=float)
    return np.stack([ticks, 1e-3 * ticks, 0.1 * ticks, np.full(count, np.nan), -ticks, ticks], 1)


@pytest.fixture
def receiver() -> Any:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        udp.settimeout(5.0)
        yield udp


def test_datagrams_have_nested_fields_and_the_time(receiver: socket.socket) -> None:
    address = f"127.0.0.1:{receiver.getsockname()[1]}"
    stream = PlotJuggler(address, SCHEMA.leaves, 100.0, 1e-3)
    stream.send(rows(0, 25))
    got = [json.loads(receiver.recv(65_536)) for _ in range(3)]
    assert [each["timestamp"] for each in got] == [0.0, 0.01, 0.02]
    assert got[2]["body"] == {"position": pytest.approx(2.0)}  # JSON has no NaN
    assert (got[2]["tick"], got[2]["count"]) == (20, -20)
    stream.send(rows(25, 6))  # the interval counts ticks, whatever a poll brings
    assert json.loads(receiver.recv(65_536))["tick"] == 30
    assert stream.lost == 0
    stream.close()


def test_a_receiver_that_is_gone_or_does_not_read_is_not_waited_for(
    receiver: socket.socket,
) -> None:
    address = f"127.0.0.1:{receiver.getsockname()[1]}"
    stream = PlotJuggler(address, SCHEMA.leaves, 1000.0, 1e-3)
    began = time.monotonic()
    stream.send(rows(0, 20_000))  # more than the receiver's buffer
    receiver.close()
    stream.send(rows(20_000, 2000))
    assert time.monotonic() - began < 20.0
    stream.close()


@pytest.mark.parametrize("address", ["", "9870", "here:no", "no.such.host.invalid:1"])
def test_an_address_that_is_none_is_refused(address: str) -> None:
    with pytest.raises(StreamError, match="not HOST:PORT"):
        PlotJuggler(address, SCHEMA.leaves, 100.0, 1e-3)


def listen(port: int) -> Any:
    return connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"])  # type: ignore[list-item]


def until_message(client: Any) -> bytes:
    """Return the next binary message with data."""
    while True:
        message = client.recv(timeout=10)
        if isinstance(message, bytes) and message[0] == 1:
            return message


def subscribe(client: Any) -> dict[str, Any]:
    """Subscribe to the rows and return the advertised channel."""
    while True:
        message = client.recv(timeout=10)
        if isinstance(message, str) and json.loads(message)["op"] == "advertise":
            channel: dict[str, Any] = json.loads(message)["channels"][0]
            break
    subscription = {"id": 1, "channelId": channel["id"]}
    client.send(json.dumps({"op": "subscribe", "subscriptions": [subscription]}))
    return channel


def test_a_foxglove_client_gets_rows_as_in_the_mcap_file() -> None:
    stream = Foxglove(0, SCHEMA, lambda: START)
    try:
        with listen(stream.port) as client:
            channel = subscribe(client)
            assert (channel["topic"], channel["encoding"]) == ("/rows", "cdr")
            assert channel["schema"] == SCHEMA.text
            assert channel["schemaEncoding"] == "ros2msg"
            deadline, message = time.monotonic() + 10, b""
            while not message and time.monotonic() < deadline:  # until the subscription is there
                stream.send(rows(7, 1))
                try:
                    message = client.recv(timeout=0.2)
                except TimeoutError:
                    continue
                message = message if isinstance(message, bytes) and message[0] == 1 else b""
        _, _, log_time = struct.unpack_from("<BIQ", message)
        assert log_time == START + 7_000_000
        body = message[13:]
        assert body[:4] == b"\x00\x01\x00\x00"
        tick, moment, position, speed, count, end = struct.unpack("<qdddqq", body[4:])
        assert (tick, moment, count, end) == (7, pytest.approx(0.007), -7, 7)
        assert position == pytest.approx(0.7)
        assert np.isnan(speed)
    finally:
        stream.close()


def test_a_foxglove_client_that_never_reads_is_not_waited_for() -> None:
    stream = Foxglove(0, SCHEMA, lambda: START)
    try:
        with listen(stream.port) as client:
            subscribe(client)
            began = time.monotonic()
            for first in range(0, 200_000, 5000):
                stream.send(rows(first, 5000))
            assert time.monotonic() - began < 60.0
    finally:
        stream.close()


def test_a_port_that_is_taken_is_refused() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(StreamError, match="port"):
            Foxglove(taken.getsockname()[1], SCHEMA, lambda: START)


def test_a_recorded_run_is_streamed_as_well(recorded: Path, receiver: socket.socket) -> None:
    subject = replay(recorded)
    address = f"127.0.0.1:{receiver.getsockname()[1]}"
    found = subject.stream_to(address, 50.0, None)
    assert found == {"plotjuggler": f"udp://{address}"}
    assert subject.speed is not None
    subject.speed.set_speed(50.0)
    deadline = time.monotonic() + 5.0
    while time.monotonic() < deadline and not subject.watch.poll():
        time.sleep(0.02)
    got = json.loads(receiver.recv(65_536))
    assert {"timestamp", "plan", "safety", "power"} <= got.keys()
    assert subject.tap.start_utc_ns() > 10**18
    subject.close()
