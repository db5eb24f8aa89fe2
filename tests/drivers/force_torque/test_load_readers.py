"""Both load cells' readers: start, stream, restart, tare, saturation, gaps."""

from __future__ import annotations

from typing import Any

import pytest
from device_peers import DigitalFtPeer, NetFtPeer
from faulty_port import STEP, FaultyPort
from stream_subjects import DIGITAL, NET

from drivers.conversation import Exchange
from drivers.errors import CodecError
from drivers.force_torque import load
from drivers.force_torque.digital_reader import DigitalReader
from drivers.force_torque.load import Phase
from drivers.force_torque.net_reader import NetReader


class Bench:
    """A reader, its box and the wire."""

    def __init__(self, reader: DigitalReader | NetReader, peer: DigitalFtPeer | NetFtPeer) -> None:
        self.reader, self.peer = reader, peer
        self.port = FaultyPort(peer, datagrams=isinstance(peer, NetFtPeer))
        self.exchange = Exchange(self.port, reader)

    @property
    def now(self) -> float:
        return self.port.time

    @property
    def reading(self) -> load.LoadCellReading:
        return self.reader.read(self.now)

    @property
    def explanation(self) -> str:
        return self.reader.explain(self.now)

    def run(self, seconds: float) -> Bench:
        for _ in range(round(seconds / STEP)):
            self.port.step()
            self.exchange.step()
        return self


def digital(**changes: Any) -> Bench:
    return Bench(DigitalReader(DIGITAL._replace(**changes)), DigitalFtPeer())


def net(**changes: Any) -> Bench:
    return Bench(NetReader(NET._replace(**changes)), NetFtPeer())


def test_the_digital_box_is_stopped_read_and_started() -> None:
    bench = digital().run(1.0)
    sent = bench.port.sent
    assert [len(one) for one in sent] == [14, 8, 8, 5]
    assert sent[1][:6] == bytes((10, 3, 0, 0xE3, 0, 125))
    assert sent[2][:6] == bytes((10, 3, 1, 0x60, 0, 44))
    assert sent[3] == bytes.fromhex("0A4655A39D")
    reading = bench.reading
    assert reading.phase is Phase.STREAMING
    assert bench.explanation == ""
    assert reading.age < 0.004
    assert reading.wrench.fx == pytest.approx((bench.now - reading.age) * 1000.0 / 4.0, abs=1.0)
    assert reading.wrench[1:] == (2.5, -5.0, 30.0 / 8.0, -5.0, 50.0 / 8.0)
    assert (bench.reader.error_counts.dropped, bench.reader.error_counts.searches) == (0, 0)


def test_a_box_that_streams_already_is_stopped_first() -> None:
    bench = digital()
    bench.peer.streaming = True
    bench.run(1.0)
    assert bench.peer.starts == 1
    assert bench.reading.phase is Phase.STREAMING


def test_another_sensor_is_refused_until_the_port_is_reopened() -> None:
    bench = digital()
    bench.peer.serial = "FT99999"
    bench.run(1.0)
    assert bench.reading.phase is Phase.REFUSED
    assert bench.explanation == "load cell: is sensor 'FT99999', not 'FT12345'"
    sent = len(bench.port.sent)
    bench.run(1.0)
    assert len(bench.port.sent) == sent
    bench.peer.serial = "FT12345"
    bench.port.hang_up()
    bench.run(0.1)
    bench.port.reopen()
    bench.run(0.6)
    assert bench.reading.phase is Phase.STREAMING


def test_lost_bytes_cost_samples_not_the_boundary() -> None:
    bench = digital().run(1.0)
    bench.port._in_transit.append((bench.now, b"\x12\x34\x56\x78\x9a"))
    bench.run(0.2)
    assert bench.reader.error_counts.searches >= 1
    assert bench.reading.phase is Phase.STREAMING
    assert bench.reading.age < 0.005
    assert bench.reader.starts == 1
    assert bench.reading.wrench.fy == 2.5


