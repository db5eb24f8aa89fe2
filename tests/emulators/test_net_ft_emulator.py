"""The Net F/T: bytes of the manual, and two independent clients if installed."""

from __future__ import annotations

import contextlib
import socket
import struct
import urllib.error
import urllib.request
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from itertools import pairwise

import pytest
from emulator_stage import Stage, until

from sim_plant.emulators.ft_calibration import Wrench
from sim_plant.emulators.net_ft import NetFt, NetFtSettings

LOAD = Wrench(12.0, -4.5, 300.0, 0.25, -7.5, 11.0)
COUNTS = [12_000_000, -4_500_000, 300_000_000, 250_000, -7_500_000, 11_000_000]


class Load:
    """A load that can be changed."""

    def __init__(self) -> None:
        self.wrench = LOAD

    def __call__(self) -> Wrench:
        return self.wrench


@pytest.fixture
def load() -> Load:
    return Load()


@pytest.fixture
def box(stage: Stage, load: Load) -> NetFt:
    settings = NetFtSettings(port=0, tcp_port=0, http_port=0, rate=500.0)
    return stage.show(NetFt(load, settings))


def place(address: str) -> tuple[str, int]:
    host, port = address.split(":")
    return host, int(port)


@pytest.fixture
def host(box: NetFt) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as host:
        host.settimeout(5.0)
        host.connect(place(box.address))
        yield host


def ask(host: socket.socket, command: int, count: int = 0) -> None:
    host.send(struct.pack(">HHI", 0x1234, command, count))


def receive_record(host: socket.socket) -> tuple[int, ...]:
    return struct.unpack(">III6i", host.recv(100))


def wait_for_silence(host: socket.socket) -> bool:
    """Return True if the stream has ended; packets in transit are discarded."""
    host.settimeout(0.2)
    try:
        for _ in range(500):
            host.recv(4096)
    except TimeoutError:
        return True
    finally:
        host.settimeout(5.0)
    return False


def test_a_counted_request(host: socket.socket) -> None:
    ask(host, 2, 5)
    records = [receive_record(host) for _ in range(5)]
    assert [record[0] for record in records] == [1, 2, 3, 4, 5]
    assert all(list(record[3:]) == COUNTS and record[2] == 0 for record in records)
    ticks = [record[1] for record in records]
    assert ticks == sorted(ticks)
    assert wait_for_silence(host)


def test_an_endless_stream_until_stop(host: socket.socket) -> None:
    ask(host, 2)
    assert [receive_record(host)[0] for _ in range(50)] == list(range(1, 51))
    ask(host, 0)
    assert wait_for_silence(host)


def test_a_buffered_stream(host: socket.socket) -> None:
    ask(host, 3, 50)
    packets = [host.recv(4096), host.recv(4096)]
    assert [len(packet) for packet in packets] == [40 * 36, 10 * 36]
    records = list(struct.iter_unpack(">III6i", b"".join(packets)))
    assert [record[0] for record in records] == list(range(1, 51))
    for before, after in pairwise(records):  # 7 kHz of the sensor over 500 Hz
        assert after[1] - before[1] in (13, 14, 15)


def test_last_requesting_host_receives_the_stream(host: socket.socket, box: NetFt) -> None:
    ask(host, 2)
    receive_record(host)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.settimeout(5.0)
        other.connect(place(box.address))
        ask(other, 2)
        assert receive_record(other)[0] == 1
        assert wait_for_silence(host)


def test_bias_removes_the_load(host: socket.socket, load: Load) -> None:
    ask(host, 0x42)
    ask(host, 2, 1)
    assert list(receive_record(host)[3:]) == [0] * 6
    load.wrench = LOAD._replace(fz=310.0)
    ask(host, 2, 1)
    assert list(receive_record(host)[3:]) == [0, 0, 10_000_000, 0, 0, 0]


def test_garbage_is_not_answered(host: socket.socket) -> None:
    for garbage in (b"", b"\x12\x34", bytes(8), bytes(100), struct.pack(">HHI", 0x1234, 0x99, 0)):
        host.send(garbage)
    assert wait_for_silence(host)


@pytest.mark.parametrize(
    ("fault", "status", "counts"),
    [
        ("saturated", 0x80020000, [700, 700, 1700, 30, 30, 30]),
        ("status_error", 0x80000000, None),
    ],
)
def test_faults_in_the_status(
    host: socket.socket, box: NetFt, fault: str, status: int, counts: list[int] | None
) -> None:
    box.faults.switch(fault)
    ask(host, 2, 1)
    record = receive_record(host)
    assert record[2] == status
    assert list(record[3:]) == ([1_000_000 * n for n in counts] if counts else COUNTS)


