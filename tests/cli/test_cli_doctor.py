"""`rig doctor` on fake hosts, on broken ones, and on this host."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from command_here import rig
from command_here import rig as rig_here
from doctor_hosts import HEALTHY_FILES, finding_named, make_host, skip_measurements
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rich.console import Console

from rig.cli import doctor
from rig.cli.doctor import render
from rig.cli.output import FAILED, OK
from rig.host import (
    DoctorOptions,
    Examination,
    Finding,
    Host,
    Use,
    Verdict,
    examination,
    examine,
    software,
)


def test_a_host_that_shows_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    skip_measurements(
        monkeypatch, unprivileged=None, privileged=None, trouble="nothing to measure with"
    )
    found = examine(DoctorOptions(tmp_path, 1.0, 1000.0, 1.0), Host(tmp_path / "nothing"))
    assert "the check" not in [finding.check for finding in found.findings]
    unknown = [f.check for f in found.findings if f.verdict is Verdict.UNKNOWN]
    assert len(unknown) > 10
    assert not found.fit(Use.REALTIME)  # a host without measurements is not fit
    assert "nothing to measure with" in found.verdict


@settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.binary(max_size=60), st.sampled_from(["file", "folder"]))
def test_a_host_with_invalid_files(
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    content: bytes,
    kind: str,
) -> None:
    root = tmp_path_factory.mktemp("root")
    for name in HEALTHY_FILES:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if kind == "file":
            path.write_bytes(content)
        else:
            path.mkdir()
    skip_measurements(monkeypatch)
    monkeypatch.setattr(software, "findings", lambda: [])  # reads no file of the host
    found = examine(DoctorOptions(root, 1.0, 1000.0, 1.0), Host(root))
    assert "the check" not in [finding.check for finding in found.findings]
    json.dumps(found.as_dict())
    Console(file=sys.stderr, width=80).print(render(found, 80))


def test_a_check_that_fails_is_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(host: Host) -> list[Finding]:
        raise ZeroDivisionError("in the check")

    skip_measurements(monkeypatch)
    monkeypatch.setattr(examination.memory, "findings", broken)
    found = examine(DoctorOptions(tmp_path, 1.0, 1000.0, 1.0), make_host(tmp_path / "root"))
    failed = finding_named(found.findings, "the check")
    assert failed.value == "ZeroDivisionError: in the check"
    assert found.findings[-1].area == software.AREA  # the other checks ran, too
    assert not found.fit(Use.REALTIME)


def finding(verdict: Verdict, *uses: Use) -> Finding:
    return Finding("area", "a check", "a value", "a limit", verdict, "do this", uses)


def test_the_verdict_is_a_sentence() -> None:
    good, warned = finding(Verdict.GOOD), finding(Verdict.WARNING)
    assert Examination((good,)).verdict == "Fit for rehearsal and for real time on a rig."
    assert Examination((good, warned)).verdict.endswith("on a rig; with one warning.")
    slow = finding(Verdict.BAD, Use.REALTIME)
    assert Examination((good, slow)).verdict == (
        "Fit for rehearsal; not fit for real time on a rig because of a check: a value."
    )
    assert Examination((finding(Verdict.BAD, *Use),)).verdict.startswith("Not fit for rehearsal")


@pytest.mark.parametrize(
    ("found", "rig", "rehearsal"),
    [
        (finding(Verdict.WARNING), OK, OK),
        (finding(Verdict.BAD, Use.REALTIME), FAILED, OK),
        (finding(Verdict.BAD, *Use), FAILED, FAILED),
    ],
)
def test_exit_codes(
    found: Finding, rig: int, rehearsal: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(doctor, "examine", lambda options: Examination((found,)))
    for for_rehearsal, expected in ((False, rig), (True, rehearsal)):
        for as_json in (False, True):
            options = ["--rehearsal"] if for_rehearsal else []
            options += ["--json"] if as_json else []
            assert rig_here("doctor", "--runs", tmp_path, *options).returncode == expected


@pytest.mark.parametrize("width", [50, 80, 140])
def test_the_report_fits_any_width(
    width: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    skip_measurements(monkeypatch)
    found = examine(DoctorOptions(tmp_path, 1.0, 1000.0, 1.0), make_host(tmp_path / "root"))
    console = Console(width=width, record=True, file=sys.stderr)
    console.print(render(found, width))
    lines = console.export_text().splitlines()
    assert max(map(len, lines)) <= width
    text = " ".join(" ".join(lines).split())
    assert found.verdict in text
    for each in found.findings:
        assert each.check.split()[0] in text
        assert each.verdict is not Verdict.BAD or each.advice.split()[0] in text


def test_this_host_is_examined(tmp_path: Path) -> None:
    arguments = ["doctor", "--seconds", "0.3", "--runs", str(tmp_path)]
    command = [sys.executable, "-m", "rig", *arguments, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    report = json.loads(done.stdout)
    assert done.returncode == (0 if report["fit"]["real time on a rig"] else 1)
    assert {entry["area"] for entry in report["findings"]} == {
        "timing", "privileges", "processor", "clocks", "disk", "memory", "wires", "software",
    }  # fmt: skip
    assert "the check" not in [entry["check"] for entry in report["findings"]]
    for entry in report["findings"]:
        assert entry["verdict"] in list(Verdict)
        assert entry["value"]
        assert entry["limit"]
        without_advice = ("good", "not measurable", "for information")
        assert entry["advice"] or entry["verdict"] in without_advice
    assert list(tmp_path.iterdir()) == []
    assert rig(*arguments, "--rate", "0").returncode == 2
