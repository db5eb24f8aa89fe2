"""An independent decoder, tshark, reads a capture of the emulator's frames: values agree."""

from __future__ import annotations

import shutil
import struct
import subprocess
from collections import Counter
from pathlib import Path

import pytest
from frame_master import MS, FrameMaster
from master_process import scenario
from pysoem_lines import COUNTER

from sim_plant.emulators.ethercat.capture import Capture

pytestmark = pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")


def tshark(path: Path, *options: str) -> list[str]:
    command = ["tshark", "-r", str(path), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120.0)
    return done.stdout.splitlines()


def fields(path: Path, which: str, *names: str) -> list[list[str]]:
    options = [part for name in names for part in ("-e", name)]
    lines = tshark(path, "-Y", which, "-T", "fields", *options)
    return [line.split("\t") for line in lines]


@pytest.mark.realtime
def test_a_masters_run_has_no_malformed_frame(tmp_path: Path) -> None:
    path = tmp_path / "run.pcap"
    seen = scenario("captured", 0.0, str(path))
    assert seen["emergencies"] == [[0xFF07, 0x81]]
    assert tshark(path, "-Y", "_ws.malformed") == []
    protocols = Counter(each[0] for each in fields(path, "frame", "frame.protocols"))
    assert all("ecatf:ecat" in protocol for protocol in protocols)
    # every answer to the process data has the same working counter
    counters = fields(path, "ecat.cmd == 12 && eth.src[0] & 2", "ecat.cnt")
    assert len(counters) >= 20
    assert {each[0].split(",")[0] for each in counters[-20:]} == {str(COUNTER)}
    # the SDO upload of 0x1018:01, its answer, the abort of a write, the emergency
    replies = "eth.src[0] & 2 && ecat_mailbox.coe.type"
    values = fields(path, f"{replies} == 3", "ecat_mailbox.coe.sdoidx", "ecat_mailbox.coe.sdodata")
    assert [int(data, 0) for index, data in values if index and int(index, 0) == 0x1018] == [
        0x0BAD0EC0
    ]
    aborts = fields(path, f"{replies} == 2", "ecat_mailbox.coe.abortcode")
    assert [int(each[0], 0) for each in aborts if each[0]] == [0x06010002]
    assert len(fields(path, f"{replies} == 1", "frame.number")) == 1  # the emergency


def test_fields_of_hand_made_traffic(tmp_path: Path) -> None:
    """tshark reads command, addresses, data and counters as the test packed them."""
    path = tmp_path / "made.pcap"
    master = FrameMaster("torque_drive", "digital_in:4")
    capture = Capture(path)
    process = master.segment.process

    def recorded(frame: bytes) -> bytes | None:
        capture.write(frame, master.now)
        answer = process(frame)
        if answer is not None:
            capture.write(answer, master.now + 1000)
        return answer

    master.segment.process = recorded  # type: ignore[method-assign]
    master.reach_op()
    master.now += MS
    master.cycle({0: struct.pack("<Hhbx", 0x0006, 0x1234, 10)})
    master.upload(0, 0x1018, 2)
    capture.close()
    assert tshark(path, "-Y", "_ws.malformed") == []
    last = fields(path, "ecat.cmd == 12", "ecat.lad", "ecat.data", "ecat.cnt", "frame.time_epoch")
    sent, answered = last[-2:]
    assert [int(sent[0], 0), int(answered[0], 0)] == [0x10000, 0x10000]
    assert sent[1].replace(":", "")[:12] == "060034120a00"
    assert (sent[2], answered[2]) == ("0", "4")
    assert float(answered[3]) - float(sent[3]) == pytest.approx(1e-6, abs=1e-9)
    index = fields(path, "ecat_mailbox.coe.type == 2", "ecat_mailbox.coe.sdoidx",
                   "ecat_mailbox.coe.sdosub")  # fmt: skip
    assert {(int(a, 0), int(b, 0)) for a, b in index} == {(0x1018, 2)}
    value = fields(path, "ecat_mailbox.coe.type == 3", "ecat_mailbox.coe.sdodata")
    assert {int(each[0], 0) for each in value} == {0x10000500}
