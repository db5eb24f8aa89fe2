"""One lock per wire, for all users and environments of the host, for as long as it is in use."""

from __future__ import annotations

import json
import os
import pty
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from drivers.canopen.bus_settings import BusSettings
from rig.execution.task import run_task
from rig.kinds.rig_file import load_rig
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.tasks import execution_task, wired_mode
from rig.processes.wire_locks import (
    REALTIME_WIRE,
    Wire,
    acquire,
    can_wire,
    network_wire,
    serial_wire,
    wires_in,
)
from rig.recording.runs.create import BusyError

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
HOLDER = """
import os, subprocess, sys, time
from rig.processes.wire_locks import acquire, network_wire
uid, port = int(sys.argv[1]), int(sys.argv[2])
wire = network_wire("line io", "tcp", "127.0.0.1", port)
if uid: os.setuid(uid)  # last: the interpreter's files may be root's alone
with acquire([wire], "campaign first") as held:
    if len(sys.argv) > 3:  # a child that keeps the lock, as a loop does
        child = subprocess.Popen(["sleep", "60"], pass_fds=held.fds)
        print(child.pid, flush=True)
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        number: int = one.getsockname()[1]
        return number


def line(port: int, host: str = "127.0.0.1") -> tuple[Wire]:
    return (network_wire("line io", "tcp", host, port),)


@contextmanager
def holder(port: int, *arguments: str, uid: int = 0, **env: str) -> Iterator[tuple[Any, list[str]]]:
    """Start a process that locks a wire; yield it and its previous output."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(uid), str(port), *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, **env},
    )
    assert process.stdout is not None
    printed = []
    try:
        while (line_read := process.stdout.readline().strip()) != "held":
            assert line_read, "the holder has died"
            printed.append(line_read)
        yield process, printed
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def test_environment_does_not_move_a_lock(port: int, tmp_path: Path) -> None:
    path = str(tmp_path)
    moved = holder(port, TMPDIR=path, HOME=path, XDG_RUNTIME_DIR=path)
    with moved, pytest.raises(BusyError):
        acquire(line(port), "campaign second")
    acquire(line(port), "campaign second").close()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can be two users")
def test_two_users_meet_the_same_lock(port: int) -> None:
    with holder(port, uid=65534) as (process, _), pytest.raises(BusyError) as refused:
        acquire(line(port), "campaign second")
    assert f"campaign first (process {process.pid}, user nobody)" in str(refused.value)


def test_a_refusal_names_wire_holder_and_remedy(port: int) -> None:
    with holder(port) as (process, _), pytest.raises(BusyError) as refused:
        acquire((serial_wire("servo", "/dev/none"), *line(port)), "rig devices")
    assert str(refused.value) == (
        f"line io 127.0.0.1:{port} is taken by campaign first (process {process.pid}, user root); "
        "wait for its end, or stop it with Ctrl-C"
    )
    acquire([serial_wire("servo", "/dev/none")], "x").close()  # all or none: it was released


def test_a_lock_inherited_from_a_killed_program_persists(port: int) -> None:
    """Like the loop of a killed supervisor, which still has to stop its motors."""
    with holder(port, "child") as (process, (child,)):
        process.kill()
        process.wait()
        try:
            with pytest.raises(BusyError, match=r"campaign first .* was killed; its loop"):
                acquire(line(port), "campaign second")
        finally:
            os.kill(int(child), signal.SIGKILL)
        until = time.monotonic() + 10.0
        while True:
            try:
                acquire(line(port), "campaign second").close()
            except BusyError:
                assert time.monotonic() < until
                time.sleep(0.01)
            else:
                break


def test_a_name_taken_without_listening_is_refused_too(port: int) -> None:
    with socket.socket(socket.AF_UNIX) as squatter:
        squatter.bind(f"\0wec-rig/tcp/127.0.0.1:{port}")
        with pytest.raises(BusyError, match="another program"):
            acquire(line(port), "campaign second")


