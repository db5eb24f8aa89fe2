"""Single checks of `rig doctor` on fake hosts."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from doctor_hosts import CPU, DT, GRANTED, WAKEUPS, finding_named, make_host

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


def finding_of(root: Path, check: str, **changed: str | None) -> Finding:
    """Return the finding of one check on a healthy host with changed files."""
    shown = make_host(root, **changed)
    reading = clocks.ClockReading.now()
    cpu_times = processor.CpuTime(100.0, 0.0), processor.CpuTime(200.0, 0.0)
    found = [
        *privileges.findings(shown, WAKEUPS),
        *processor.findings(shown, 3, *cpu_times),
        *clocks.findings(shown, reading, reading),
        *memory.findings(shown),
    ]
    return finding_named(found, check)


@pytest.mark.parametrize(
    ("check", "name", "text", "verdict"),
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
    check: str, name: str, text: str | None, verdict: str, tmp_path: Path
) -> None:
    finding = finding_of(tmp_path, check, **{name: text})
    assert finding.verdict == verdict
    assert bool(finding.advice) >= (verdict in ("warning", "bad"))
    assert bool(finding.forbids) == (verdict == "bad")


@pytest.mark.parametrize(
    ("path", "check", "text", "verdict"),
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
    path: str, check: str, text: str, verdict: str, tmp_path: Path
) -> None:
    assert finding_of(tmp_path, check, **{path: text}).verdict == verdict


# --- timing and privileges


@pytest.mark.parametrize(
    ("changed", "verdict", "fit"),
    [
        ({}, "good", True),
        ({"p99_us": 101.0}, "warning", True),
        ({"p99_us": 301.0}, "bad", False),
        ({"max_us": 501.0}, "warning", True),
        ({"skipped": 1}, "good", False),
        ({"wakes": 1000}, "good", False),  # too few to show a rate of 1 in 10 000
        ({"wakes": 29_999, "skipped": 1}, "good", False),
    ],
)
def test_lateness_is_compared_with_the_period(
    changed: dict[str, float], verdict: str, fit: bool
) -> None:
    wakeups = {**WAKEUPS, **changed}
    found = timing.findings(timing.WakeupMeasurements(WAKEUPS, wakeups, ""), DT)
    assert finding_named(found, "wake-up with the loop's privileges").verdict == verdict
    assert Examination(tuple(found)).fit(Use.REALTIME) is fit
    assert Examination(tuple(found)).fit(Use.REHEARSAL)
    slower = timing.findings(timing.WakeupMeasurements(WAKEUPS, wakeups, ""), 10 * DT)
    assert finding_named(slower, "wake-up with the loop's privileges").verdict == "good"


@pytest.mark.parametrize(
    ("cpuinfo", "stolen", "latest", "fit"),
    [
        ("flags : hypervisor", 0, 0.4, True),
        ("flags : hypervisor", 0, 0.6, False),
        ("flags : hypervisor", 1, 0.1, False),
        ("flags : hypervisor", 0, None, True),  # not measured: the timing findings report it
        ("flags : fpu", 1, 0.6, True),  # no virtual machine: other findings warn
    ],
)
def test_a_virtual_machine_that_stalled_is_not_fit(
    tmp_path: Path, cpuinfo: str, stolen: int, latest: float | None, fit: bool
) -> None:
    shown = make_host(tmp_path, proc__cpuinfo=cpuinfo)
    before, after = processor.CpuTime(100.0, 0.0), processor.CpuTime(200.0, float(stolen))
    found = processor.findings(shown, 3, before, after, latest)
    assert Examination(tuple(found)).fit(Use.REALTIME) is fit
    assert Examination(tuple(found)).fit(Use.REHEARSAL)
    finding = finding_named(found, "virtual machine or container")
    assert ("stalled during the measurement" in finding.value) is not fit


def test_a_held_real_time_lock_prevents_the_privileged_measurement(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    measurements: list[bool] = []

    def busy(wires: object, holder: str) -> None:
        raise BusyError("taken by campaign x")

    def measure_wakeups(dt: float, seconds: float, *, privileged: bool) -> tuple[Any, str]:
        measurements.append(privileged)
        return WAKEUPS, ""

    monkeypatch.setattr(timing, "acquire", busy)
    monkeypatch.setattr(timing, "_measure_wakeups", measure_wakeups)
    measured = timing.measure(DT, 0.1)
    assert measurements == [False]
    (finding, _) = timing.findings(measured, DT)
    assert (finding.verdict, finding.forbids) == (Verdict.UNKNOWN, (Use.REALTIME,))
    assert "campaign x" in finding.value


def test_a_refused_privilege_forbids_real_time_and_has_advice() -> None:
    refused = {**GRANTED, "fifo": "Operation not permitted"}
    found = privileges.findings(Host(Path("/nowhere")), {**WAKEUPS, "granted": refused})
    finding = finding_named(found, "SCHED_FIFO")
    assert finding.verdict is Verdict.BAD
    assert "rtprio" in finding.advice
    assert finding_named(found, "locked memory").verdict is Verdict.GOOD
    assert not Examination(tuple(found)).fit(Use.REALTIME)


def test_a_measurement_counts_every_period() -> None:
    process = subprocess.run(
        [sys.executable, "-m", "rig.host.wake"],
        input=json.dumps({"dt": DT, "seconds": 0.3, "privileged": False}),
        capture_output=True,
        text=True,
        check=True,
    )
    result = json.loads(process.stdout)
    assert result["wakes"] + result["skipped"] >= 300  # a gap may extend beyond the end
    assert result["wakes"] <= 300
    assert 0.0 <= result["p50_us"] <= result["p99_us"] <= result["max_us"]
    assert result["granted"] is None
    assert callable(wake.measure)


# --- disk, clocks, software


def test_free_space_assumes_incompressible_rows(tmp_path: Path) -> None:
    from rig.kinds.wavebot.tick import WaveBotRow
    from rig.recording.row_layout import layout

    assert disk.row_bytes() >= layout(WaveBotRow).size + 47  # headers and index entry of a message
    enough = disk.findings(make_host(tmp_path / "root"), tmp_path / "runs", 1e-3, 1000.0)
    assert finding_named(enough, "free space").verdict is Verdict.GOOD
    need = finding_named(enough, "free space").numbers["needed_bytes"]
    assert need == pytest.approx(3.6 * 1000.0 * disk.row_bytes())
    too_little = disk.findings(make_host(tmp_path / "root"), tmp_path / "runs", 1e9, 1000.0)
    assert finding_named(too_little, "free space").verdict is Verdict.BAD
    assert Use.REHEARSAL in finding_named(too_little, "free space").forbids


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
    shown = make_host(tmp_path / "root", proc__mounts=mounts.format(place=tmp_path))
    found = disk.findings(shown, tmp_path / "not" / "yet", 0.001, 1000.0)
    assert finding_named(found, "file system").verdict == verdict


def test_writing_leaves_nothing_behind(tmp_path: Path) -> None:
    speed = disk.measure_write_speed(tmp_path)
    assert speed.rate > 0.0
    assert 0.0 < speed.typical <= speed.worst
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    found = disk.findings(make_host(tmp_path / "root"), Path("/proc/self"), 0.001, 1000.0)
    finding = finding_named(found, "sequential writing")
    assert finding.verdict is Verdict.BAD
    assert set(finding.forbids) == {Use.REHEARSAL, Use.REALTIME}


def test_steps_and_slew_of_the_clocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    start = clocks.ClockReading(10.0, 20.0, 30.0)
    shown = make_host(tmp_path)
    for readings, verdict in (
        ((15.0, 25.0, 35.0), "good"),
        ((15.0, 25.0, 35.1), "warning"),  # UTC was set
        ((15.01, 25.0, 35.01), "warning"),  # slewed by 2000 ppm
        ((10.0, 20.0, 30.0), "not measurable"),
    ):
        found = clocks.findings(shown, start, clocks.ClockReading(*readings))
        assert finding_named(found, "UTC against the loop's clock").verdict == verdict
    for kernel_clock, verdict in (
        (clocks.KernelClock(True, 0.01), "good"),
        (clocks.KernelClock(True, 0.2), "warning"),
        (clocks.KernelClock(False, 16.0), "warning"),
        (None, "not measurable"),
    ):
        monkeypatch.setattr(clocks, "read_kernel_clock", lambda clock=kernel_clock: clock)
        assert finding_named(clocks.findings(shown, start, start), "UTC").verdict == verdict


def test_the_kernel_gives_the_error_of_utc() -> None:
    clock = clocks.read_kernel_clock()
    assert clock is None or clock.error >= 0.0


def test_libraries_are_compared_with_requirements_and_pins(tmp_path: Path) -> None:
    fine = software.check_required(["numpy>=1.0", "not-there>=9; extra == 'dev'"])
    assert (fine.verdict, fine.value) == (Verdict.GOOD, "all 1 installed")
    wrong = software.check_required(["numpy>=99.1", "no-such-thing>=1.0", "mcap>=1.0"])
    assert wrong.verdict is Verdict.BAD
    assert "no-such-thing is missing" in wrong.value
    assert "is older than 99.1" in wrong.value
    assert software.check_required(None).verdict is Verdict.UNKNOWN
    pins = tmp_path / "constraints.txt"
    pins.write_text("numpy==0.0.1\n# remark\nnot-there==1\n")
    found = software.check_pinned(pins)
    assert found.verdict is Verdict.WARNING
    assert "(tested: 0.0.1)" in found.value
    assert software.check_pinned(tmp_path / "none").verdict is Verdict.UNKNOWN
