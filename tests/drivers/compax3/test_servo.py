"""The conversation with a servo drive, against a drive written here: up, down, deadlines."""

from __future__ import annotations

import math
from typing import Any

import pytest
from device_peers import Compax3Peer
from faulty_port import STEP, FaultyPort
from stream_subjects import SERVO, SET_POINT

from drivers.compax3 import objects
from drivers.compax3.codec import Object
from drivers.compax3.objects import ObjectChannel
from drivers.compax3.requests import GAP, Requests, Timing
from drivers.compax3.servo import Servo
from drivers.compax3.servo_signals import NOT_READ, Phase, ServoSettings
from drivers.compax3.values import NumberFormat
from drivers.conversation import Exchange
from drivers.errors import CodecError

CONTROL = (1100, 3)


class Bench:
    """Servo, drive and the wire; `want` is renewed each turn while it is not None."""

    def __init__(self, settings: ServoSettings = SERVO, drive: Compax3Peer | None = None) -> None:
        self.drive = drive or Compax3Peer()
        self.servo = Servo(settings)
        self.port = FaultyPort(self.drive)
        self.exchange = Exchange(self.port, self.servo)
        self.want: float | None = 0.0
        self.enable = 0

    @property
    def now(self) -> float:
        return self.port.time

    @property
    def reading(self) -> Any:
        return self.servo.read(self.now)

    @property
    def explanation(self) -> str:
        return self.servo.explain(self.now)

    def run(self, seconds: float) -> Bench:
        for _ in range(round(seconds / STEP)):
            self.port.step()
            if self.want is not None:
                self.servo.command(self.want, self.enable, self.now)
            self.exchange.step()
        return self

    def up(self, want: float = 2.0) -> Bench:
        self.enable = 0
        self.run(0.3)
        self.want, self.enable = want, 1
        self.run(0.1)
        assert self.reading.phase is Phase.ON, self.explanation
        return self

    def control_words(self) -> list[float]:
        return [value for index, sub, value in self.drive.writes if (index, sub) == CONTROL]


def test_a_drive_is_identified_then_disabled_then_read() -> None:
    bench = Bench().run(0.2)
    assert bench.port.sent[0] == b"_?\r"
    assert bench.servo.requests.name == bench.drive.identity
    assert bench.drive.writes[:2] == [(*CONTROL, 0), (1901, 1, 0.0)]
    assert bench.reading.phase is Phase.OFF
    assert bench.reading.age < 0.01
    assert bench.explanation == ""
    assert bench.drive.outstanding_at_once == 1  # never two questions


def test_enabled_only_on_request_then_set_points_follow() -> None:
    bench = Bench()
    bench.want = 2.0
    bench.run(0.3)
    assert not bench.drive.powered
    assert bench.drive.set_point == 0.0
    bench.up(2.0)
    assert bench.control_words() == [0, 0, objects.ENABLED]
    assert bench.drive.powered
    assert bench.drive.set_point == 2.0
    bench.want = -3.5
    bench.run(0.02)
    assert bench.drive.set_point == -3.5
    assert bench.reading.values[1] == -3.5
    assert bench.reading.acting == 1


def test_the_set_point_is_zero_before_the_power_comes() -> None:
    bench = Bench().up(7.0)
    at = bench.drive.writes.index((*CONTROL, objects.ENABLED))
    assert bench.drive.writes[at - 1] == (1901, 1, 0.0)
    assert all(value == 0.0 for index, _, value in bench.drive.writes[:at] if index == 1901)


def test_released_drive_is_disabled() -> None:
    bench = Bench().up()
    bench.enable = 0
    bench.run(0.02)
    assert not bench.drive.powered
    assert bench.drive.set_point == 0.0
    assert bench.explanation == ""


def test_a_set_point_that_is_not_renewed_stops_the_drive() -> None:
    bench = Bench().up()
    bench.want = None
    bench.run(SERVO.set_point_timeout - 0.01)
    assert bench.drive.powered
    bench.run(0.03)
    assert not bench.drive.powered
    assert bench.explanation == "servo: set-point not renewed in 0.1 s"
    bench.want = 1.0  # renewed with the previous request: the drive stays disabled
    bench.run(0.5)
    assert not bench.drive.powered
    bench.up()
    assert bench.explanation == ""


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_nan_set_point_disables_with_a_reason(bad: float) -> None:
    bench = Bench().up()
    bench.want = bad
    bench.run(0.02)
    assert not bench.drive.powered
    assert "is not finite" in bench.explanation
    bench.want = 1.0
    bench.run(0.3)
    assert not bench.drive.powered
    assert all(math.isfinite(value) for _, _, value in bench.drive.writes)