def test_any_number_of_lock_queries_is_refused(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every refusal connects to the holder once, which never accepts the connections."""
    monkeypatch.setattr("rig.processes.wire_locks._BACKLOG", 3)
    with acquire(line(port), "campaign first"):
        for _ in range(10):
            with pytest.raises(BusyError, match="taken by"):
                acquire(line(port), "campaign second")


def test_of_many_contenders_one_gets_the_lock(port: int) -> None:
    arguments = [sys.executable, "-c", HOLDER, "0", str(port)]
    with ExitStack() as stack:
        attempts = []
        for _ in range(4):
            one = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
            attempts.append(stack.enter_context(one))
            stack.callback(one.kill)
        assert sum(one.stdout.readline() == b"held\n" for one in attempts if one.stdout) == 1
        with pytest.raises(BusyError):
            acquire((*line(port), serial_wire("servo", f"/dev/none{port}")), "campaign last")


def same(one: Wire, other: Wire) -> bool:
    return bool(one.identities & other.identities)


def can_bus(interface: str, channel: str, options: dict[str, Any]) -> Wire:
    return can_wire(BusSettings(interface, channel, 500_000, tuple(options.items())))


def test_all_names_of_a_wire_share_one_lock(tmp_path: Path) -> None:
    tcp = network_wire("a", "tcp", "127.0.0.1", 502)
    for name in ("localhost", "127.1", "0.0.0.0", "::ffff:127.0.0.1", "LOCALHOST"):
        assert same(tcp, network_wire("b", "tcp", name, 502)), name
    assert not same(tcp, network_wire("b", "tcp", "127.0.0.1", 503))
    assert not same(tcp, network_wire("b", "tcp", "192.0.2.1", 502))
    assert not same(tcp, network_wire("b", "udp", "127.0.0.1", 502))
    unknown = network_wire("a", "tcp", "NO.such.invalid", 1)
    assert same(unknown, network_wire("b", "tcp", "no.such.invalid", 1))

    master, slave = pty.openpty()
    try:
        device, link = os.ttyname(slave), tmp_path / "by-id"
        early = serial_wire("a", str(link))  # before the emulated devices exist
        link.symlink_to(device)
        assert same(serial_wire("a", str(link)), serial_wire("b", device))
        assert same(early, serial_wire("b", str(link)))
        (tmp_path / "folder").symlink_to(tmp_path)
        assert same(early, serial_wire("b", str(tmp_path / "folder" / "by-id")))
        assert same(serial_wire("a", str(link)), can_bus("slcan", f"{device}@115200", {}))
        assert not same(serial_wire("a", device), serial_wire("b", "/dev/null"))
    finally:
        os.close(master)
        os.close(slave)

    here, there = {"host": "localhost"}, {"host": "127.0.0.1", "port": 29536, "tcp_tune": True}
    assert same(can_bus("socketcand", "can0", here), can_bus("socketcand", "can0", there))
    assert not same(can_bus("socketcand", "can0", here), can_bus("socketcand", "can1", here))
    assert same(can_bus("socketcan", "can0", {}), can_bus("socketcan", "can0", {"fd": True}))
    assert not same(can_bus("pcan", "PCAN_USBBUS1", {}), can_bus("kvaser", "PCAN_USBBUS1", {}))
    # a socketcand on this host serves the kernel's interface of that name
    assert same(can_bus("socketcand", "lo", here), can_bus("socketcan", "lo", {}))
    elsewhere = can_bus("socketcand", "lo", {"host": "192.0.2.1"})
    assert not same(elsewhere, can_bus("socketcan", "lo", {}))


def test_long_names_stay_distinct() -> None:
    far = "/very" * 40
    with acquire([serial_wire("a", f"{far}/1")], "campaign " + "\u00e9\n" * 99):
        acquire([serial_wire("b", f"{far}/2")], "campaign b").close()
        with pytest.raises(BusyError, match="campaign \u00e9"):
            acquire([serial_wire("c", f"{far}/1")], "campaign c")


@pytest.mark.parametrize(
    ("name", "wires"),
    [
        ("wavebot", []),
        ("wavebot_hil", ["CAN", "line analyser", "line io", "line amplifiers"]),
        ("oswec_bench_hil", ["encoders", "servo", "load cell", "line outputs", "line io"]),
    ],
)
def test_every_wire_of_a_rig_file_has_a_lock(name: str, wires: list[str]) -> None:
    found = wires_in(load_rig(CONFIGS / "rigs" / f"{name}.yaml")[0])
    assert [one.name for one in found] == wires
    taken = [identity for one in found for identity in one.identities]
    assert len(taken) == len(set(taken)) >= len(wires)


class Listening:
    """Servers and a pseudo-terminal in place of every wire of the WaveBot."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.servers = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in "123"]
        self.master, slave = pty.openpty()
        os.set_blocking(self.master, False)
        stack.callback(os.close, self.master)
        stack.callback(os.close, slave)
        can, analyser, io = (one.getsockname()[1] for one in self.servers)
        self.wiring = {
            "can": {"options": {"port": can}},
            "lines": {
                "analyser": {"port": analyser},
                "io": {"port": io},
                "amplifiers": {"port": os.ttyname(slave)},
            },
        }
        self.folder = folder

    def rig(self, name: str, **lines: Any) -> Path:
        wiring = {**self.wiring, "lines": {**self.wiring["lines"], **lines}}
        base, limits = (
            CONFIGS / "rigs" / "wavebot_hil.yaml",
            CONFIGS / "limits" / "wavebot_hil.yaml",
        )
        path = self.folder / f"{name}.yaml"
        with path.open("w") as file:
            rig_file = {"extends": str(base), "name": name, "limits": str(limits), "wiring": wiring}
            YAML(typ="safe").dump(rig_file, file)
        return path

    def untouched(self) -> bool:
        for one in self.servers:
            one.settimeout(0.0)
            try:
                one.accept()
            except BlockingIOError:
                continue
            return False
        try:
            return os.read(self.master, 100) == b""
        except BlockingIOError:
            return True


def test_a_refused_run_sends_no_byte(tmp_path: Path) -> None:
    """For run, check and scan, and for a rig of another name that shares one wire."""
    campaign = tmp_path / "campaign.yaml"
    with ExitStack() as stack:
        far = Listening(tmp_path, stack)
        first, runs = far.rig("first"), tmp_path / "runs"
        other = far.rig("other", io={"port": 1}, analyser={"port": 2})
        campaign.write_text(f"extends: {CONFIGS / 'campaigns' / 'quick.yaml'}\nrig: {other}\n")
        report = check_campaign(campaign)
        assert report.campaign is not None
        assert report.plan is not None
        shared = [one for one in wires_in(load_rig(first)[0]) if one.name == "line amplifiers"]
        stack.enter_context(acquire(shared, "campaign first"))
        mode = wired_mode(report.campaign, emulated=False)
        mode = mode._replace(real_clock=False)  # so that only the wire refuses it
        with pytest.raises(BusyError, match=r"line amplifiers .* taken by campaign first"):
            run_task(
                execution_task(report.campaign, report.plan), runs, lambda snapshot: None, mode
            )
        assert not runs.exists()
        arguments = [sys.executable, "-m", "rig"]
        port = str(far.wiring["lines"]["amplifiers"]["port"])  # type: ignore[index]
        for command in (["devices", str(other)], ["scan", "modbus", "--serial", port]):
            command += ["--json"]
            done = subprocess.run(
                [*arguments, *command], capture_output=True, text=True, check=False
            )
            assert done.returncode == 1, done.stderr
            assert "campaign first" in json.loads(done.stdout)["message"]
        assert far.untouched()


def test_the_real_time_lock_is_separate() -> None:
    assert REALTIME_WIRE.identities == {"realtime"}


def test_names_of_any_length_can_be_locked() -> None:
    """The kernel allows 107 bytes, including our prefix."""
    for length in range(60, 140):
        port = f"/tmp/{'x' * length}"
        with acquire((serial_wire("servo", port),), "first"), pytest.raises(BusyError):
            acquire((serial_wire("servo", port),), "second")
