"""The raw socket: link faults, a stall, the capture, the command line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from master_process import ROOT, isolated
from wire_process import FRAMES, question

from sim_plant.emulators.ethercat.__main__ import TRADE_MARK
from sim_plant.emulators.ethercat.capture import Capture


@pytest.mark.realtime
def test_frames_that_are_lost_late_and_twice_and_a_stall(tmp_path: Path) -> None:
    capture = tmp_path / "wire.pcap"
    seen = isolated("wire_process.py", str(capture), seconds=30.0)
    every = list(range(FRAMES))
    assert seen["addresses"] == {"segment": "wireslaves"}
    assert [index for index, _ in seen["healthy"]] == every
    assert 0.2 * FRAMES < len(seen["drop"]) < 0.8 * FRAMES  # 5 sigma around a half
    assert [index for index, _ in seen["duplicate"]] == sorted(every * 2)
    assert [index for index, _ in seen["delay"]] == every
    assert min(age for _, age in seen["delay"]) >= 0.0099
    assert [index for index, _ in seen["stall"]] == every
    assert seen["stall"][0][1] > 0.018  # 25 ms less the time until the first frame
    assert seen["stall"][-1][1] < seen["stall"][0][1]
    assert [index for index, _ in seen["after"]] == every
    assert seen["malformed"] == 1
    answered = sum(len(seen[name]) for name in ("healthy", "drop", "duplicate", "delay", "stall"))
    assert seen["frames"] == answered + FRAMES
    assert capture.read_bytes().count(b"\x88\xa4") == 2 * seen["frames"] + 1


def test_a_capture_begins_with_the_header_of_nanoseconds(tmp_path: Path) -> None:
    capture = Capture(tmp_path / "a.pcap")
    capture.write(question(1), 7_000_000_123)
    capture.close()
    data = (tmp_path / "a.pcap").read_bytes()
    assert data[:4].hex() == "4d3cb2a1"
    assert data[20:24].hex() == "01000000"
    assert data[24:40].hex() == "07000000" + "7b000000" + "3c000000" * 2
    assert data[40:] == question(1)


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sim_plant.emulators.ethercat", *arguments],
        capture_output=True, text=True, check=False, cwd=ROOT, timeout=60.0,
    )  # fmt: skip


def test_errors_of_the_command_line() -> None:
    done = command("no_such_card")
    assert done.returncode == 2
    assert "no_such_card" in done.stderr
    done = command("lo", "--slaves", "coupler,toaster")
    assert done.returncode == 2
    assert "no slave 'toaster'; there are coupler, torque_drive" in done.stderr


def test_the_segment_needs_the_standard_library_only() -> None:
    """Device files are read with canopen; the segment itself and its slaves need no package."""
    program = (
        "import sys\nfrom sim_plant.emulators.ethercat import slaves, wire\n"
        "print(sorted({name.partition('.')[0] for name in sys.modules}"
        " & {'canopen', 'can', 'numpy', 'numba', 'scipy', 'drivers', 'controllers', 'rig'}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout == "[]\n"


def test_help_names_the_trade_mark() -> None:
    done = command("--help")
    assert " ".join(TRADE_MARK.split()) in " ".join(done.stdout.split())
    assert "for testing only" in done.stdout


@pytest.mark.realtime
@pytest.mark.parametrize("options", [(), ("--spin",)])
def test_commands_on_the_standard_input(options: tuple[str, ...]) -> None:
    seen: dict[str, Any] = isolated("console_process.py", *options, seconds=30.0)
    assert seen["ready"] == {"ready": "lo", "slaves": ["coupler", "torque_drive"]}
    assert seen["answers"][:2] == [
        {"done": "inject torque_drive unplugged"},
        {"error": "no slave 'toaster'; there are coupler, torque_drive"},
    ]
    report = seen["answers"][2]
    assert report["slaves"]["torque_drive"] == {
        "powered": False, "state": "INIT", "error": False, "faults": ["unplugged"], "errors": [],
    }  # fmt: skip
    assert "no fault 'gremlin'" in seen["answers"][3]["error"]
    assert seen["answers"][4]["error"].startswith("inject SLAVE FAULT [VALUE]")
    faults = seen["answers"][5]
    assert set(faults) == {"segment", "coupler", "torque_drive", "link"}
    assert faults["segment"].keys() == {"order_swapped", "stall"}
    assert faults["torque_drive"].keys() >= {"unplugged", "drive_fault", "encoder_step"}
    assert seen["code"] == 0
    assert json.dumps(seen["answers"][6]) == '{"done": "inject link freeze"}'
