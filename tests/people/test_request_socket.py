"""The socket of a run: strangers, nonsense, many clients, the ring's descriptor, the command."""

from __future__ import annotations

import json
import math
import mmap
import os
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from attended_run import AttendedRun
from core_kinds import BENCH
from rig_command import rig
from test_manual_runs import started

from rig.cli.output import OK, STOPPED
from rig.people.request_client import RequestClient, RequestError
from rig.people.request_socket import (
    MAX_CLIENTS,
    MAX_LINE,
    MAX_REQUESTS_PER_S,
    VERSION,
    RequestServer,
    short_path,
)
from rig.recording import ring
from rig.recording.journal import JOURNAL, Entry, Journal, read_journal
from rig.recording.runs import reader
from rig.recording.runs.folder import SOCKET


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[Path, AttendedRun]]:
    run, fd = AttendedRun(manual=True), ring.create(BENCH.row_type, 1000)
    run.power_on()
    server = RequestServer(tmp_path, run.orders, {"run": "one"}, fd)
    yield tmp_path, run
    server.close()
    os.close(fd)


def connect(folder: Path) -> socket.socket:
    found = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    found.settimeout(10.0)
    with short_path(folder) as path:
        found.connect(path)
    return found


def answer(client: socket.socket, line: bytes) -> dict[str, Any]:
    client.sendall(line + b"\n")
    with client.makefile("rb") as lines:
        found: dict[str, Any] = json.loads(lines.readline())
    return found


def is_cut_off(client: socket.socket) -> bool:
    try:
        return client.recv(100) == b""
    except ConnectionError:
        return True


def message(ask: str, **more: Any) -> bytes:
    return json.dumps({"v": VERSION, "ask": ask, **more}).encode()


def test_a_client_asks_and_is_answered(served: tuple[Path, AttendedRun]) -> None:
    folder, run = served
    with closing(RequestClient(folder)) as client:
        assert client.ask("state")["manual"]
        assert client.ask("columns")["columns"] == run.orders.columns()
        found = client.ask("set", values={"kp": -10.0})
        assert (found["accepted"], found["facts"]["in_force"]) == (True, True)
        assert not client.ask("set", values={"kp": 10.0})["accepted"]
        assert client.ask("hold", viewer=True)["reason"] == "viewers can only look"


def test_the_socket_is_for_its_user_alone(served: tuple[Path, AttendedRun]) -> None:
    mode = (served[0] / SOCKET).stat().st_mode
    assert stat.S_IMODE(mode) == 0o600
    assert stat.S_ISSOCK(mode)


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become another user")
def test_another_user_is_refused(served: tuple[Path, AttendedRun]) -> None:
    """Even one who can open the socket's file: the peer's credentials decide."""
    folder, _ = served
    script = (
        "import os, socket, sys\n"
        "fd = os.open(sys.argv[1], os.O_RDONLY)\n"
        "os.setgid(65534); os.setuid(65534)\n"
        "s = socket.socket(socket.AF_UNIX)\n"
        f"s.connect(f'/proc/self/fd/{{fd}}/{SOCKET}')\n"
        's.sendall(b\'{"v": 1, "ask": "stop"}\\n\')\n'
        "print(s.makefile().read())\n"
    )
    command = [sys.executable, "-c", script, str(folder)]
    refused = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "PermissionError" in refused.stderr
    folder.chmod(0o755)
    (folder / SOCKET).chmod(0o666)
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "another user" in found.stdout, found.stderr
    assert served[1].orders.describe()["request"]["code"] == 0


@pytest.mark.parametrize(
    "line",
    [
        b"nonsense", b"{", b"\xff\xfe", b"", b"[" * 60_000,
        b'{"v": 1, "ask": ' + b"9" * 5000 + b"}",
    ],
)  # fmt: skip
def test_nonsense_is_cut_off(served: tuple[Path, AttendedRun], line: bytes) -> None:
    with closing(connect(served[0])) as client:
        client.sendall(line + b"\n")
        assert is_cut_off(client)
    with closing(RequestClient(served[0])) as client:
        assert client.ask("state")["accepted"]


