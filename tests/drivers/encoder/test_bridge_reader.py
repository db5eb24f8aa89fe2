"""The bridge's reader: turns, ages on the host's clock, and errors of a word."""

from __future__ import annotations

import math
from typing import Any

import pytest
from device_peers import BridgePeer
from faulty_port import STEP, FaultyPort
from stream_subjects import BRIDGE

from drivers.conversation import Exchange
from drivers.encoder.bridge_reader import BridgeReader, Quality
from drivers.encoder.ssi import SsiProtocol
from drivers.errors import CodecError


class Bench:
    def __init__(self, **changes: Any) -> None:
        self.peer = BridgePeer()
        self.reader = BridgeReader(BRIDGE._replace(**changes))
        self.port = FaultyPort(self.peer)
        self.exchange = Exchange(self.port, self.reader)

    @property
    def now(self) -> float:
        return self.port.time

    @property
    def motor(self) -> Any:
        return self.reader.read(self.now).motor

    @property
    def shaft(self) -> Any:
        return self.reader.read(self.now).shaft

    def run(self, seconds: float) -> Bench:
        for _ in range(round(seconds / STEP)):
            self.port.step()
            self.exchange.step()
        return self


def test_both_angles_run_over_many_turns() -> None:
    bench = Bench().run(10.0)
    motor, shaft = bench.motor, bench.shaft
    assert motor.quality is shaft.quality is Quality.GOOD
    assert motor.angle == pytest.approx(3.0 * (bench.now - motor.age), abs=2e-5)
    assert motor.angle > 4 * math.tau
    assert shaft.angle == pytest.approx(-0.2 * (bench.now - shaft.age), abs=2e-5)  # direction -1
    assert motor.age == shaft.age  # one edge
    assert 0.0 <= motor.age < 0.0021
    assert bench.reader.explain(bench.now) == ""


def test_before_the_first_frame_ages_are_very_large() -> None:
    bench = Bench()
    assert bench.motor.quality is Quality.NEVER
    assert bench.motor.age > 1e8
    assert bench.reader.explain(0.0) == "bridge: no frame for 0.1 s"
    assert bench.reader.next_message(0.0) == b""


def test_buffered_frames_have_their_true_age() -> None:
    bench = Bench().run(1.0)
    late = b"".join(b"".join(bench.peer.tick(bench.now + n * 0.002)) for n in range(1, 21))
    bench.reader.receive(late, bench.now + 0.2)  # 20 frames that wait until 0.16 s after the last
    assert bench.reader.read(bench.now + 0.2).motor.age == pytest.approx(0.16, abs=0.003)


def test_the_min_delay_is_added_to_every_age() -> None:
    plain, added = Bench().run(1.0), Bench(min_delay=0.004).run(1.0)
    assert added.motor.age == pytest.approx(plain.motor.age + 0.004, abs=1e-9)


def test_a_drifting_clock_changes_no_age() -> None:
    for drift in (200e-6, -200e-6):
        bench = Bench()
        bench.peer.drift = drift
        for _ in range(160):
            bench.run(0.05)
            assert -1e-6 <= bench.motor.age < 0.0021 + 2.0 * 2.0 * 200e-6
            assert bench.motor.age >= bench.now - bench.motor.angle / 3.0 - 5e-5


@pytest.mark.parametrize(
    ("change", "quality"),
    [
        ({"valid": 0}, Quality.INVALID),
        ({"status": 0x01}, Quality.SILENT),
        ({"frozen": True}, Quality.STUCK),
    ],
)
def test_an_invalid_word_is_reported_and_ages(change: dict[str, Any], quality: Quality) -> None:
    bench = Bench().run(1.0)
    before = bench.motor
    for name, value in change.items():
        setattr(bench.peer, name, value)
    bench.run(0.05)
    after = bench.motor
    assert after.quality is quality
    assert after.angle == pytest.approx(before.angle, abs=0.01)
    assert after.age >= 0.045
    assert after.rejected >= 20
    assert f"motor encoder {quality.name.lower()}" in bench.reader.explain(bench.now)
    assert bench.shaft.quality is Quality.GOOD  # the other goes on
    bench.peer.valid, bench.peer.status, bench.peer.frozen = 1, 0, False
    bench.run(0.02)
    assert bench.motor.quality is Quality.GOOD
    assert bench.motor.angle == pytest.approx(3.0 * (bench.now - bench.motor.age), abs=2e-5)


