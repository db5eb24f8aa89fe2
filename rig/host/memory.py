"""Checks of memory, shared memory and open files."""

import mmap
import os
import resource

from rig.host.finding import ALL_USES, Check, Finding, Host, Verdict, grade
from rig.kinds.registry import row_types
from rig.recording import ring, row_layout

AREA = "memory"
_FREE_GOOD, _FREE_BAD = 2e9, 0.5e9  # bytes
_FILES_GOOD, _FILES_BAD = 256, 64
_NO_LIMIT = 1 << 60
_CGROUPS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


def findings(host: Host) -> list[Finding]:
    """Return the findings on memory and open files."""
    return [_free(host), _swap(host), _shared(), _files()]


def meminfo(host: Host) -> dict[str, int]:
    """Return the values of /proc/meminfo by name, in bytes."""
    values = {}
    for line in (host.read_text("/proc/meminfo") or "").splitlines():
        name, _, rest = line.partition(":")
        number = rest.split()[:1]
        if number and number[0].isdigit():
            values[name] = int(number[0]) * 1024
    return values


def _free(host: Host) -> Finding:
    limit = (
        f"{1e-9 * _FREE_GOOD:g} GB, bad below {1e-9 * _FREE_BAD:g} GB: a run takes 0.2 GB, reading "
        "an hour of it with all fields 1.8 GB"
    )
    check = Check(AREA, "free memory", limit, ALL_USES)
    free = meminfo(host).get("MemAvailable")
    if free is None:
        return check.unknown()
    allowed = min((n for n in map(host.read_int, _CGROUPS) if n is not None), default=_NO_LIMIT)
    value = f"{1e-9 * min(free, allowed):.1f} GB"
    if allowed < free:
        value += ", limited by the container or service"
    verdict = grade(-min(free, allowed), -_FREE_GOOD, -_FREE_BAD)
    return check.finding(value, verdict, "close other programs; see `top`", bytes=free)


def _swap(host: Host) -> Finding:
    check = Check(AREA, "swap in use", "none: the run waits while swapped memory returns")
    info = meminfo(host)
    if "SwapTotal" not in info or "SwapFree" not in info:
        return check.unknown()
    used = info["SwapTotal"] - info["SwapFree"]
    if used <= 0:
        return check.finding("none")
    advice = "`swapoff -a && swapon -a` as root when enough memory is free"
    return check.finding(f"{1e-9 * used:.2f} GB", Verdict.WARNING, advice)


def _shared() -> Finding:
    size = ring.CAPACITY * max(row_layout.layout(row_type).size for row_type in row_types())
    limit = f"{1e-6 * size:.0f} MB in one piece: the ring between loop and logger"
    check = Check(AREA, "shared memory", limit, ALL_USES)
    try:
        fd = os.memfd_create("wec-rig-doctor", os.MFD_CLOEXEC)
        try:
            os.ftruncate(fd, size)
            with mmap.mmap(fd, size) as memory:
                for offset in range(0, size, mmap.PAGESIZE):
                    memory[offset] = 1
        finally:
            os.close(fd)
    except (OSError, AttributeError, ValueError) as error:
        advice = "the kernel must know memfd_create (Linux 3.17) and have the memory free"
        return check.finding(str(error), Verdict.BAD, advice)
    return check.finding("memfd, available")


def _files() -> Finding:
    limit = f"{_FILES_GOOD}: pipes, ring, locks, devices and libraries of three processes"
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    count = _NO_LIMIT if soft == resource.RLIM_INFINITY else soft
    return Check(AREA, "open files", limit, ALL_USES).finding(
        "without limit" if count == _NO_LIMIT else f"up to {count}",
        grade(-count, -_FILES_GOOD, -_FILES_BAD),
        "`ulimit -n 1024`",
        limit=count,
    )
