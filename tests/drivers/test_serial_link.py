"""The serial link on ptys: it never waits, owns its port, and recovers after a hang-up."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st
from pty_port import PtyPort

from drivers import rs485_echo
from drivers.errors import LinkError
from drivers.serial_link import MAX_PAUSE, MIN_PAUSE, SerialLink, SerialSettings

ROOT = Path(__file__).resolve().parents[2]
HOLD = """
import sys
from drivers.serial_link import SerialLink, SerialSettings
link = SerialLink(SerialSettings("servo", sys.argv[1], 115200, "N", 1))
link.open()
print("open", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def port(tmp_path: Path) -> Iterator[PtyPort]:
    port = PtyPort(tmp_path / "port")
    yield port
    port.pull()


def settings(port: PtyPort | str, **more: Any) -> SerialSettings:
    path = port if isinstance(port, str) else str(port.path)
    return SerialSettings("servo", path, 115200, "N", 1, **more)


def until(true: Callable[[], object], within: float = 5.0) -> bool:
    end = time.monotonic() + within
    while not true():
        if time.monotonic() > end:
            return False
        time.sleep(0.002)
    return True


def test_bytes_go_both_ways_and_are_counted(port: PtyPort) -> None:
    link = SerialLink(settings(port))
    assert not link.is_open
    link.open()
    assert link.is_open
    assert (link.open_count, link.loss_count, link.problem) == (1, 0, "")
    assert link.send(b"question")
    assert port.read(1.0) == b"question"
    everything = bytes(range(256))
    port.write(everything)
    got = b""
    while len(got) < 256:
        got += b"".join(link.receive())
    assert got == everything
    assert (link.received, link.sent, link.unsent) == (256, 8, 0)
    link.close()


def test_an_empty_receive_does_not_wait(port: PtyPort) -> None:
    link = SerialLink(settings(port))
    link.open()
    best = min(_timed(link.receive) for _ in range(50))
    assert best < 0.0005
    assert link.is_open
    link.close()


def _timed(call: Callable[[], list[bytes]]) -> float:
    began = time.perf_counter()
    assert call() == []
    return time.perf_counter() - began


def test_a_port_of_another_process_is_refused_by_name_until_that_ends(port: PtyPort) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(port.path)],
        cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert holder.stdout is not None
    assert holder.stdin is not None
    try:
        assert holder.stdout.readline() == "open\n"
        link = SerialLink(settings(port))
        with pytest.raises(LinkError, match=f"^servo on {port.path}: in use by another process$"):
            link.open()
        assert link.problem == "in use by another process"
        assert link.receive() == []
        assert not link.is_open
        holder.send_signal(signal.SIGKILL)
        holder.wait(5.0)
        assert until(lambda: link.receive() == [] and link.is_open)  # by itself
        assert link.open_count == 1
        link.close()
    finally:
        holder.kill()
        holder.wait(5.0)
        holder.stdin.close()
        holder.stdout.close()


def test_a_second_link_of_this_process_is_refused_too(port: PtyPort) -> None:
    link, other = SerialLink(settings(port)), SerialLink(settings(port))
    link.open()
    with pytest.raises(LinkError, match="in use"):
        other.open()
    assert link.send(b"still mine")
    assert port.read(1.0) == b"still mine"
    link.close()
    other.open()
    other.close()


@pytest.mark.parametrize("by", ["look", "send"])
def test_a_hang_up_closes_and_a_return_is_found(port: PtyPort, by: str) -> None:
    link = SerialLink(settings(port))
    link.open()
    port.pull()
    if by == "look":
        assert until(lambda: link.receive() == [] and not link.is_open)
    else:
        assert until(lambda: not link.send(b"x"))
        assert link.unsent >= 1
    assert link.loss_count == 1
    assert link.problem.startswith("hung up")
    assert not link.send(b"x")
    assert link.receive() == []
    port.plug()
    assert until(lambda: link.receive() == [] and link.is_open)
    assert (link.open_count, link.loss_count, link.problem) == (2, 1, "")
    port.write(b"back")
    assert until(lambda: b"".join(link.receive()) == b"back")
    link.close()


def test_bytes_before_a_hang_up_are_returned_once(port: PtyPort) -> None:
    """The bytes that the kernel still has are returned once, and the end is detected."""
    link = SerialLink(settings(port))
    link.open()
    port.write(b"last words")
    port.pull()
    got = b""
    while link.is_open:
        got += b"".join(link.receive())
    assert b"last words".startswith(got)


def test_the_pause_between_attempts_doubles() -> None:
    now = [100.0]
    link = SerialLink(settings("/dev/there-is-none"), clock=lambda: now[0])
    attempts = []
    for _ in range(3000):
        now[0] += 0.01
        link.problem = "untouched"
        assert link.receive() == []
        if link.problem != "untouched":
            assert link.problem == "there is no such port"
            attempts.append(now[0])
    gaps = [b - a for a, b in itertools.pairwise(attempts)]
    expected = [min(MIN_PAUSE * 2**n, MAX_PAUSE) for n in range(len(gaps))]
    assert len(gaps) > 7
    assert gaps == pytest.approx(expected, abs=0.011)


