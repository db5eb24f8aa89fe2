"""Reports between the processes of a run: each is restored, and a faulty one is named."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rig.processes import handover
from rig.processes.child import Child
from rig.processes.handover import HandoverError
from rig.processes.messages import (
    DiskState,
    IoJob,
    LoopPrivileges,
    Notice,
    Ready,
    RecordLost,
    RecordMoved,
    Refused,
    Slot,
    read_report,
    report,
)
from rig.realtime.loop import LoopResult
from rig.realtime.scheduling import Privileges


@pytest.mark.parametrize(
    "message",
    [
        LoopPrivileges(()),
        LoopPrivileges((Privileges("", "not permitted", "", ""),)),
        LoopResult(1200, 3, 7),
        Refused("no process data from surge in 3 s\nor stator"),
        Ready(),
        Ready({"heave": {"amc_peak_current": 60.0, "ids": [1, None]}}),
        Notice("the device works again"),
        DiskState(""),
        RecordLost("the run's folder was deleted"),
        RecordMoved("/tmp/ä.rescued", "the run's folder was deleted"),
    ],
)
def test_every_report_is_restored(message: Any, capfd: pytest.CaptureFixture[str]) -> None:
    report(message)
    (line,) = capfd.readouterr().out.splitlines()
    restored = read_report(line)
    assert restored == message
    assert type(restored) is type(message)


@pytest.mark.parametrize("line", ["", "can: bus is up\n", "[1, 2]", '{"event": "end"}', "null"])
def test_the_text_of_a_library_is_no_report(line: str) -> None:
    assert read_report(line) is None


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('["LoopEnd", [1, 2, 3]]', "LoopEnd: no such report"),
        ('["LoopResult", [1, 2]]', "LoopResult: list does not fit"),
        ('["LoopResult", [1, 2, "x", -1, ""]]', "LoopResult.reason: str does not fit"),
        ('["LoopResult", {"ticks": 1}]', "LoopResult: dict does not fit"),
        ('["Ready", [["heave"]]]', "Ready.facts: list does not fit"),
        ('["LoopPrivileges", [[["", "", ""]]]]', r"LoopPrivileges.privileges\[0\]: list does not"),
    ],
)
def test_a_faulty_report_is_named(line: str, message: str) -> None:
    with pytest.raises(HandoverError, match=rf"^{message}"):
        read_report(line)


def test_a_job_with_a_faulty_descriptor_is_named() -> None:
    job = IoJob({"bus": ["virtual", None]}, {"cells": Slot(5, (("slew", "N"), ("stamp", "s")))}, 6)
    assert handover.loads(IoJob, handover.dumps(job)) == job
    text = json.dumps([{}, {"cells": "5"}, 6])
    with pytest.raises(HandoverError, match=r"^IoJob.mailboxes\['cells'\]: str"):
        handover.loads(IoJob, text)


def test_a_child_with_a_faulty_report_says_so_in_its_last_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = """
print("a library")
print('["Ready", [{}]]')
print('["LoopResult", [1, 2]]')
print('["Notice", ["cut o', end="")
"""
    (tmp_path / "faulty.py").write_text(code)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    child = Child("faulty", "", (), tmp_path / "faulty.stderr")
    child.end(30.0)
    assert child.read_reports() == [Ready({})]
    assert child.last_message().startswith("its report cannot be read: LoopResult: list does not")
