"""`rig sim`, `rig devices` and `rig scan` against each other, on ports and a pty of their own."""

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

from rig.cli import BAD_INPUT, FAILED, OK, STOPPED
from rig.cli.devices import main as devices
from rig.cli.devices_view import drawn
from rig.cli.scan_commands import Serial, scan_can, scan_modbus
from rig.config import RigFile, load
from rig.execution.hardware.job import job_of
from rig.execution.hardware.survey import survey
from rig.processes.wire_locks import hold, wires_of


class Sim(NamedTuple):
    folder: Path
    ports: Ports
    path: Path  # rig file
    told: dict[str, Any]


@pytest.fixture(scope="module")
def sim(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sim]:
    """Emulated devices for all tests of this file; nobody writes to them."""
    folder, ports = tmp_path_factory.mktemp("wires"), free_ports()
    path = rig_file(folder, ports)
    with running(path) as told:
        yield Sim(folder, ports, path, told)


def looked(path: Path, capsys: pytest.CaptureFixture[str], **how: bool) -> tuple[int, Any]:
    code = devices(path, **{"only_listen": False, "objects": False, "as_json": True, **how})
    return code, json.loads(capsys.readouterr().out)


def test_sim_tells_every_address_and_what_hangs_there(sim: Sim) -> None:
    assert (sim.told["status"], sim.told["sea"]) == ("ready", "calm water")
    found = {(one["address"], one["number"], one["name"]) for one in sim.told["devices"]}
    bus, amplifiers = f"127.0.0.1:{sim.ports.can}", str(sim.folder / "amplifiers")
    assert found == {
        (bus, 5, "heave"), (bus, 6, "surge"), (bus, 9, "stator"),
        (f"127.0.0.1:{sim.ports.analyser}", 1, "analyser"),
        (f"127.0.0.1:{sim.ports.io}", 1, "inputs"), (f"127.0.0.1:{sim.ports.io}", 1, "outputs"),
        (amplifiers, 1, "cells"), (amplifiers, 2, "probes"),
    }  # fmt: skip


def test_a_second_sim_is_refused_and_names_what_is_taken(sim: Sim) -> None:
    second = rig("sim", sim.path, "--json")
    out, _ = second.communicate(timeout=120)
    assert second.returncode == FAILED
    said = json.loads(out)["message"]
    for name in ("CAN: ", "line analyser: ", "line io: ", "line amplifiers: "):
        assert name in said
    for address in (*map(str, sim.ports), str(sim.folder / "amplifiers")):
        assert address in said
    assert (sim.folder / "amplifiers").exists()  # the first one's is left alone


