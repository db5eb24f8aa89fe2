"""The host of the measurements, and its load by other work."""

import os
import platform
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from rig.recording import provenance


def describe_host() -> dict[str, Any]:
    """Return processor, cores, kernel, Python, memory, version of the code, and the date."""
    host, code = provenance.describe_host(), provenance.describe_code()
    return {
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "processor": host["processor"],
        "cores": len(os.sched_getaffinity(0)),
        "kernel": host["kernel"],
        "virtual_machine": "hypervisor" in _processor_flags(),
        "python": platform.python_version(),
        "memory_gib": round(host["memory_bytes"] / 2**30, 1),
        "version": code["version"],
        "git": code["git"][:12],
        "dirty": code["dirty"],
    }


def describe_briefly() -> str:
    """Return processor, cores, kernel and Python in one line."""
    processor = provenance.describe_host()["processor"]
    virtual = ", virtual machine" if "hypervisor" in _processor_flags() else ""
    return (
        f"{processor}, {len(os.sched_getaffinity(0))} cores{virtual}, "
        f"Linux {platform.release()}, Python {platform.python_version()}"
    )


class ProcessorTime(NamedTuple):
    """Processor time of the whole machine since it was started, in seconds."""

    time: float
    busy: float
    stolen: float  # by other virtual machines on the same host
    own: float  # of this process and its ended children

    @staticmethod
    def now() -> "ProcessorTime":
        """Return the present counters."""
        fields = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
        ticks = [int(field) / os.sysconf("SC_CLK_TCK") for field in fields]
        busy = sum(ticks[:3]) + sum(ticks[5:7])
        used = os.times()
        return ProcessorTime(time.monotonic(), busy, ticks[7], sum(used[:4]))


def other_load(before: ProcessorTime, after: ProcessorTime) -> dict[str, float]:
    """Return the load of other work on this machine and of other virtual machines, in cores."""
    elapsed = max(after.time - before.time, 0.001)
    own = after.own - before.own
    return {
        "other_work_cores": round(max(0.0, after.busy - before.busy - own) / elapsed, 3),
        "stolen_cores": round((after.stolen - before.stolen) / elapsed, 3),
    }


def _processor_flags() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return ""
    return next((line for line in lines if line.startswith("flags")), "")