@pytest.mark.parametrize(
    "line",
    [
        b"1", b"[]", b"null", b'{"v": 2, "ask": "state"}', b'{"ask": "state"}',
        message("explode"), message("hold", arguments=[]), b'{"v": 1, "ask": ["hold"]}',
        message("set", arguments={"values": 3}),
        message("set", arguments={"values": {"kp": 1e400}}),
        message("abort", viewer=True),
    ],
)  # fmt: skip
def test_messages_that_are_no_request_are_refused(
    served: tuple[Path, AttendedRun], line: bytes
) -> None:
    with closing(connect(served[0])) as client:
        found = answer(client, line)
        assert not found["accepted"]
        assert found["reason"]
        assert answer(client, message("state"))["accepted"]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_is_refused(
    served: tuple[Path, AttendedRun], value: float
) -> None:
    folder, run = served
    before = len(run.journal.entries)
    with closing(RequestClient(folder)) as client:
        found = client.ask("set", values={"kp": value})
        assert not found["accepted"]
        assert "not a finite number" in found["reason"]
        assert client.ask("state")["accepted"]
    with closing(connect(folder)) as other:
        line = message("set", arguments={"values": {"kp": 1}}).replace(b"1}}", b"-1e999}}")
        assert answer(other, line)["reason"] == "-1e999: not a finite number"
    assert len(run.journal.entries) == before


def test_a_journal_has_texts_for_numbers_that_are_not_finite(tmp_path: Path) -> None:
    journal = Journal(lambda: tmp_path)
    values = {"values": {"kp": math.nan, "ki": [1.5, -math.inf]}}
    assert journal.add(Entry("now", 1, "Ada", "page", "set", values, False, "refused ü"))
    written = (tmp_path / JOURNAL).read_bytes()
    assert "ü".encode() in written
    (found,) = read_journal(written)
    assert found.arguments == {"values": {"kp": "NaN", "ki": [1.5, "-Infinity"]}}
    (earlier,) = read_journal(written.replace(b'"NaN"', b"NaN"))
    assert math.isnan(earlier.arguments["values"]["kp"])


def test_half_a_character_reaches_the_journal_as_text(served: tuple[Path, AttendedRun]) -> None:
    with closing(connect(served[0])) as client:
        line = message("annotate", arguments={"text": "\ud800 x"})
        assert answer(client, line)["accepted"]


def test_a_line_that_is_too_long_is_cut_off(served: tuple[Path, AttendedRun]) -> None:
    with closing(connect(served[0])) as client:
        try:
            for _ in range(100):
                client.sendall(b"x" * MAX_LINE)
        except OSError:
            return
        raise AssertionError("the run read 6 MB of one line")


def test_a_hundred_clients_leave_room_for_one_more(served: tuple[Path, AttendedRun]) -> None:
    """Those that are silent for longest lose their connection."""
    silent = [connect(served[0]) for _ in range(100)]
    with closing(RequestClient(served[0])) as client:
        assert client.ask("stop")["accepted"]
    time.sleep(0.2)
    cut = sum(is_cut_off(each) for each in silent[: 100 - MAX_CLIENTS])
    assert cut == 100 - MAX_CLIENTS
    for each in silent:
        each.close()


def test_many_clients_at_once(served: tuple[Path, AttendedRun]) -> None:
    def ask(_: int) -> bool:
        with closing(RequestClient(served[0])) as client:
            return all(client.ask("state")["accepted"] for _ in range(20))

    with ThreadPoolExecutor(16) as pool:
        assert all(pool.map(ask, range(64)))


def test_half_open_connections_and_parts_of_lines(served: tuple[Path, AttendedRun]) -> None:
    half = connect(served[0])
    half.sendall(message("state")[:10])
    half.shutdown(socket.SHUT_WR)
    assert is_cut_off(half)
    half.close()
    with closing(connect(served[0])) as slow:
        whole = message("state") + b"\n" + message("columns") + b"\n"
        for i in range(len(whole)):
            slow.sendall(whole[i : i + 1])
        with slow.makefile("rb") as lines:
            assert json.loads(lines.readline())["accepted"]
            assert "columns" in json.loads(lines.readline())


def test_a_client_that_never_reads_delays_nobody(served: tuple[Path, AttendedRun]) -> None:
    deaf = connect(served[0])
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
    deaf.settimeout(0.5)
    try:
        while True:
            deaf.sendall((message("state") + b"\n") * 100)
    except OSError:
        pass
    began = time.monotonic()
    with closing(RequestClient(served[0])) as client:
        assert client.ask("hold")["accepted"]
    assert time.monotonic() - began < 5.0
    deaf.close()