def test_a_jump_is_refused() -> None:
    bench = Bench().run(1.0)
    bench.peer.motor = 3.5  # 0.5 rad further at once
    bench.run(0.004)
    assert bench.motor.quality is Quality.JUMPED
    assert bench.motor.angle == pytest.approx(3.0, abs=0.02)


def test_another_protocol_than_configured_is_rejected() -> None:
    motor = BRIDGE.motor._replace(protocol=SsiProtocol.SSI9)
    bench = Bench(motor=motor).run(0.1)
    assert bench.motor.quality is Quality.OTHER_PROTOCOL
    assert bench.shaft.quality is Quality.GOOD


def test_a_silence_of_half_a_turn_loses_the_turns_until_reset() -> None:
    bench = Bench().run(1.0)
    bench.port.fault = "silent"
    bench.run(0.3)
    assert bench.reader.explain(bench.now) == "bridge: no frame for 0.1 s"
    bench.port.fault = "none"
    bench.run(0.1)
    assert bench.motor.quality is bench.shaft.quality is Quality.LOST
    assert bench.motor.age > 0.39
    bench.reader.reset_turns()
    bench.run(0.1)
    motor = bench.motor
    assert motor.quality is Quality.GOOD
    assert motor.age < 0.003
    assert 0.0 <= motor.angle < math.tau + 0.5
    assert math.remainder(motor.angle - 3.0 * (bench.now - motor.age), math.tau) == pytest.approx(
        0.0, abs=2e-5
    )


def test_a_short_silence_loses_nothing() -> None:
    bench = Bench().run(1.0)
    bench.port.fault = "silent"
    bench.run(0.1)
    bench.port.fault = "none"
    bench.run(0.1)
    assert bench.motor.quality is Quality.GOOD
    assert bench.motor.angle == pytest.approx(3.0 * (bench.now - bench.motor.age), abs=2e-5)
    assert bench.reader.error_counts.missing >= 49


@pytest.mark.parametrize("first_comes", [True, False])
@pytest.mark.parametrize("base", [0, 60_000_000])
def test_a_bridge_restart_keeps_the_turns(first_comes: bool, base: int) -> None:
    """Its clock starts at any value; with or without its first frame, which announces that."""
    bench = Bench().run(5.0)
    bench.peer.power_cycle(bench.now)
    bench.peer.base = base
    if not first_comes:
        bench.peer.tick(bench.now + 0.002)
    bench.run(0.5)
    assert bench.reader.restarts == 1
    assert bench.motor.quality is Quality.GOOD
    assert bench.motor.age < 0.003
    assert bench.motor.angle == pytest.approx(3.0 * (bench.now - bench.motor.age), abs=2e-5)


def test_repeated_frames_are_ignored() -> None:
    bench = Bench().run(1.0)
    frames = [b"".join(bench.peer.tick(bench.now + n * 0.002)) for n in range(1, 4)]
    later = bench.now + 0.008
    bench.reader.receive(b"".join(frames), later)
    angle, age = bench.reader.read(later).motor[:2]
    bench.reader.receive(b"".join(frames[:2]), later + 0.01)
    assert bench.reader.repeated == 2
    assert bench.reader.restarts == 0
    assert bench.reader.read(later + 0.01).motor[:2] == pytest.approx((angle, age + 0.01))


@pytest.mark.parametrize(
    "wrong",
    [
        {"window": 0.0},
        {"silence_timeout": 0.0},
        {"min_delay": -0.001},
        {"motor": BRIDGE.motor._replace(direction=0.5)},
    ],
)
def test_invalid_settings_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(CodecError):
        BridgeReader(BRIDGE._replace(**wrong))