@pytest.mark.parametrize(("requested", "sent"), [(1e9, 10.0), (-11.0, -10.0)])
def test_a_set_point_beyond_the_limit_is_clamped_and_flagged(requested: float, sent: float) -> None:
    bench = Bench().up()
    assert bench.reading.limited == 0
    bench.want = requested
    bench.run(0.02)
    assert (bench.drive.set_point, bench.reading.limited) == (sent, 1)


def test_an_error_disables_the_drive_and_is_reported() -> None:
    bench = Bench().up()
    bench.drive.trip(29472)
    bench.run(0.03)
    reading = bench.reading
    assert (reading.phase, reading.acting, reading.error) == (Phase.OFF, 0, 29472)
    assert bench.explanation == "servo: following error; disabled by the drive's error"
    words = len(bench.control_words())
    bench.drive.error = 1  # cleared by itself, which is no reason to enable
    bench.run(0.5)
    assert not bench.drive.powered
    assert bench.reading.error == 0
    assert bench.control_words()[words:] == []


def test_an_error_is_acknowledged_only_on_request() -> None:
    bench = Bench().up()
    bench.drive.trip(17168)
    bench.run(0.05)
    bench.enable = 0
    bench.run(0.05)
    bench.enable = 1
    bench.run(0.1)
    assert bench.drive.error == 17168  # a request alone acknowledges nothing
    assert "enable requested without an acknowledgement" in bench.explanation
    assert "motor temperature" in bench.explanation
    bench.servo.acknowledge()
    bench.run(0.1)
    assert bench.drive.error == 17168  # an acknowledgement alone requests nothing
    bench.up()
    assert (bench.drive.error, bench.drive.powered) == (1, True)
    bench.drive.trip(17168)
    bench.run(0.05)
    bench.enable = 0
    bench.run(0.05)
    bench.enable = 1
    bench.run(0.1)
    assert not bench.drive.powered  # it was for one request


def test_a_drive_whose_edge_only_acknowledges_gets_a_second_one() -> None:
    class Careful(Compax3Peer):
        def _write(self, number: tuple[int, int], data: bytes) -> None:
            was = self.error
            super()._write(number, data)
            if was != 1:
                self.powered = False

    bench = Bench(drive=Careful()).up()
    bench.drive.trip(29475)
    bench.run(0.05)
    bench.servo.acknowledge()
    bench.up()
    assert bench.drive.powered
    assert bench.control_words()[-4:] == [0, objects.ENABLED, 0, objects.ENABLED]


def test_an_error_that_stands_names_the_deadline() -> None:
    bench = Bench().up()
    bench.drive.trip(29472)
    bench.run(0.05)
    bench.drive.deaf_control = True
    bench.servo.acknowledge()
    bench.enable = 0
    bench.run(0.02)
    bench.enable = 1
    bench.run(SERVO.enable_timeout + 0.05)
    assert bench.reading.phase is Phase.OFF
    assert "not powered 0.2 s after the request" in bench.explanation


def test_a_drive_that_takes_its_power_off_is_not_followed_up() -> None:
    bench = Bench().up()
    bench.drive.powered = False
    bench.run(0.05)
    assert bench.explanation == "servo: the drive removed its power"
    bench.drive.powered = True  # on again by itself: the driver must switch it off
    bench.drive.control = 0
    bench.run(0.05)
    assert not bench.drive.powered


@pytest.mark.parametrize(
    ("number", "messages"),
    [((1901, 1), "set-point refused"), (CONTROL, "control word refused")],
)
def test_a_refusal_disables_the_drive(number: tuple[int, int], messages: str) -> None:
    bench = Bench().up()
    bench.drive.refuse[number] = 0x0609
    if number == CONTROL:
        bench.enable = 0
    bench.run(0.05)
    assert bench.reading.phase is Phase.OFF
    assert f"{messages}: error 1545" in bench.explanation


def test_refused_values_age_and_disable_the_drive() -> None:
    bench = Bench().up()
    bench.drive.refuse[(681, 5)] = 0x0602
    bench.run(SERVO.max_status_age + 0.1)
    assert bench.reading.age > SERVO.max_status_age
    assert not bench.drive.powered
    assert bench.explanation.startswith("servo: ")


def test_an_error_whose_number_is_refused_is_still_one() -> None:
    bench = Bench().up()
    bench.drive.refuse[(550, 1)] = 0x0602
    bench.drive.trip(29472)
    bench.run(0.1)
    assert bench.reading.error == NOT_READ
    assert "in error" in bench.explanation
    assert bench.reading.age < 0.02  # its values still arrive