def test_the_rate_of_requests_is_limited_but_not_that_of_stops(
    served: tuple[Path, AttendedRun],
) -> None:
    with closing(RequestClient(served[0])) as client:
        found = [client.ask("annotate", text="x") for _ in range(MAX_REQUESTS_PER_S + 5)]
        assert [each["accepted"] for each in found[:MAX_REQUESTS_PER_S]] == [True] * 10
        assert "a second" in found[-1]["reason"]
        assert all(client.ask("stop")["accepted"] for _ in range(50))


def test_the_descriptor_of_the_ring_is_to_read_only(served: tuple[Path, AttendedRun]) -> None:
    with closing(RequestClient(served[0])) as client:
        facts, fd = client.hello()
    try:
        assert facts["run"] == "one"
        assert mmap.mmap(fd, 4096, prot=mmap.PROT_READ)[:1]
        with pytest.raises(PermissionError):
            mmap.mmap(fd, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE)
        with pytest.raises(OSError):  # noqa: PT011  bad descriptor
            os.write(fd, b"x")
        with pytest.raises(OSError):  # noqa: PT011
            os.ftruncate(fd, 0)
        assert not os.get_inheritable(fd)
    finally:
        os.close(fd)


def test_a_folder_with_a_long_path(tmp_path: Path) -> None:
    folder = tmp_path / ("a" * 120) / ("b" * 120)
    folder.mkdir(parents=True)
    run, fd = AttendedRun(), ring.create(BENCH.row_type, 1000)
    server = RequestServer(folder, run.orders, {}, fd)
    with closing(RequestClient(folder)) as client:
        assert client.ask("state")["accepted"]
    server.close()
    assert not (folder / SOCKET).exists()
    with pytest.raises(RequestError, match="does not listen"):
        RequestClient(folder)
    os.close(fd)


def test_a_client_of_a_run_that_ends(served: tuple[Path, AttendedRun], tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    fd = ring.create(BENCH.row_type, 1000)
    server = RequestServer(other, served[1].orders, {}, fd)
    with closing(RequestClient(other)) as client:
        assert client.ask("state")["accepted"]
        server.close()
        for _ in range(2):
            with pytest.raises(RequestError, match=r"\Athe run has ended\Z"):
                client.ask("state")
    os.close(fd)


def test_a_client_that_was_cut_off_learns_why(served: tuple[Path, AttendedRun]) -> None:
    """The run goes on: the client asked for too long, or others took its place."""
    why = f"the run closed this connection: it has more than {MAX_CLIENTS} clients, or could not "
    with closing(RequestClient(served[0])) as client:
        with pytest.raises(RequestError, match=why):
            client.ask("annotate", text="x" * 4 * MAX_LINE)
        with pytest.raises(RequestError, match=why):  # the pipe is broken by now
            client.ask("state")


@pytest.mark.parametrize(("line", "why"), [(b"", "within 0.2 s"), (b"[1]\n{", "cannot be read")])
def test_a_run_that_answers_nothing_that_can_be_read(
    line: bytes, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rig.people.request_client.TIMEOUT_S", 0.2)
    with socket.socket(socket.AF_UNIX) as listener, short_path(tmp_path) as path:
        listener.bind(path)
        listener.listen()
        with closing(RequestClient(tmp_path)) as client:
            other, _ = listener.accept()
            with other:
                other.sendall(line)
                with pytest.raises(RequestError, match=why):
                    client.ask("state")


def test_exit_codes_of_the_command(tmp_path: Path) -> None:
    none = rig("request", "hold", "--runs", tmp_path)
    assert (none.returncode, "no run is running" in none.stderr) == (2, True)
    assert rig("request", "explode", "--runs", tmp_path).returncode == 2
    for wrong in (("hold", "a=1"), ("set",), ("set", "kp"), ("set", "other.kp=1")):
        assert rig("request", *wrong, "--runs", tmp_path).returncode == 2, wrong


@pytest.mark.slow
def test_two_runs_at_once(tmp_path: Path) -> None:
    """Each has its socket; a command reaches the one in its folder of runs."""
    (tmp_path / "a").mkdir()
    with started(tmp_path / "a", "manual", "--unattended") as run:
        second = run.folder.parent.parent / "b"
        second.mkdir()
        with started(second, "manual", "--unattended") as other:
            code = rig("request", "stop", "--runs", second / "runs").returncode
            assert code == OK
            assert other.process.wait(60.0) == STOPPED
        assert run.process.poll() is None
        run.must("stop")
        assert run.process.wait(60.0) == STOPPED
    assert len(reader.open_files(run.folder).leaves) > 10
