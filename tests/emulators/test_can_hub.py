"""The hub: delivery order, time on the wire, and valid, invalid and slow clients."""

from __future__ import annotations

import asyncio
import socket
import subprocess
import sys
import textwrap
from collections.abc import Awaitable, Callable

import can
import pytest
from can_rig import ManualSchedule, live, wait_until
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_plant.emulators import can_hub
from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.can_hub import CanHub, Station
from sim_plant.emulators.schedule import precise_loop


def join_recorder(hub: CanHub) -> tuple[Station, list[Frame]]:
    frames: list[Frame] = []
    return hub.join(frames.append), frames


def test_all_stations_but_the_sender_receive_a_frame() -> None:
    hub = CanHub(ManualSchedule())
    (one, frames_one), (_, frames_two), (_, frames_three) = (join_recorder(hub) for _ in range(3))
    one.send(Frame(0x181, b"\x01"))
    assert frames_one == []
    assert frames_two == frames_three == [Frame(0x181, b"\x01")]
    one.leave()
    assert len(hub.stations) == 2


def test_arbitration_by_identifier_keeps_the_order_of_one_sender() -> None:
    schedule = ManualSchedule()
    hub = CanHub(schedule, bit_rate=1_000_000)
    (one, _), (two, _), (_, received) = (join_recorder(hub) for _ in range(3))
    one.send(Frame(0x700, b""))  # wins, as nobody else waits yet
    for number in (0x201, 0x080):
        one.send(Frame(number, b""))
    for number in (0x185, 0x600):
        two.send(Frame(number, b""))
    schedule.run(0.01)
    assert [frame.identifier for frame in received] == [0x700, 0x185, 0x201, 0x080, 0x600]


def test_time_on_the_wire_is_counted() -> None:
    schedule = ManualSchedule()
    hub = CanHub(schedule, bit_rate=1_000_000)
    (one, _), (_, received) = join_recorder(hub), join_recorder(hub)
    one.send(Frame(0x80, b""))
    one.send(Frame(0x181, bytes(8)))
    schedule.run(54.0e-6)
    assert received == []
    schedule.run(2.0e-6)
    assert len(received) == 1
    schedule.run(135.0e-6)
    assert len(received) == 2
    assert hub.busy_time == pytest.approx(190.0e-6)
    assert hub.frame_count == 2


def test_answer_during_a_delivery_follows_it() -> None:
    hub = CanHub(ManualSchedule())
    (one, frames_one), (_, frames_two) = join_recorder(hub), join_recorder(hub)
    echo: list[Station] = []
    echo.append(hub.join(lambda frame: echo[0].send(Frame(0x700, frame.data))))
    one.send(Frame(0x80, b"\x05"))
    assert [frame.identifier for frame in frames_two] == [0x80, 0x700]
    assert frames_one == [Frame(0x700, b"\x05")]


def test_full_queue_discards_and_counts_frames() -> None:
    hub = CanHub(ManualSchedule(), bit_rate=1_000_000)
    one, _ = join_recorder(hub)
    for _ in range(can_hub.QUEUE_LENGTH + 11):
        one.send(Frame(0x80, b""))
    assert one.overruns == 10


def received(bus: can.BusABC, identifier: int) -> bytes:
    """Return the data of the next frame with an identifier."""
    while (frame := bus.recv(10.0)) is not None:
        if frame.arbitration_id == identifier:
            return bytes(frame.data)
    raise AssertionError(f"no frame received with {identifier:x}")