def test_a_silent_drive_still_gets_a_stop() -> None:
    bench = Bench().up()
    bench.port.fault = "cut"  # it receives, but its answers are lost
    bench.run(0.6)
    assert not bench.drive.powered
    assert bench.servo.requests.timeouts >= 1
    assert "no answer in 0.03 s" in bench.explanation
    assert "no status for 0.3 s" in bench.explanation


def test_another_drive_gets_no_requests() -> None:
    bench = Bench(drive=Compax3Peer("C3-Powermodule"))
    bench.enable = 1
    bench.run(1.0)
    assert bench.drive.writes == []
    assert bench.explanation.startswith("servo: calls itself 'C3-Powermodule', not 'Compax3'")
    assert bench.reading.phase is Phase.UNKNOWN
    bench.drive.identity = "Compax3 I10T10"
    bench.run(0.5)
    assert bench.reading.phase is Phase.OFF


def test_a_lost_answer_costs_a_pause_not_the_power() -> None:
    bench = Bench().up()
    bench.port.fault = "cut"
    bench.run(0.02)
    bench.port.fault = "none"
    bench.run(0.3)
    assert bench.drive.powered
    assert bench.servo.requests.timeouts == 1
    assert bench.reading.age < 0.02


@pytest.mark.parametrize("late", [0.032, 0.045, 0.06, 0.08, 0.12, 0.2])
def test_a_late_answer_is_never_taken_for_a_new_one(late: float) -> None:
    """The drive's position is its time, so an answer to an earlier question would show."""
    bench = Bench().up()
    bench.port.fault, bench.port.delay = "late", late
    bench.run(0.04)
    bench.port.fault = "none"
    for _ in range(500):
        bench.run(STEP)
        reading = bench.reading
        assert reading.age >= bench.now - reading.values[0] - 1e-4
    assert reading.age < 0.02


def test_after_a_timeout_the_line_is_quiet_first() -> None:
    requests = Requests("servo", -1, "Compax3", Timing(0.03, 0.05))
    requests.on_open(0.0)
    assert requests.recovery_message(0.0, b"") == b"_?\r"
    assert requests.receive(b"Compax3 x\r", 0.01) is None
    assert requests.is_ready
    assert requests.begin_request(b"question", 0.02) == b"question"
    assert requests.recovery_message(0.049, b"stop") == b""
    assert (
        requests.recovery_message(0.051, b"stop") == b"stop"
    )  # the first thing after a missed answer
    assert not requests.is_identified
    assert requests.receive(b"\x06\x01\x00\x00\xba\x87", 0.06) is None  # late
    assert requests.late == 1
    assert requests.recovery_message(0.105, b"stop") == b""  # 45 ms after the last byte
    assert requests.recovery_message(0.112, b"stop") == b"_?\r"


def test_a_line_that_is_never_quiet_is_used_after_a_wait() -> None:
    requests = Requests("servo", -1, "Compax3", Timing(0.03, 0.05))
    requests.on_open(0.0)
    messages = []
    for n in range(1000):
        now = n * 0.001
        requests.receive(b"\xff", now)
        messages.append(requests.recovery_message(now, b"stop"))
    assert messages.count(b"stop") >= 3
    assert messages.count(b"_?\r") >= 3


def test_a_partial_record_is_dropped_after_the_gap() -> None:
    requests = Requests("servo", -1, "Compax3", Timing(0.03, 0.05))
    requests.on_open(0.0)
    requests.recovery_message(0.0, b"")
    requests.receive(b"\x05\xfb", 0.001)  # announces 252 bytes that never come
    assert requests.receive(b"Compax3\r", 0.001 + GAP / 2) is None
    assert not requests.is_identified
    requests.receive(b"", 0.02)
    assert requests.dropped >= 2
    requests.recovery_message(0.031, b"")  # the name was lost, too: requested again
    assert requests.recovery_message(0.09, b"") == b"_?\r"
    requests.receive(b"Compax3\r", 0.095)
    assert not requests.is_identified  # it might be the first one's, late
    assert requests.recovery_message(0.4, b"") == b"_?\r"  # quiet for long: the first was lost
    requests.receive(b"Compax3\r", 0.405)
    assert requests.is_identified


@pytest.mark.parametrize(
    "wrong",
    [
        {"limit": 0.0},
        {"set_point_timeout": 0.0},
        {"max_status_age": -1.0},
        {"enable_timeout": 0.0},
        {"timing": Timing(0.0, 0.05)},
        {"timing": Timing(0.03, GAP)},
        {
            "actual": (ObjectChannel(Object(680, 5), NumberFormat.REAL48, 1.0),)
        },  # not the status's family
        {"set_point": SET_POINT._replace(per_unit=0.0)},
    ],
)
def test_invalid_settings_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(CodecError):
        Servo(SERVO._replace(**wrong))
