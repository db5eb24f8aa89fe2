"""The single checks of the doctor on made-up hosts."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from doctor_hosts import CPU, DT, GRANTED, WOKEN, host, named

from rig.host import (
    Examination,
    Finding,
    Host,
    Use,
    Verdict,
    clocks,
    disk,
    memory,
    privileges,
    processor,
    software,
    timing,
    wake,
)
from rig.recording.runs.create import BusyError


def seen(root: Path, what: str, **changed: str | None) -> Finding:
    """What is found of one thing on a host that is fine but for these files."""
    shown = host(root, **changed)
    moment = clocks.Moment.now()
    busy = processor.Busy(100.0, 0.0), processor.Busy(200.0, 0.0)
    found = [
        *privileges.findings(shown, WOKEN),
        *processor.findings(shown, 3, *busy),
        *clocks.findings(shown, moment, moment),
        *memory.findings(shown),
    ]
    return named(found, what)


@pytest.mark.parametrize(
    ("what", "name", "text", "verdict"),
    [
        ("real-time throttling", "proc__sys__kernel__sched_rt_runtime_us", None, "not measurable"),
        ("real-time throttling", "proc__sys__kernel__sched_rt_runtime_us", "-1", "warning"),
        ("real-time throttling", "proc__sys__kernel__sched_rt_runtime_us", "950000", "good"),
        ("real-time throttling", "proc__sys__kernel__sched_rt_runtime_us", "10000", "bad"),
        ("isolation of core 3", "sys__devices__system__cpu__isolated", "1,3-5", "good"),
        ("isolation of core 3", "sys__devices__system__cpu__isolated", "", "warning"),
        ("isolation of core 3", "sys__devices__system__cpu__isolated", "a-b", "not measurable"),
        ("isolation of core 3", "sys__devices__system__cpu__isolated", None, "not measurable"),
        ("load", "proc__loadavg", "99.0 1 1", "warning"),
        ("load", "proc__loadavg", "much", "not measurable"),
        ("virtual machine or container", "proc__cpuinfo", "flags : hypervisor", "warning"),
        ("virtual machine or container", "proc__cpuinfo", "flags : fpu", "good"),
        ("virtual machine or container", ".dockerenv", "", "warning"),
        ("kernel", "proc__version", "Linux version 6.1 x", "good"),  # /sys/kernel/realtime says so
        ("free memory", "proc__meminfo", "MemAvailable: 1000000 kB", "warning"),
        ("free memory", "proc__meminfo", "MemAvailable: 100000 kB", "bad"),
        ("free memory", "proc__meminfo", "MemAvailable: lots", "not measurable"),
        ("free memory", "sys__fs__cgroup__memory.max", "100000000", "bad"),
        ("free memory", "sys__fs__cgroup__memory.max", "max", "good"),
        ("swap in use", "proc__meminfo", "SwapTotal: 9 kB\nSwapFree: 1 kB", "warning"),
        ("swap in use", "proc__meminfo", "SwapTotal: 9 kB\nSwapFree: 9 kB", "good"),
    ],
)
def test_each_value_gets_its_verdict(
    what: str, name: str, text: str | None, verdict: str, tmp_path: Path
) -> None:
    found = seen(tmp_path, what, **{name: text})
    assert found.verdict == verdict
    assert bool(found.advice) >= (verdict in ("warning", "bad"))
    assert bool(found.forbids) == (verdict == "bad")


@pytest.mark.parametrize(
    ("path", "what", "text", "verdict"),
    [
        (f"{CPU}/cpu3/topology/thread_siblings_list", "hyperthreads of core 3", "1,3", "warning"),
        (f"{CPU}/cpu3/topology/thread_siblings_list", "hyperthreads of core 3", "3", "good"),
        (f"{CPU}/cpu3/cpufreq/scaling_governor", "frequency governor", "powersave", "warning"),
        ("sys/kernel/realtime", "kernel", "0", "good"),  # the version says so
        ("sys/devices/system/clocksource/clocksource0/current_clocksource", "clock source",
         "hpet", "warning"),
    ],
)  # fmt: skip
def test_each_file_gets_its_verdict(
    path: str, what: str, text: str, verdict: str, tmp_path: Path
) -> None:
    assert seen(tmp_path, what, **{path: text}).verdict == verdict


# --- timing and privileges


@pytest.mark.parametrize(
    ("changed", "verdict", "fit"),
    [
        ({}, "good", True),
        ({"p99_us": 101.0}, "warning", True),
        ({"p99_us": 301.0}, "bad", False),
        ({"max_us": 501.0}, "warning", True),
        ({"skipped": 1}, "good", False),
        ({"wakes": 1000}, "good", False),  # one in 10 000 would not be seen
        ({"wakes": 29_999, "skipped": 1}, "good", False),
    ],
)
def test_lateness_is_judged_against_the_period(
    changed: dict[str, float], verdict: str, fit: bool
) -> None:
    told = {**WOKEN, **changed}
    found = timing.findings(timing.Measured(WOKEN, told, ""), DT)
    assert named(found, "wake-up with the loop's privileges").verdict == verdict
    assert Examination(tuple(found)).fit(Use.REALTIME) is fit
    assert Examination(tuple(found)).fit(Use.REHEARSAL)
    slower = timing.findings(timing.Measured(WOKEN, told, ""), 10 * DT)
    assert named(slower, "wake-up with the loop's privileges").verdict == "good"


@pytest.mark.parametrize(
    ("cpuinfo", "stolen", "latest", "fit"),
    [
        ("flags : hypervisor", 0, 0.4, True),
        ("flags : hypervisor", 0, 0.6, False),
        ("flags : hypervisor", 1, 0.1, False),
        ("flags : hypervisor", 0, None, True),  # not measured: the timing says so itself
        ("flags : fpu", 1, 0.6, True),  # no machine's guest: a warning elsewhere
    ],
)
def test_a_virtual_machine_that_stalled_is_not_fit(
    tmp_path: Path, cpuinfo: str, stolen: int, latest: float | None, fit: bool
) -> None:
    shown = host(tmp_path, proc__cpuinfo=cpuinfo)
    before, after = processor.Busy(100.0, 0.0), processor.Busy(200.0, float(stolen))
    found = processor.findings(shown, 3, before, after, latest)
    assert Examination(tuple(found)).fit(Use.REALTIME) is fit
    assert Examination(tuple(found)).fit(Use.REHEARSAL)
    told = named(found, "virtual machine or container")
    assert ("stalled while it was measured" in told.value) is not fit


def test_a_taken_real_time_place_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[bool] = []

    def busy(wires: object, who: str) -> None:
        raise BusyError("taken by campaign x")

    def woken(dt: float, seconds: float, *, privileged: bool) -> tuple[Any, str]:
        asked.append(privileged)
        return WOKEN, ""

    monkeypatch.setattr(timing, "hold", busy)
    monkeypatch.setattr(timing, "_woken", woken)
    measured = timing.measure(DT, 0.1)
    assert asked == [False]
    (one, _) = timing.findings(measured, DT)
    assert (one.verdict, one.forbids) == (Verdict.UNKNOWN, (Use.REALTIME,))
    assert "campaign x" in one.value


def test_a_refused_privilege_forbids_real_time_and_tells_how_to_get_it() -> None:
    refused = {**GRANTED, "fifo": "Operation not permitted"}
    found = privileges.findings(Host(Path("/nowhere")), {**WOKEN, "granted": refused})
    one = named(found, "SCHED_FIFO")
    assert one.verdict is Verdict.BAD
    assert "rtprio" in one.advice
    assert named(found, "locked memory").verdict is Verdict.GOOD
    assert not Examination(tuple(found)).fit(Use.REALTIME)


def test_every_period_of_a_measurement_is_accounted_for() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rig.host.wake"],
        input=json.dumps({"dt": DT, "seconds": 0.3, "privileged": False}),
        capture_output=True,
        text=True,
        check=True,
    )
    told = json.loads(done.stdout)
    assert told["wakes"] + told["skipped"] >= 300  # a gap may reach over the end
    assert told["wakes"] <= 300
    assert 0.0 <= told["p50_us"] <= told["p99_us"] <= told["max_us"]
    assert told["granted"] is None
    assert callable(wake.measure)


# --- disk, clocks, software


def test_room_is_counted_for_rows_that_cannot_be_compressed(tmp_path: Path) -> None:
    from rig.kinds.wavebot import WaveBotRow
    from rig.recording.row_layout import layout

    assert disk.row_bytes() >= layout(WaveBotRow).size + 47  # heads and index of a message
    little = disk.findings(host(tmp_path / "root"), tmp_path / "runs", 1e-3, 1000.0)
    assert named(little, "free space").verdict is Verdict.GOOD
    need = named(little, "free space").numbers["needed_bytes"]
    assert need == pytest.approx(3.6 * 1000.0 * disk.row_bytes())
    much = disk.findings(host(tmp_path / "root"), tmp_path / "runs", 1e9, 1000.0)
    assert named(much, "free space").verdict is Verdict.BAD
    assert Use.REHEARSAL in named(much, "free space").forbids


@pytest.mark.parametrize(
    ("mounts", "verdict"),
    [
        ("/dev/a / ext4 rw 0 0\ntmpfs {place} tmpfs rw 0 0", "bad"),
        ("tmpfs / tmpfs rw 0 0\n/dev/a {place} ext4 rw 0 0", "good"),
        ("/dev/a / ext4 rw 0 0\nserver:/x {place} nfs4 rw 0 0", "warning"),
        ("overlay / overlay rw 0 0", "warning"),
        ("", "not measurable"),
    ],
)
def test_file_systems(mounts: str, verdict: str, tmp_path: Path) -> None:
    shown = host(tmp_path / "root", proc__mounts=mounts.format(place=tmp_path))
    found = disk.findings(shown, tmp_path / "not" / "yet", 0.001, 1000.0)
    assert named(found, "file system").verdict == verdict


def test_writing_leaves_nothing_behind(tmp_path: Path) -> None:
    speed = disk.write(tmp_path)
    assert speed.rate > 0.0
    assert 0.0 < speed.typical <= speed.worst
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    found = disk.findings(host(tmp_path / "root"), Path("/proc/self"), 0.001, 1000.0)
    one = named(found, "sequential writing")
    assert one.verdict is Verdict.BAD
    assert set(one.forbids) == {Use.REHEARSAL, Use.REALTIME}


def test_clocks_that_run_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    start = clocks.Moment(10.0, 20.0, 30.0)
    shown = host(tmp_path)
    for moved, verdict in (
        ((15.0, 25.0, 35.0), "good"),
        ((15.0, 25.0, 35.1), "warning"),  # UTC was set
        ((15.01, 25.0, 35.01), "warning"),  # slewed by 2000 ppm
        ((10.0, 20.0, 30.0), "not measurable"),
    ):
        found = clocks.findings(shown, start, clocks.Moment(*moved))
        assert named(found, "UTC against the loop's clock").verdict == verdict
    for told, verdict in (
        (clocks.Kernel(True, 0.01), "good"),
        (clocks.Kernel(True, 0.2), "warning"),
        (clocks.Kernel(False, 16.0), "warning"),
        (None, "not measurable"),
    ):
        monkeypatch.setattr(clocks, "kernel", lambda told=told: told)
        assert named(clocks.findings(shown, start, start), "UTC").verdict == verdict


def test_the_kernel_says_what_it_thinks_of_utc() -> None:
    told = clocks.kernel()
    assert told is None or told.error >= 0.0


def test_libraries_are_held_against_what_is_asked(tmp_path: Path) -> None:
    fine = software.required(["numpy>=1.0", "not-there>=9; extra == 'dev'"])
    assert (fine.verdict, fine.value) == (Verdict.GOOD, "all 1 there")
    wrong = software.required(["numpy>=99.1", "no-such-thing>=1.0", "mcap>=1.0"])
    assert wrong.verdict is Verdict.BAD
    assert "no-such-thing is missing" in wrong.value
    assert "is older than 99.1" in wrong.value
    assert software.required(None).verdict is Verdict.UNKNOWN
    pins = tmp_path / "constraints.txt"
    pins.write_text("numpy==0.0.1\n# remark\nnot-there==1\n")
    found = software.pinned(pins)
    assert found.verdict is Verdict.WARNING
    assert "(tested: 0.0.1)" in found.value
    assert software.pinned(tmp_path / "none").verdict is Verdict.UNKNOWN
