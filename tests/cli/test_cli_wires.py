"""`rig devices` and `rig scan` against the devices of `rig sim`, on free ports and a pty."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import can
import pytest
from command_here import rig as rig_here
from rich.console import Console
from wired_rig import CONFIGS, Ports, ended, free_ports, ready, rig, rig_file, running

from rig.cli import sim as sim_command
from rig.cli.devices import render
from rig.cli.output import BAD_INPUT, FAILED, OK, STOPPED
from rig.config.pydantic_errors import load
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.hardware.job import build_job
from rig.processes.wire_locks import acquire, wires_in
from rig.wires.survey import survey


class Sim(NamedTuple):
    folder: Path
    ports: Ports
    path: Path  # rig file
    message: dict[str, Any]  # of `rig sim` when ready


@pytest.fixture(scope="module")
def sim(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sim]:
    """Emulated devices for all tests of this file; no test writes to them."""
    folder, ports = tmp_path_factory.mktemp("wires"), free_ports()
    path = rig_file(folder, ports)
    with running(path) as message:
        yield Sim(folder, ports, path, message)


class SerialLine(NamedTuple):
    port: str
    baud: int
    parity: str
    stop_bits: int


def run_command(*arguments: object, as_json: bool = True) -> int:
    """Run `rig ARGUMENTS`; print its standard output and return its exit code."""
    done = rig_here(*arguments, *(["--json"] if as_json else []))
    print(done.stdout, end="")
    return done.returncode


def scan_can(
    interface: str,
    channel: str,
    bit_rate: int,
    options: list[str],
    *,
    timeout: float,
    only_listen: bool,
    as_json: bool,
) -> int:
    where = ("-i", interface, "-c", channel, "--bit-rate", bit_rate)
    more = [text for option in options for text in ("-o", option)]
    more += ["--listen"] if only_listen else []
    return run_command("scan", "can", *where, "--timeout", timeout, *more, as_json=as_json)


def scan_modbus(
    address: str | None,
    line: SerialLine | None,
    units: tuple[int, int],
    timeout: float,
    register: int,
    *,
    as_json: bool,
) -> int:
    where: list[object] = [] if address is None else [address]
    if line is not None:
        names = ("--serial", "--baud", "--parity", "--stop-bits")
        where += [text for pair in zip(names, line, strict=True) for text in pair]
    which = ("--first", units[0], "--last", units[1], "--timeout", timeout, "--register", register)
    return run_command("scan", "modbus", *where, *which, as_json=as_json)


def survey_of(path: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, Any]:
    code = run_command("devices", path, *options)
    return code, json.loads(capsys.readouterr().out)


def test_sim_lists_every_device_and_its_address(sim: Sim) -> None:
    assert (sim.message["status"], sim.message["sea"]) == ("ready", "calm water")
    found = {(each["address"], each["number"], each["name"]) for each in sim.message["devices"]}
    bus, amplifiers = f"127.0.0.1:{sim.ports.can}", str(sim.folder / "amplifiers")
    assert found == {
        (bus, 5, "heave"), (bus, 6, "surge"), (bus, 9, "stator"),
        (f"127.0.0.1:{sim.ports.analyser}", 1, "analyser"),
        (f"127.0.0.1:{sim.ports.io}", 1, "inputs"), (f"127.0.0.1:{sim.ports.io}", 1, "outputs"),
        (amplifiers, 1, "cells"), (amplifiers, 2, "probes"),
    }  # fmt: skip


def test_a_second_sim_is_refused_and_names_the_addresses_in_use(sim: Sim) -> None:
    second = rig("sim", sim.path, "--json")
    out, _ = second.communicate(timeout=120)
    assert second.returncode == FAILED
    message = json.loads(out)["message"]
    for name in ("CAN: ", "line analyser: ", "line io: ", "line amplifiers: "):
        assert name in message
    for address in (*map(str, sim.ports), str(sim.folder / "amplifiers")):
        assert address in message
    assert (sim.folder / "amplifiers").exists()  # that of the first sim


def test_all_devices_answer_and_agree(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    code, report = survey_of(sim.path, capsys)
    assert (code, report["trouble"]) == (OK, [])
    nodes = {node["name"]: node for node in report["can"]["nodes"]}
    assert all(node["answers"] and node["wrong"] == [] for node in nodes.values())
    assert nodes["stator"]["identity"]["vendor"] == 0x26C
    assert nodes["heave"]["identity"]["name"] == "Torque drive, AMC scaling"
    assert nodes["heave"]["status_text"].startswith("0x0270 switch on disabled")
    assert "heartbeat_producer" in [entry["name"] for entry in nodes["heave"]["unset"]]
    assert nodes["heave"]["nmt"] is None  # it sends no heartbeat before a run enables it
    units = {unit["name"]: unit for line in report["lines"] for unit in line["units"]}
    (voltage,) = [v for v in units["analyser"]["values"] if v["name"] == "bus_voltage"]
    assert (voltage["unit"], voltage["plausible"]) == ("V", True)
    assert voltage["value"] == pytest.approx(150.0, abs=5.0)
    assert units["probes"]["answers"]
    assert units["probes"]["age"] < 30.0
    assert units["outputs"]["written_by_run"]
    assert units["outputs"]["values"] == []
    assert survey_of(sim.path, capsys)[1]["can"]["nodes"][0]["unset"] == nodes["heave"]["unset"]


def test_a_survey_only_reads(sim: Sim) -> None:
    """The survey sends only SDO uploads: no NMT, SYNC, command or download."""
    bus = can.Bus(interface="socketcand", channel="can0", host="127.0.0.1", port=sim.ports.can)
    seen: list[can.Message] = []
    try:
        job = build_job(load(sim.path, RigFile)[0])
        thread = threading.Thread(target=survey, args=(job,))
        thread.start()
        while thread.is_alive() or (seen and time.time() - seen[-1].timestamp < 0.2):
            message = bus.recv(0.2)
            seen += [message] if message is not None else []
            if message is None and not thread.is_alive():
                break
    finally:
        bus.shutdown()
    requests = [message for message in seen if 0x600 < message.arbitration_id < 0x680]
    assert len(requests) > 300
    assert {request.data[0] >> 5 for request in requests} <= {2, 3}  # upload: initiate, segment
    assert {message.arbitration_id & 0x780 for message in seen} == {0x580, 0x600}


def test_no_text_of_the_view_is_cut(sim: Sim) -> None:
    found = survey(build_job(load(sim.path, RigFile)[0]))
    for width in (100, 80, 140):
        console = Console(width=width, record=True, file=sys.stderr)
        console.print(render("Wires of a test", found, all_objects=True))
        text = console.export_text()
        assert "…" not in text
        assert max(map(len, text.splitlines())) <= width
        for number in ("0x00060192", "0x0000026c", "75 %", "1617166368", "2000", "0x0270"):
            assert number in text
    assert re.search(r"bus_voltage 1[45]\d(\.\d)? V\b", text)


def lines_of(sim: Sim) -> dict[str, Any]:
    return {
        "analyser": {"port": sim.ports.analyser, "timeout_s": 0.5},
        "io": {"port": sim.ports.io, "timeout_s": 0.5},
        "amplifiers": {"port": str(sim.folder / "amplifiers")},
    }


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"surge": {"node": 7}}, "surge (node 7) does not answer"),
        ({"heave": {"objects": {"encoder_increments": 4096}}}, "encoder_increments: expected 4096"),
        ({"probes": {"unit": 3}}, "probes (unit 3 on amplifiers): "),
        ({"analyser": {"word_order": "low first"}}, "is implausible; swapped words?"),
        ({"inputs": {"first": 4000}}, "refused with exception 2"),
        ({"lines": {"amplifiers": {"port": "/dev/no-adapter"}}}, "/dev/no-adapter: is not there"),
    ],
)
def test_a_disagreement_with_the_rig_file_is_named(
    changed: dict[str, Any],
    expected: str,
    sim: Sim,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if "lines" not in changed:  # another rig file with the same serial line
        changed = {**changed, "lines": lines_of(sim)}
    path = rig_file(tmp_path, sim.ports, **changed)
    code, report = survey_of(path, capsys)
    assert code == FAILED
    (trouble,) = report["trouble"]
    assert expected in trouble
    if "surge" in changed:
        assert report["can"]["unlisted_nodes"] == [6]


def test_a_survey_without_devices(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, report = survey_of(rig_file(tmp_path, free_ports()), capsys)
    assert code == FAILED
    assert [text.partition(":")[0].split(" at ")[0] for text in report["trouble"]] == [
        "CAN", "line analyser", "line amplifiers", "line io",
    ]  # fmt: skip
    assert run_command("devices", tmp_path / "rig.yaml", as_json=False) == FAILED
    assert "4 things are wrong" in capsys.readouterr().out


def test_a_run_is_not_disturbed(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    """Every command that would send on a wire of the run is refused, and names the run."""
    port = str(sim.folder / "amplifiers")
    lines = ((f"localhost:{sim.ports.io}", None), (None, SerialLine(port, 115200, "N", 1)))
    bus = ("socketcand", "can0", 1_000_000, ["host=127.0.0.1", f"port={sim.ports.can}"])
    with acquire(wires_in(load(sim.path, RigFile)[0]), "campaign of somebody"):
        code, report = survey_of(sim.path, capsys)
        assert code == FAILED
        assert "campaign of somebody" in report["message"]
        assert "line analyser" in report["message"]
        for line in lines:
            assert scan_modbus(*line, (1, 2), 0.1, 0, as_json=True) == FAILED
            assert "campaign of somebody" in json.loads(capsys.readouterr().out)["message"]
        assert scan_can(*bus, timeout=0.1, only_listen=False, as_json=True) == FAILED
        assert "--listen" in json.loads(capsys.readouterr().out)["message"]
    assert survey_of(sim.path, capsys)[0] == OK  # all wires are free again


def test_listening_sends_nothing(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    """It works while a run holds the wires; emulated nodes send nothing before their setup."""
    bus = can.Bus(interface="socketcand", channel="can0", host="127.0.0.1", port=sim.ports.can)
    try:
        while bus.recv(0.2) is not None:  # boot-up messages of the nodes
            pass
        with acquire(wires_in(load(sim.path, RigFile)[0]), "campaign of somebody"):
            code, report = survey_of(sim.path, capsys, "--listen")
            assert code == FAILED
            assert report["listened_only"]
            assert report["trouble"][0] == "heave (node 5) sends nothing"
            where = ("socketcand", "can0", 1_000_000, ["host=127.0.0.1", f"port={sim.ports.can}"])
            assert scan_can(*where, timeout=0.2, only_listen=True, as_json=True) == FAILED
            assert json.loads(capsys.readouterr().out)["heard"] == []
        assert bus.recv(0.2) is None
    finally:
        bus.shutdown()


def test_scan_finds_the_nodes(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["host=127.0.0.1", f"port={sim.ports.can}"]
    where = ("socketcand", "can0", 1_000_000, options)
    assert scan_can(*where, timeout=0.5, only_listen=False, as_json=True) == OK
    nodes = json.loads(capsys.readouterr().out)["nodes"]
    assert [(node["node"], node["device_type"] & 0xFFFF) for node in nodes] == [
        (5, 402), (6, 402), (9, 402),
    ]  # fmt: skip
    assert scan_can(*where, timeout=0.5, only_listen=False, as_json=False) == OK
    assert "0x0000026c" in capsys.readouterr().out


def test_scan_finds_the_units(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (
        (f"127.0.0.1:{sim.ports.analyser}", None, [1]),
        (None, SerialLine(str(sim.folder / "amplifiers"), 115_200, "N", 1), [1, 2]),
    )
    for address, serial, units in lines:
        scan_options = (address, serial, (1, 4), 0.5, 0)
        assert scan_modbus(*scan_options, as_json=True) == OK
        report = json.loads(capsys.readouterr().out)
        assert [unit["unit"] for unit in report["units"]] == units
        assert (report["queried"], report["every_number_answers"]) == ([1, 2, 3, 4], False)
        assert scan_modbus(*scan_options, as_json=False) == OK
        assert f"{len(units)} of 4 units answer" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("address", "serial", "span"),
    [
        ("127.0.0.1:0", None, (1, 2)),
        ("127.0.0.1:many", None, (1, 2)),
        (None, None, (1, 2)),
        ("127.0.0.1:502", SerialLine("x", 9600, "N", 1), (1, 2)),
        ("127.0.0.1:502", None, (9, 2)),
    ],
)
def test_invalid_scan_options_are_bad_input(
    address: str | None, serial: SerialLine | None, span: tuple[int, int]
) -> None:
    assert scan_modbus(address, serial, span, 0.1, 0, as_json=True) == BAD_INPUT


def test_a_scan_of_a_missing_wire_fails(capsys: pytest.CaptureFixture[str]) -> None:
    closed = free_ports().can
    for bus in (
        ("socketcand", "can0", ["host=127.0.0.1", f"port={closed}"]),
        ("kvaser", "0", []),  # its manufacturer's library is not installed
        ("no_such_interface", "0", []),
    ):
        interface, channel, options = bus
        bus_options = (interface, channel, 1_000_000, options)
        assert scan_can(*bus_options, timeout=0.1, only_listen=False, as_json=True) == FAILED
        assert f"CAN bus {interface} {channel}: " in json.loads(capsys.readouterr().out)["message"]
    bad = ("socketcand", "can0", 1_000_000, ["port"])
    assert scan_can(*bad, timeout=0.1, only_listen=False, as_json=True) == BAD_INPUT
    capsys.readouterr()
    for address, serial in (
        (f"127.0.0.1:{closed}", None),
        (None, SerialLine("/dev/no-adapter", 9600, "N", 1)),
    ):
        assert scan_modbus(address, serial, (1, 2), 0.1, 0, as_json=True) == FAILED
        assert "unit" not in json.loads(capsys.readouterr().out)["message"]


def test_ctrl_c_ends_a_scan_with_its_results_so_far(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"127.0.0.1:{silent.getsockname()[1]}"
        scanning = rig("scan", "modbus", address, "--timeout", "0.5", "--json")
        silent.settimeout(120.0)
        connections = [silent.accept()[0] for _ in range(4)]  # the first test, and three units
        code, out, err = ended(scanning)
        for connection in connections:
            connection.close()
    assert (code, err) == (STOPPED, "")
    report = json.loads(out)
    assert (report["status"], report["units"]) == ("stopped", [])
    assert 1 <= len(report["queried"]) < 200


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_sim_ends_cleanly(number: signal.Signals, tmp_path: Path) -> None:
    ports = free_ports()
    campaign = CONFIGS / "campaigns" / "quick.yaml"
    options = ["--campaign", campaign] if number == signal.SIGINT else []
    process = rig("sim", rig_file(tmp_path, ports), "--json", *options)
    message = ready(process)
    assert ("wave trigger" in message["sea"]) == bool(options)
    assert (tmp_path / "amplifiers").is_symlink()
    assert ended(process, number) == (OK, "", "")
    assert not (tmp_path / "amplifiers").is_symlink()
    for port in ports:
        socket.create_server(("127.0.0.1", port)).close()
    assert not [path for path in tmp_path.iterdir() if path.name.startswith("rig-sim-")]


def test_sim_fails_when_its_devices_die(tmp_path: Path) -> None:
    process = rig("sim", rig_file(tmp_path, free_ports()), "--json")
    ready(process)
    (child,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    os.kill(int(child), signal.SIGKILL)
    _, err = process.communicate(timeout=60)
    assert process.returncode == FAILED
    assert "emulated devices ended" in err


@pytest.mark.parametrize("command", ["sim", "devices"])
def test_a_rig_without_wiring_is_bad_input(command: str) -> None:
    done = rig_here(command, CONFIGS / "rigs" / "wavebot.yaml", "--json")
    assert (done.returncode, done.stderr) == (BAD_INPUT, "")
    assert "has no wiring" in json.loads(done.stdout)["message"]


def test_the_tenth_slave_of_a_segment_is_on_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    slaves = [
        sim_command.EmulatedDevice(
            "EtherCAT", "EtherCAT", "eth1", place, f"probe_{place}", "Analog input"
        )
        for place in range(1, 12)
    ]
    sim_command.show("a rig", slaves, "calm water", as_json=False)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:3] for line in lines if "probe_1" in line] == [
        ["slave", "1", "probe_1"], ["slave", "10", "probe_10"], ["slave", "11", "probe_11"],
    ]  # fmt: skip