def test_an_inverted_cell(host: socket.socket, box: NetFt) -> None:
    box.faults.switch("inverted")
    ask(host, 2, 1)
    assert list(receive_record(host)[3:]) == [-count for count in COUNTS]


def test_stuck_sensor_and_frozen_values(host: socket.socket, box: NetFt, load: Load) -> None:
    for fault, is_constant in (("stuck_sensor", True), ("frozen_values", False)):
        load.wrench = LOAD
        ask(host, 2, 1)
        receive_record(host)
        box.faults.switch(fault)
        load.wrench = Wrench()
        ask(host, 2, 3)
        records = [receive_record(host) for _ in range(3)]
        box.faults.clear()
        assert all(list(record[3:]) == COUNTS for record in records)
        assert (records[0][1] == records[2][1]) is is_constant


def test_silence_short_records_and_a_restart(host: socket.socket, box: NetFt) -> None:
    box.faults.switch("silent")
    ask(host, 2)
    assert wait_for_silence(host)
    box.faults.clear()
    box.faults.switch("short_records")
    assert until(lambda: len(host.recv(100)) == 20)
    box.faults.clear()
    box.faults.switch("restarted")
    assert wait_for_silence(host)


def test_lost_datagrams_are_gaps_in_the_sequence(host: socket.socket, box: NetFt) -> None:
    box.link.switch("drop", toward="host")
    ask(host, 2, 100)
    assert until(lambda: box.link.counts().get("host.handed over") == 100)
    numbers: list[int] = []
    host.settimeout(0.3)
    with contextlib.suppress(TimeoutError):
        while True:
            numbers.append(receive_record(host)[0])
    lost = 100 - len(numbers)
    assert lost == box.link.counts()["host.drop"] > 0
    assert numbers == sorted(numbers)


def test_the_tcp_service(box: NetFt) -> None:
    with socket.create_connection(place(box.tcp.address), timeout=5.0) as host:
        host.sendall(bytes((1,)) + bytes(19))
        head, force, torque, cpf, cpt, *scale = struct.unpack(">HBBII6H", host.recv(100))
        assert (head, force, torque, cpf, cpt) == (0x1234, 2, 3, 1_000_000, 1_000_000)
        host.sendall(bytes(20))
        head, status, *counts = struct.unpack(">HH6h", host.recv(100))
        assert (head, status) == (0x1234, 0)
        for count, step, exact in zip(counts, scale, COUNTS, strict=True):
            assert count * step == pytest.approx(exact, abs=step)


def test_the_settings_page(box: NetFt) -> None:
    url = f"http://{box.page.address}"
    with urllib.request.urlopen(f"{url}/netftapi2.xml", timeout=5.0) as page:
        root = ET.fromstring(page.read())
    assert root.findtext("cfgcpf") == "1000000"
    assert root.findtext("scfgfu") == "N"
    assert root.findtext("comrdtrate") == "500"
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(f"{url}/other", timeout=5.0)


def test_the_client_netft(stage: Stage, load: Load) -> None:
    """PyPI NetFT supports one port only, so the box has a loopback address of its own."""
    netft = pytest.importorskip("NetFT", reason="PyPI NetFT is not installed: no such peer")
    settings = NetFtSettings(host="127.64.0.1", tcp_port=0, http_port=0)
    box = stage.show(NetFt(load, settings))
    sensor = netft.Sensor("127.64.0.1")
    sensor.sock.settimeout(5.0)
    assert sensor.getMeasurement() == COUNTS
    sensor.tare(5)
    assert sensor.getForce() == [0, 0, 0]
    sensor.sock.close()
    assert box.address == "127.64.0.1:49152"


def test_the_client_pynetft(box: NetFt, load: Load) -> None:
    pynetft = pytest.importorskip("pynetft", reason="PyPI pynetft is not installed: no such peer")
    config = pynetft.Config(
        sensor_host="127.0.0.1",
        rdt_port=place(box.address)[1],
        http_port=place(box.page.address)[1],
    )
    with pynetft.Client(config) as client:
        samples = client.samples(timeout=5.0)
        first = next(samples)
        assert list(first.force) == pytest.approx([12.0, -4.5, 300.0])
        assert list(first.torque) == pytest.approx([0.25, -7.5, 11.0])
        assert first.force_unit.value == "N"
        load.wrench = Wrench(fx=1.0)
        assert until(lambda: list(next(samples).force) == pytest.approx([1.0, 0.0, 0.0]))


def test_foreign_client_and_ignored_bias(host: socket.socket, box: NetFt) -> None:
    box.faults.switch("ignores_bias")
    ask(host, 0x42)
    ask(host, 2, 1)
    assert list(receive_record(host)[3:]) == COUNTS
    ask(host, 2)
    receive_record(host)
    box.faults.switch("foreign_client")
    assert wait_for_silence(host)
