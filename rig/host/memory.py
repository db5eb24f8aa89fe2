"""Checks of memory, shared memory and open files."""

import mmap
import os
import resource

from rig.host.finding import ALL_USES, Finding, Host, Verdict, forbidden_uses, grade
from rig.kinds import row_types
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
    check = "free memory"
    limit = (
        f"{1e-9 * _FREE_GOOD:g} GB, bad below {1e-9 * _FREE_BAD:g} GB: a run takes 0.2 GB, reading "
        "an hour of it with all fields 1.8 GB"
    )
    free = meminfo(host).get("MemAvailable")
    if free is None:
        return Finding(AREA, check, "cannot be read", limit, Verdict.UNKNOWN)
    allowed = min((n for n in map(host.read_int, _CGROUPS) if n is not None), default=_NO_LIMIT)
    value = f"{1e-9 * min(free, allowed):.1f} GB"
    if allowed < free:
        value += ", limited by the container or service"
    verdict = grade(-min(free, allowed), -_FREE_GOOD, -_FREE_BAD)
    advice = "" if verdict is Verdict.GOOD else "close other programs; see `top`"
    return Finding(
        AREA,
        check,
        value,
        limit,
        verdict,
        advice,
        forbidden_uses(verdict, *ALL_USES),
        {"bytes": free},
    )


def _swap(host: Host) -> Finding:
    check, limit = "swap in use", "none: the run waits while swapped memory returns"
    info = meminfo(host)
    if "SwapTotal" not in info or "SwapFree" not in info:
        return Finding(AREA, check, "cannot be read", limit, Verdict.UNKNOWN)
    used = info["SwapTotal"] - info["SwapFree"]
    if used <= 0:
        return Finding(AREA, check, "none", limit, Verdict.GOOD)
    advice = "`swapoff -a && swapon -a` as root when enough memory is free"
    return Finding(AREA, check, f"{1e-9 * used:.2f} GB", limit, Verdict.WARNING, advice)


def _shared() -> Finding:
    size = ring.CAPACITY * max(row_layout.layout(row_type).size for row_type in row_types())
    check, limit = (
        "shared memory",
        f"{1e-6 * size:.0f} MB in one piece: the ring between loop and logger",
    )
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
        return Finding(AREA, check, str(error), limit, Verdict.BAD, advice, ALL_USES)
    return Finding(AREA, check, "memfd, available", limit, Verdict.GOOD)


def _files() -> Finding:
    check = "open files"
    limit = f"{_FILES_GOOD}: pipes, ring, locks, devices and libraries of three processes"
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    count = _NO_LIMIT if soft == resource.RLIM_INFINITY else soft
    verdict = grade(-count, -_FILES_GOOD, -_FILES_BAD)
    return Finding(
        AREA,
        check,
        "without limit" if count == _NO_LIMIT else f"up to {count}",
        limit,
        verdict,
        "" if verdict is Verdict.GOOD else "`ulimit -n 1024`",
        forbidden_uses(verdict, *ALL_USES),
        {"limit": count},
    )
