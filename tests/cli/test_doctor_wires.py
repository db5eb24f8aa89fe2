"""Checks of wires by `rig doctor`: on fake hosts, and for one rig."""

from __future__ import annotations

import json
import os
import platform
import socket
from pathlib import Path
from typing import Any

import pytest
from command_here import rig as rig_here
from doctor_hosts import finding_named, make_host, skip_measurements
from wired_rig import CONFIGS, Ports, free_ports, rig_file

from rig.cli.output import BAD_INPUT, FAILED
from rig.config.pydantic_errors import load
from rig.emulation import addresses
from rig.host import DoctorOptions, Host, Use, Verdict, examine, wires
from rig.kinds.wavebot.config import RigFile
from rig.wires import wire_check

NET, TTY = "sys__class__net", "sys__class__tty"
USB = "sys__bus__usb-serial__devices"


def test_a_host_without_any_wire(tmp_path: Path) -> None:
    found = wires.findings(Host(tmp_path / "nothing"))
    notes = {finding.check for finding in found if finding.verdict is Verdict.NOTE}
    assert notes == {
        "CAN in the kernel", "CAN interfaces", "vcan", "serial ports", "latency of USB serial",
    }  # fmt: skip
    assert not [finding for finding in found if finding.forbids]  # no rig, no requirement
    assert "socketcand" in finding_named(found, "python-can backends").numbers["good"]
    assert finding_named(found, "TCP on loopback").numbers["p50_s"] < 0.1


def test_can_of_the_kernel(tmp_path: Path) -> None:
    modules = "kernel/net/can/can-raw.ko.xz:\nkernel/drivers/net/can/vcan.ko.xz:\n"
    dep = f"lib__modules__{platform.release()}__modules.dep"
    shown = {
        f"{NET}__can0__type": "280", f"{NET}__can0__flags": "0x40080",
        f"{NET}__can1__type": "280", f"{NET}__can1__flags": "0x40081",
        f"{NET}__eth0__type": "1", f"{NET}__eth0__flags": "0x1003",
    }  # fmt: skip
    found = wires.findings(make_host(tmp_path / "a", **shown, **{dep: modules.replace("-", "_")}))
    assert finding_named(found, "CAN in the kernel").value == "SocketCAN, not loaded yet"
    assert finding_named(found, "vcan").value == "available: `modprobe vcan`"
    interfaces = finding_named(found, "CAN interfaces")
    assert (interfaces.value, interfaces.verdict) == ("can0 down, can1 up", Verdict.WARNING)
    assert "ip link set can0 up" in interfaces.advice
    shown = {
        f"{NET}__{name}__{file}": text
        for name, carrier in (("can0", "1\n"), ("can1", "0\n"))
        for file, text in (("type", "280"), ("flags", "0x40081"), ("carrier", carrier))
    }
    interfaces = finding_named(
        wires.findings(make_host(tmp_path / "off", **shown)), "CAN interfaces"
    )
    assert interfaces.value == "can0 up, can1 off the bus (bus-off)"
    assert interfaces.verdict is Verdict.WARNING
    assert "`ip link set can1 type can restart`" in interfaces.advice
    found = wires.findings(make_host(tmp_path / "b", **{f"{NET}__can0__flags": "rubbish"}))
    assert finding_named(found, "CAN interfaces").verdict is Verdict.NOTE