@pytest.mark.parametrize("make", [digital, net])
def test_an_ended_stream_is_restarted_with_growing_pauses(make: Any) -> None:
    bench = make().run(1.0)
    bench.port.fault = "silent"
    starts = len(bench.port.sent)
    bench.run(20.0)
    assert bench.reading.phase is not Phase.STREAMING
    assert bench.reading.age > 19.9
    assert 8 <= len(bench.port.sent) - starts <= 40
    assert "no " in bench.explanation
    bench.port.fault = "none"
    bench.run(6.0)
    assert bench.reading.phase is Phase.STREAMING
    assert bench.reader.starts == 2
    assert bench.explanation == ""


@pytest.mark.parametrize("make", [digital, net])
def test_a_power_cycled_box_is_restarted(make: Any) -> None:
    bench = make().run(1.0)
    bench.peer.power_cycle(bench.now)
    bench.run(1.5)
    assert bench.reader.starts == 2
    assert bench.reading.age < 0.005


def test_the_host_tare_is_a_mean_and_can_be_removed() -> None:
    bench = digital().run(1.0)
    assert isinstance(bench.reader, DigitalReader)
    bench.reader.tare(50)
    assert bench.reading.wrench.fy == 2.5  # not yet
    bench.run(0.2)
    assert bench.reading.wrench.fy == 0.0
    assert bench.reading.wrench.tz == 0.0
    bench.peer.gauges[1] = 14
    bench.run(0.01)
    assert bench.reading.wrench.fy == 1.0
    bench.reader.clear_tare()
    assert bench.reading.wrench.fy == 3.5


def test_the_mean_of_a_tare_is_one() -> None:
    tare = load.begin_tare(load.no_tare(), 4)
    for value in (1.0, 2.0, 3.0, 6.0):
        assert tare.bias == load.NO_BIAS
        tare = load.add_tare_sample(tare, (value, 0.0, -value, 0.0, 0.0, 1.0))
    assert tare.bias == (3.0, 0.0, -3.0, 0.0, 0.0, 1.0)
    assert load.add_tare_sample(tare, load.NO_BIAS) == tare
    assert load.begin_tare(tare, 0).remaining == 1


def test_saturated_gauges_are_flagged_and_not_used() -> None:
    bench = digital().run(1.0)
    bench.peer.gauges[1], bench.peer.gauges[4] = 32000, -32768
    bench.run(0.05)
    reading = bench.reading
    assert reading.saturated == 0b010010
    assert reading.wrench.fy == 2.5
    assert reading.age >= 0.045
    assert bench.explanation == "load cell: saturated: G1 G4"
    assert isinstance(bench.reader, DigitalReader)
    assert bench.reader.saturated >= 20
    bench.peer.gauges[1], bench.peer.gauges[4] = 31999, 0
    bench.run(0.01)
    assert bench.reading.saturated == 0


def test_a_fault_of_the_digital_box_is_reported() -> None:
    bench = digital().run(1.0)
    bench.peer.fault = 1
    bench.run(0.2)
    assert bench.reading.fault == 1
    assert bench.reading.age > 0.19
    assert "status error" in bench.explanation
    assert "no good sample for 0.1 s" in bench.explanation
    assert bench.reading.phase is Phase.STREAMING  # the box lives


def test_the_net_box_is_stopped_and_started() -> None:
    bench = net().run(1.0)
    assert isinstance(bench.peer, NetFtPeer)
    assert bench.peer.requests == [0, 2]
    assert bench.port.sent[1] == bytes.fromhex("1234 0002 00000000")
    reading = bench.reading
    assert reading.wrench.fx == pytest.approx(bench.now - reading.age, abs=0.003)
    assert reading.wrench[1:] == pytest.approx((0.002, 0.0, 0.003, 0.0, -0.007))
    assert bench.explanation == ""


