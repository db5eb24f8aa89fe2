"""Fake hosts for the tests of `rig doctor`, and replacements of its measurements."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rig.host import Finding, Host, disk, timing

DT = 0.001
GRANTED = {"fifo": "", "core": "", "memory_lock": "", "latency": ""}
WAKEUPS = {
    "granted": GRANTED, "core": 3, "wakes": 35000, "skipped": 0, "longest_gap": 0,
    "p50_us": 20.0, "p99_us": 60.0, "max_us": 200.0,
}  # fmt: skip
CPU = "sys/devices/system/cpu"
HEALTHY_FILES = {
    "proc/sys/kernel/sched_rt_runtime_us": "950000\n",
    "proc/sys/kernel/sched_rt_period_us": "1000000\n",
    "proc/loadavg": "0.10 0.20 0.30 1/200 4242\n",
    "proc/cpuinfo": "model name : x\nflags : fpu tsc\n",
    "proc/version": "Linux version 6.12.1-rt5 (gcc) #1 SMP PREEMPT_RT\n",
    "proc/stat": "cpu  100 0 100 1000 0 0 0 0 0 0\n",
    "proc/meminfo": "MemAvailable: 8000000 kB\nSwapTotal: 0 kB\nSwapFree: 0 kB\n",
    "proc/mounts": "/dev/sda1 / ext4 rw 0 0\n",
    f"{CPU}/isolated": "3\n",
    f"{CPU}/cpu3/topology/thread_siblings_list": "3\n",
    f"{CPU}/cpu3/cpufreq/scaling_governor": "performance\n",
    "sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc\n",
    "sys/kernel/realtime": "1\n",
}


def make_host(root: Path, **changed: str | None) -> Host:
    """Return a healthy host with changed files.

    ``__`` in a name stands for a slash; None removes the file.
    """
    files = {**HEALTHY_FILES, **{name.replace("__", "/"): text for name, text in changed.items()}}
    for name, text in files.items():
        if text is not None:
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
    return Host(root)


def skip_measurements(monkeypatch: pytest.MonkeyPatch, **measured: Any) -> None:
    """Replace the measurements of wake-ups and disk by good results, or by ``measured``."""
    results = {"unprivileged": WAKEUPS, "privileged": WAKEUPS, "trouble": "", **measured}
    monkeypatch.setattr(timing, "measure", lambda dt, seconds: timing.WakeupMeasurements(**results))
    monkeypatch.setattr(
        disk, "measure_write_speed", lambda place: disk.WriteSpeed(2e8, 0.002, 0.02)
    )


def finding_named(found: list[Finding] | tuple[Finding, ...], check: str) -> Finding:
    (finding,) = [finding for finding in found if finding.check == check]
    return finding