def test_python_can_clients_of_several_processes_share_the_bus() -> None:
    other = """
        import can, sys
        place = {"host": "127.0.0.1", "port": int(sys.argv[1])}
        bus = can.Bus(interface="socketcand", channel="can0", **place)
        while (got := bus.recv(10.0)).arbitration_id != 0x7E5:
            pass
        data = bytes(reversed(got.data))
        bus.send(can.Message(arbitration_id=0x123, data=data, is_extended_id=False))
        bus.shutdown()
    """
    with live() as rig, rig.bus() as one, rig.bus() as two:
        command = [sys.executable, "-c", textwrap.dedent(other), str(rig.port)]
        with subprocess.Popen(command) as process:
            clients = rig.rig.hub.clients
            wait_until(lambda: rig.do(lambda: len(clients) == 3 and all(c.raw for c in clients)))
            one.send(can.Message(arbitration_id=0x7E5, data=b"\x01\x02", is_extended_id=False))
            assert received(one, 0x123) == b"\x02\x01"
            assert received(two, 0x7E5) == b"\x01\x02"
            assert received(two, 0x123) == b"\x02\x01"
            assert process.wait(10.0) == 0


async def exchange_text(port: int, text: bytes) -> bytes:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    assert await reader.readexactly(6) == b"< hi >"
    writer.write(text + b"< echo >")
    received_text = b""
    while not received_text.endswith(b"< echo >"):
        received_text += await asyncio.wait_for(reader.read(4096), 5.0)
    writer.close()
    return received_text


def run_served(conversation: Callable[[CanHub, int], Awaitable[None]]) -> None:
    async def run() -> None:
        hub = CanHub(asyncio.get_running_loop())
        _, port = await hub.serve()
        await conversation(hub, port)
        await hub.close()
        await asyncio.sleep(0.01)

    with asyncio.Runner(loop_factory=precise_loop) as runner:
        runner.run(run())


@pytest.mark.parametrize(
    ("text", "answers"),
    [
        (b"< send 85 1 1 >< open can0 >", b"< error no bus opened >< ok >< echo >"),
        (b"< open can0 >< send 85 1 >", b"< ok >< error 1 bytes declared, 0 given >< echo >"),
        (b"< open can0 >< dance >", b"< ok >< error unknown command >< echo >"),
        (b"< open can0 > rubbish >", b"< ok >< error no command >< echo >"),
        (b"< open can0 >\xff\xfe>", b"< ok >< error no command >< echo >"),
        (b"< open can0 >< send 999 0  >", b"< ok >< error identifier out of range >< echo >"),
    ],
)
def test_malformed_text_is_answered_by_an_error(text: bytes, answers: bytes) -> None:
    async def conversation(hub: CanHub, port: int) -> None:
        assert await exchange_text(port, text) == answers

    run_served(conversation)


@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=300),
            st.sampled_from(
                [b"< open x >", b"< send ", b" >", b"<", b"< rawmode >", b"\xff" * 600]
            ),
        ),
        max_size=8,
    )
)
def test_malformed_text_does_not_affect_other_clients(parts: list[bytes]) -> None:
    async def conversation(hub: CanHub, port: int) -> None:
        for part in (b"".join(parts), b"< open can0 >" + b"".join(parts)):
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(part)
            await writer.drain()
            writer.transport.abort()
        assert await exchange_text(port, b"< open can0 >< send 7FF 0  >") == b"< ok >< echo >"

    run_served(conversation)


def test_client_that_does_not_read_is_disconnected() -> None:
    async def conversation(hub: CanHub, port: int) -> None:
        slow = socket.create_connection(("127.0.0.1", port))
        slow.sendall(b"< open can0 >< rawmode >")
        await asyncio.sleep(0.1)
        station, _ = join_recorder(hub)
        for _ in range(1000):
            for _ in range(1000):
                station.send(Frame(0x181, bytes(8)))
            await asyncio.sleep(0)
            if hub.dropped_clients:
                break
        assert hub.dropped_clients == 1
        assert hub.clients == set()
        slow.close()

    run_served(conversation)


def test_bus_errors_are_reported_to_clients() -> None:
    with live() as rig, rig.bus() as bus:
        rig.do(rig.rig.hub.report_error, 0x40)
        for _ in range(20):
            frame = bus.recv(5.0)
            assert frame is not None
            if frame.is_error_frame:
                break
        assert frame.arbitration_id == 0x40