def test_all_devices_answer_and_agree(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    code, told = looked(sim.path, capsys)
    assert (code, told["trouble"]) == (OK, [])
    nodes = {node["name"]: node for node in told["can"]["nodes"]}
    assert all(node["answers"] and node["wrong"] == [] for node in nodes.values())
    assert nodes["stator"]["identity"]["vendor"] == 0x26C
    assert nodes["heave"]["identity"]["name"] == "Torque drive, AMC scaling"
    assert nodes["heave"]["status_words"].startswith("0x0270 switch on disabled")
    assert "heartbeat_producer" in [one["name"] for one in nodes["heave"]["unset"]]
    assert nodes["heave"]["nmt"] is None  # it sends no heartbeat before a run told it to
    units = {unit["name"]: unit for line in told["lines"] for unit in line["units"]}
    (voltage,) = [v for v in units["analyser"]["values"] if v["name"] == "bus_voltage"]
    assert (voltage["unit"], voltage["believed"]) == ("V", True)
    assert voltage["value"] == pytest.approx(150.0, abs=5.0)
    assert units["probes"]["answers"]
    assert units["probes"]["age"] < 30.0
    assert units["outputs"]["told"]
    assert units["outputs"]["values"] == []
    assert looked(sim.path, capsys)[1]["can"]["nodes"][0]["unset"] == nodes["heave"]["unset"]


def test_looking_only_reads(sim: Sim) -> None:
    """Whatever goes over the bus meanwhile is a question, never NMT, SYNC, command or download."""
    bus = can.Bus(interface="socketcand", channel="can0", host="127.0.0.1", port=sim.ports.can)
    seen: list[can.Message] = []
    try:
        job = job_of(load(sim.path, RigFile)[0])
        looking = threading.Thread(target=survey, args=(job,))
        looking.start()
        while looking.is_alive() or (seen and time.time() - seen[-1].timestamp < 0.2):
            message = bus.recv(0.2)
            seen += [message] if message is not None else []
            if message is None and not looking.is_alive():
                break
    finally:
        bus.shutdown()
    asked = [one for one in seen if 0x600 < one.arbitration_id < 0x680]
    assert len(asked) > 300
    assert {one.data[0] >> 5 for one in asked} <= {2, 3}  # initiate upload, upload segment
    assert {one.arbitration_id & 0x780 for one in seen} == {0x580, 0x600}


def test_what_is_drawn_is_never_cut(sim: Sim) -> None:
    found = survey(job_of(load(sim.path, RigFile)[0]))
    for width in (100, 80, 140):
        console = Console(width=width, record=True, file=sys.stderr)
        console.print(drawn("Wires of a test", found, every_object=True))
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
    ("changed", "said"),
    [
        ({"surge": {"node": 7}}, "surge (node 7) does not answer"),
        ({"heave": {"objects": {"encoder_increments": 4096}}}, "encoder_increments: wanted 4096"),
        ({"probes": {"unit": 3}}, "probes (unit 3 on amplifiers): "),
        ({"analyser": {"word_order": "low first"}}, "cannot be; swapped words?"),
        ({"inputs": {"first": 4000}}, "refused with exception 2"),
        ({"lines": {"amplifiers": {"port": "/dev/no-adapter"}}}, "/dev/no-adapter: is not there"),
    ],
)
def test_what_does_not_agree_is_named(
    changed: dict[str, Any], said: str, sim: Sim, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if "lines" not in changed:  # the rig file is another, its serial line the same
        changed = {**changed, "lines": lines_of(sim)}
    path = rig_file(tmp_path, sim.ports, **changed)
    code, told = looked(path, capsys)
    assert code == FAILED
    (trouble,) = told["trouble"]
    assert said in trouble
    if "surge" in changed:
        assert told["can"]["strangers"] == [6]


def test_nobody_is_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, told = looked(rig_file(tmp_path, free_ports()), capsys)
    assert code == FAILED
    assert [text.partition(":")[0].split(" at ")[0] for text in told["trouble"]] == [
        "CAN", "line analyser", "line amplifiers", "line io",
    ]  # fmt: skip
    assert devices(tmp_path / "rig.yaml", only_listen=False, objects=False, as_json=False) == FAILED
    assert "4 things are wrong" in capsys.readouterr().out


def test_a_run_is_not_disturbed(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    """Whoever would send on one of its wires is refused, and told by whom."""
    port = str(sim.folder / "amplifiers")
    lines = ((f"localhost:{sim.ports.io}", None), (None, Serial(port, 115200, "N", 1)))
    bus = ("socketcand", "can0", 1_000_000, ["host=127.0.0.1", f"port={sim.ports.can}"])
    with hold(wires_of(load(sim.path, RigFile)[0]), "campaign of somebody"):
        code, told = looked(sim.path, capsys)
        assert code == FAILED
        assert "campaign of somebody" in told["message"]
        assert "line analyser" in told["message"]
        for line in lines:
            assert scan_modbus(*line, (1, 2), 0.1, 0, as_json=True) == FAILED
            assert "campaign of somebody" in json.loads(capsys.readouterr().out)["message"]
        assert scan_can(*bus, patience=0.1, only_listen=False, as_json=True) == FAILED
        assert "--listen" in json.loads(capsys.readouterr().out)["message"]
    assert looked(sim.path, capsys)[0] == OK  # all is free again


def test_listening_sends_nothing(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    """Beside whoever has the wires; emulated nodes that no run has set up say nothing."""
    bus = can.Bus(interface="socketcand", channel="can0", host="127.0.0.1", port=sim.ports.can)
    try:
        while bus.recv(0.2) is not None:  # the nodes have just booted
            pass
        with hold(wires_of(load(sim.path, RigFile)[0]), "campaign of somebody"):
            code, told = looked(sim.path, capsys, only_listen=True)
            assert code == FAILED
            assert told["listened_only"]
            assert told["trouble"][0] == "heave (node 5) sends nothing"
            where = ("socketcand", "can0", 1_000_000, ["host=127.0.0.1", f"port={sim.ports.can}"])
            assert scan_can(*where, patience=0.2, only_listen=True, as_json=True) == FAILED
            assert json.loads(capsys.readouterr().out)["heard"] == []
        assert bus.recv(0.2) is None
    finally:
        bus.shutdown()


def test_scan_finds_the_nodes(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["host=127.0.0.1", f"port={sim.ports.can}"]
    where = ("socketcand", "can0", 1_000_000, options)
    assert scan_can(*where, patience=0.5, only_listen=False, as_json=True) == OK
    nodes = json.loads(capsys.readouterr().out)["nodes"]
    assert [(one["node"], one["device_type"] & 0xFFFF) for one in nodes] == [
        (5, 402), (6, 402), (9, 402),
    ]  # fmt: skip
    assert scan_can(*where, patience=0.5, only_listen=False, as_json=False) == OK
    assert "0x0000026c" in capsys.readouterr().out


def test_scan_finds_the_units(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (
        (f"127.0.0.1:{sim.ports.analyser}", None, [1]),
        (None, Serial(str(sim.folder / "amplifiers"), 115_200, "N", 1), [1, 2]),
    )
    for address, serial, units in lines:
        asked = (address, serial, (1, 4), 0.5, 0)
        assert scan_modbus(*asked, as_json=True) == OK
        told = json.loads(capsys.readouterr().out)
        assert [one["unit"] for one in told["units"]] == units
        assert (told["asked"], told["every_number_answers"]) == ([1, 2, 3, 4], False)
        assert scan_modbus(*asked, as_json=False) == OK
        assert f"{len(units)} of 4 units answer" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("address", "serial", "span"),
    [
        ("127.0.0.1:0", None, (1, 2)),
        ("127.0.0.1:many", None, (1, 2)),
        (None, None, (1, 2)),
        ("127.0.0.1:502", Serial("x", 9600, "N", 1), (1, 2)),
        ("127.0.0.1:502", None, (9, 2)),
    ],
)
def test_scan_is_asked_for_nonsense(
    address: str | None, serial: Serial | None, span: tuple[int, int]
) -> None:
    assert scan_modbus(address, serial, span, 0.1, 0, as_json=True) == BAD_INPUT


def test_scan_of_wires_that_are_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    closed = free_ports().can
    for bus in (
        ("socketcand", "can0", ["host=127.0.0.1", f"port={closed}"]),
        ("kvaser", "0", []),  # its maker's library is not among ours
        ("no_such_interface", "0", []),
    ):
        interface, channel, options = bus
        asked = (interface, channel, 1_000_000, options)
        assert scan_can(*asked, patience=0.1, only_listen=False, as_json=True) == FAILED
        assert f"CAN bus {interface} {channel}: " in json.loads(capsys.readouterr().out)["message"]
    bad = ("socketcand", "can0", 1_000_000, ["port"])
    assert scan_can(*bad, patience=0.1, only_listen=False, as_json=True) == BAD_INPUT
    capsys.readouterr()
    for address, serial in (
        (f"127.0.0.1:{closed}", None),
        (None, Serial("/dev/no-adapter", 9600, "N", 1)),
    ):
        assert scan_modbus(address, serial, (1, 2), 0.1, 0, as_json=True) == FAILED
        assert "unit" not in json.loads(capsys.readouterr().out)["message"]


def test_ctrl_c_ends_a_scan_with_what_was_found(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        address = f"127.0.0.1:{deaf.getsockname()[1]}"
        scanning = rig("scan", "modbus", address, "--timeout", "0.5", "--json")
        deaf.settimeout(120.0)
        held = [deaf.accept()[0] for _ in range(4)]  # the first look, and three units
        code, out, err = ended(scanning)
        for one in held:
            one.close()
    assert (code, err) == (STOPPED, "")
    told = json.loads(out)
    assert (told["status"], told["units"]) == ("stopped", [])
    assert 1 <= len(told["asked"]) < 200


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_sim_ends_cleanly(number: signal.Signals, tmp_path: Path) -> None:
    ports = free_ports()
    words = ["--campaign", CONFIGS / "campaigns" / "quick.yaml"] if number == signal.SIGINT else []
    process = rig("sim", rig_file(tmp_path, ports), "--json", *words)
    told = ready(process)
    assert ("wave trigger" in told["sea"]) == bool(words)
    assert (tmp_path / "amplifiers").is_symlink()
    assert ended(process, number) == (OK, "", "")
    assert not (tmp_path / "amplifiers").is_symlink()
    for port in ports:
        socket.create_server(("127.0.0.1", port)).close()
    assert not [path for path in tmp_path.iterdir() if path.name.startswith("rig-sim-")]


def test_sim_says_when_its_devices_died(tmp_path: Path) -> None:
    process = rig("sim", rig_file(tmp_path, free_ports()), "--json")
    ready(process)
    (child,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    os.kill(int(child), signal.SIGKILL)
    _, err = process.communicate(timeout=60)
    assert process.returncode == FAILED
    assert "emulated devices ended" in err


@pytest.mark.parametrize("command", ["sim", "devices"])
def test_a_rig_without_wires_is_bad_input(command: str) -> None:
    done = rig_here(command, CONFIGS / "rigs" / "wavebot.yaml", "--json")
    assert (done.returncode, done.stderr) == (BAD_INPUT, "")
    assert "has no wiring" in json.loads(done.stdout)["message"]