def test_serial_ports_and_their_latency(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = {
        f"{TTY}__ttyUSB0__device__x": "", f"{TTY}__ttyS0__device__x": "",
        f"{TTY}__ttyS0__type": "0", f"{TTY}__tty1__type": "", "dev__ttyUSB0": "",
        f"{USB}__ttyUSB0__latency_timer": "16", f"{USB}__ttyUSB1__latency_timer": "1",
    }  # fmt: skip
    here = make_host(tmp_path, **shown)
    found = wires.findings(here)
    assert finding_named(found, "serial ports").value == "ttyUSB0"
    latency = finding_named(found, "latency of USB serial")
    assert (latency.value, latency.verdict) == ("ttyUSB0 16 ms, ttyUSB1 1 ms", Verdict.WARNING)
    assert "usb-serial/devices/ttyUSB0/latency_timer" in latency.advice
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # tests may run as root
    ports = finding_named(wires.findings(here), "serial ports")
    assert ports.verdict is Verdict.WARNING
    assert "not ttyUSB0 (" in ports.value
    assert "rw" in ports.value
    assert "dialout" in ports.advice


def rig_findings(tmp_path: Path, **changed: Any) -> list[Any]:
    rig, _ = load(rig_file(tmp_path, free_ports(), **changed), RigFile)
    return wires.rig_findings(Host(tmp_path / "nothing"), rig)


def test_a_rig_on_this_host_waits_for_emulated_devices(tmp_path: Path) -> None:
    found = rig_findings(tmp_path)
    assert finding_named(found, "load of the CAN bus").value == "75 %"
    waiting = [finding for finding in found if finding.verdict is Verdict.WARNING]
    assert [finding.check for finding in waiting] == [
        "CAN bus", "line analyser", "line io", "line amplifiers",
    ]  # fmt: skip
    assert all("rig sim" in finding.advice for finding in waiting)
    assert not [finding for finding in found if finding.forbids]


@pytest.mark.parametrize(
    ("changed", "check", "expected"),
    [
        ({"can": {"interface": "socketcan", "channel": "can7"}}, "CAN bus", "no interface can7"),
        ({"can": {"interface": "kvaser"}}, "python-can on kvaser", "canlib"),
        ({"can": {"interface": "nothing"}}, "python-can on nothing", "knows no interface"),
        ({"can": {"interface": "slcan"}}, "wiring", "at most 100 Hz"),
        ({"can": {"bit_rate": 500_000}}, "wiring", "heave"),
        ({"lines": {"amplifiers": {"port": "/dev/no-such"}}}, "line amplifiers", "is not there"),
    ],
)
def test_a_missing_wire_is_bad(
    changed: dict[str, Any], check: str, expected: str, tmp_path: Path
) -> None:
    finding = finding_named(rig_findings(tmp_path, **changed), check)
    assert (finding.verdict, finding.forbids) == (Verdict.BAD, (Use.REALTIME,))
    assert expected in finding.value
    assert finding.advice


def test_a_rig_with_all_wires_is_good(tmp_path: Path) -> None:
    servers = [socket.create_server(("127.0.0.1", 0)) for _ in Ports._fields]
    master, slave = os.openpty()
    try:
        (tmp_path / "amplifiers").symlink_to(os.ttyname(slave))
        ports = Ports(*(server.getsockname()[1] for server in servers))
        rig, _ = load(rig_file(tmp_path, ports), RigFile)
        found = wires.rig_findings(Host(tmp_path / "nothing"), rig)
    finally:
        for server in servers:
            server.close()
        os.close(master)
        os.close(slave)
    assert {finding.verdict for finding in found} == {Verdict.GOOD}


def test_the_command_takes_a_rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    skip_measurements(monkeypatch)
    options = ("--runs", tmp_path, "--seconds", 1.0, "--hours", 1.0, "--json")
    path = rig_file(tmp_path, free_ports(), lines={"io": {"host": "no.such.host.invalid"}})
    done = rig_here("doctor", "--rig", path, *options)
    assert done.returncode == FAILED
    report = json.loads(done.stdout)
    assert "wires of Wires of a test" in {entry["area"] for entry in report["findings"]}
    assert "line io: no.such.host.invalid:" in report["verdict"]
    done = rig_here("doctor", "--rig", tmp_path / "none.yaml", *options)
    assert done.returncode == BAD_INPUT
    unwired, _ = load(CONFIGS / "rigs" / "wavebot.yaml", RigFile)
    found = examine(DoctorOptions(tmp_path, 1.0, 1000.0, 1.0, unwired), Host(tmp_path / "nothing"))
    assert finding_named(found.findings, "wiring").value == "none: the rig can only be rehearsed"


def test_reasons_why_a_port_cannot_be_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pulled").symlink_to(tmp_path / "gone")
    (tmp_path / "file").touch()
    assert wire_check.port_problem(str(tmp_path / "none")) == "is not there"
    assert wire_check.port_problem(str(tmp_path / "pulled")) == "leads nowhere: unplugged"
    assert wire_check.port_problem(str(tmp_path / "file")) == "is no serial port"
    assert wire_check.port_problem("/dev/null") == ""
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert "belongs to root:root rw-rw-rw-" in wire_check.port_problem("/dev/null")


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"can": {"interface": "socketcan"}}, "over socketcand only"),
        ({"can": {"options": {"host": "10.0.0.1"}}}, "CAN: 10.0.0.1 is not"),
        ({"lines": {"io": {"host": "10.0.0.1"}}}, "line io: 10.0.0.1 is not"),
        (
            {"lines": {"amplifiers": {"port": "/dev/serial/by-id/x"}}},
            "no emulated port can be created",
        ),
    ],
)
def test_addresses_outside_this_host_cannot_be_emulated(
    changed: dict[str, Any], expected: str, tmp_path: Path
) -> None:
    rig, _ = load(rig_file(tmp_path, free_ports(), **changed), RigFile)
    assert rig.wiring is not None
    (reason,) = addresses.unreachable_addresses(rig.wiring)
    assert expected in reason


def test_a_stale_serial_link_counts_as_free(tmp_path: Path) -> None:
    """A killed emulation leaves its link; its terminal no longer exists, or belongs to another."""
    rig, _ = load(rig_file(tmp_path, free_ports()), RigFile)
    assert rig.wiring is not None
    link = tmp_path / "amplifiers"
    master, slave = os.openpty()
    try:
        link.symlink_to(os.ttyname(slave))
        assert (
            addresses.occupied_addresses(rig.wiring) == ()
        )  # of this process, which is no emulation
    finally:
        os.close(master)
        os.close(slave)
    link.unlink()
    link.symlink_to(tmp_path / "gone")
    assert addresses.occupied_addresses(rig.wiring) == ()
    link.unlink()
    link.touch()
    assert "no link to a pseudo-terminal" in addresses.occupied_addresses(rig.wiring)[0]