def test_buffered_records_are_requested_by_setting() -> None:
    bench = net(buffered=1).run(0.3)
    assert isinstance(bench.peer, NetFtPeer)
    assert bench.peer.requests == [0, 3]


def test_lost_records_are_counted_over_restarts() -> None:
    bench = net().run(1.0)
    assert isinstance(bench.reader, NetReader)
    bench.peer.skip = 7
    bench.run(0.5)
    assert bench.reader.missing == 7
    bench.peer.power_cycle(bench.now)
    bench.run(1.5)
    bench.peer.skip = 3
    bench.run(0.5)
    assert bench.reader.missing == 10
    assert bench.reader.repeated == 0


def test_the_box_bias_is_requested_once_and_clears_the_host_tare() -> None:
    bench = net().run(1.0)
    assert isinstance(bench.reader, NetReader)
    bench.reader.tare(10)
    bench.run(0.1)
    assert bench.reading.wrench.fy == 0.0
    bench.reader.tare_box()
    bench.run(0.1)
    assert isinstance(bench.peer, NetFtPeer)
    assert bench.peer.requests == [0, 2, 0x42]
    assert bench.reading.wrench.fy == pytest.approx(0.002)
    assert bench.reading.wrench.fx == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize(
    ("status", "saturated"), [(0x80020000, 1), (0x00000100, 0), (0x80000000, 0)]
)
def test_a_status_that_is_not_zero_makes_a_record_useless(status: int, saturated: int) -> None:
    bench = net().run(1.0)
    assert isinstance(bench.peer, NetFtPeer)
    bench.peer.status = status
    bench.run(0.05)
    reading = bench.reading
    assert (reading.fault, reading.saturated) == (1, saturated)
    assert reading.age >= 0.045
    assert f"{status:#010x}" in bench.explanation
    bench.peer.status = 0
    bench.run(0.01)
    assert bench.explanation == ""


def test_the_sensor_count_reveals_delays() -> None:
    for rate, least in ((1000.0, 0.039), (0.0, 0.0)):
        bench = net(sample_rate=rate).run(2.0)
        bench.port.fault, bench.port.delay = "late", 0.04
        bench.run(0.2)
        assert bench.reading.age >= least
        assert bench.reading.age < 0.05
    assert bench.reading.age < 0.005  # without the rate a delay cannot be seen


def test_a_stopped_sensor_ages_while_the_box_sends() -> None:
    bench = net(sample_rate=1000.0).run(1.0)
    assert isinstance(bench.peer, NetFtPeer)
    assert isinstance(bench.reader, NetReader)
    bench.peer.hangs = True
    bench.run(1.5)
    assert bench.reading.age >= 1.49  # also after the 0.5 s in which clocks are taken for leapt
    assert "count of samples stands still" in bench.explanation
    assert bench.reader.unchanged >= 700  # of a record every 2 ms
    bench.peer.hangs = False
    bench.run(0.1)
    assert bench.reading.age < 0.05
    assert bench.explanation == ""


def test_datagrams_of_an_old_stream_are_not_taken_for_the_new_one() -> None:
    bench = net().run(1.0)
    assert isinstance(bench.peer, NetFtPeer)
    assert isinstance(bench.reader, NetReader)
    bench.port.hang_up()
    bench.run(0.01)
    bench.port.reopen()
    bench.port._in_transit.append((bench.now + 0.02, bench.peer.record(bench.now)))
    bench.run(0.5)
    assert bench.reader.stray >= 1
    assert (bench.reader.missing, bench.reader.repeated) == (0, 0)
    assert bench.reading.age < 0.005


@pytest.mark.parametrize("wrong", [{"quiet_time": 0.0}, {"silence_timeout": 0.0}])
def test_invalid_times_are_refused(wrong: dict[str, Any]) -> None:
    for make in (digital, net):
        with pytest.raises(CodecError):
            make(**wrong)
    with pytest.raises(CodecError):
        digital(rail=0)
    with pytest.raises(CodecError):
        net(sample_rate=-1.0)