def test_a_missing_port_names_device_and_port(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match=r"servo on /dev/there-is-none: there is no such port"):
        SerialLink(settings("/dev/there-is-none")).open()
    file = tmp_path / "file"
    file.write_text("no port")
    with pytest.raises(LinkError, match=f"servo on {file}: "):
        SerialLink(settings(str(file))).open()
    with pytest.raises(LinkError, match="servo on "):
        SerialLink(SerialSettings("servo", str(file), 115200, "X", 1)).open()


def test_a_full_line_is_counted_not_waited_for(port: PtyPort) -> None:
    link = SerialLink(settings(port))
    link.open()
    began = time.monotonic()
    taken = [link.send(bytes(1024)) for _ in range(200)]
    assert time.monotonic() - began < 2.0
    assert not all(taken)
    assert link.unsent == taken.count(False)
    assert link.is_open
    link.close()


def test_the_port_gets_the_configured_settings(
    port: PtyPort, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pty accepts any setting, so the test can only see the requested settings."""
    seen: list[Any] = []
    open_serial = serial.Serial

    def remember(*args: Any, **kwargs: Any) -> serial.Serial:
        seen.append((args, kwargs))
        return open_serial(*args, **kwargs)

    monkeypatch.setattr(serial, "Serial", remember)
    link = SerialLink(SerialSettings("load cell", str(port.path), 1_250_000, "E", 2, rts_cts=1))
    link.open()
    link.close()
    ((args, kwargs),) = seen
    assert args == (str(port.path),)
    assert kwargs == {
        "baudrate": 1_250_000, "parity": "E", "stopbits": 2, "rtscts": True, "timeout": 0,
        "write_timeout": 0, "exclusive": True,
    }  # fmt: skip


def test_low_latency_is_never_requested_of_a_pty(port: PtyPort) -> None:
    plain, quick = SerialLink(settings(port)), SerialLink(settings(port, low_latency=1))
    plain.open()
    assert plain.low_latency == "not asked for"
    plain.close()
    quick.open()
    assert quick.low_latency == "not on a pseudo-terminal"
    assert quick.send(b"usable")
    assert port.read(1.0) == b"usable"
    quick.close()


@pytest.mark.parametrize(
    ("fails", "answer"), [(None, "set"), (ValueError("no ioctl"), "refused: no ioctl")]
)
def test_low_latency_is_reported(
    port: PtyPort, monkeypatch: pytest.MonkeyPatch, fails: Exception | None, answer: str
) -> None:
    requested = []

    def low_latency(self: Any, on: bool) -> None:
        requested.append(on)
        if fails is not None:
            raise fails

    monkeypatch.setattr(serial.Serial, "set_low_latency_mode", low_latency)
    monkeypatch.setattr("os.major", lambda _: 188)  # ttyUSB
    link = SerialLink(settings(port, low_latency=1))
    link.open()
    assert (requested, link.low_latency, link.is_open) == ([True], answer, True)
    link.close()


def test_an_echo_is_not_taken_for_an_answer(port: PtyPort) -> None:
    link = SerialLink(settings(port, echo=1))
    link.open()
    link.send(b"question")
    port.write(port.read(1.0) + b"answer")
    got = b""
    while b"answer" not in got:
        got += b"".join(link.receive())
    assert got == b"answer"
    assert link.echoes_missed == 0
    link.close()


@given(st.binary(min_size=1, max_size=12), st.binary(max_size=12), st.lists(st.integers(0, 24)))
def test_an_echo_is_removed_however_it_is_split(
    sent: bytes, answer: bytes, cuts: list[int]
) -> None:
    state = rs485_echo.record_sent(rs485_echo.start(), sent)
    data, got = sent + answer, b""
    places = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    for a, b in itertools.pairwise(places):
        state, more = rs485_echo.strip_echo(state, data[a:b])
        got += more
    assert got == answer
    assert state == rs485_echo.start()


@given(st.binary(min_size=1, max_size=6), st.binary(min_size=1, max_size=12))
def test_without_an_echo_no_byte_is_lost(sent: bytes, answer: bytes) -> None:
    state = rs485_echo.record_sent(rs485_echo.start(), sent)
    got = b""
    for byte in answer:
        state, more = rs485_echo.strip_echo(state, bytes((byte,)))
        got += more
    if answer.startswith(sent):  # then it is an echo
        assert got == answer[len(sent) :]
    else:
        assert got + state.expected[: state.matched] == answer
        assert state.missed_echoes == (0 if sent.startswith(answer) else 1)


def test_a_port_closes_with_unsent_bytes(port: PtyPort) -> None:
    link = SerialLink(settings(port))
    link.open()
    for _ in range(100):
        link.send(bytes(1024))
    began = time.monotonic()
    link.close()
    link.close()
    assert time.monotonic() - began < 1.0
    assert link.problem == "closed"
    assert os.path.exists(port.path)
