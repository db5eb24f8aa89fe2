"""Memory, shared memory and open files."""

import mmap
import os
import resource

from rig.host.finding import BOTH, Finding, Host, Verdict, forbidding, graded
from rig.kinds import KINDS
from rig.recording import ring, row_layout

AREA = "memory"
_GOOD, _BAD = 2e9, 0.5e9  # bytes
_FILES_GOOD, _FILES_BAD = 256, 64
_NO_LIMIT = 1 << 60
_CGROUPS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


def findings(host: Host) -> list[Finding]:
    """What a run needs besides a processor and a disk."""
    return [_free(host), _swap(host), _shared(), _files()]


def meminfo(host: Host) -> dict[str, int]:
    """/proc/meminfo in bytes, by name."""
    found = {}
    for line in (host.text("/proc/meminfo") or "").splitlines():
        name, _, rest = line.partition(":")
        number = rest.split()[:1]
        if number and number[0].isdigit():
            found[name] = int(number[0]) * 1024
    return found


def _free(host: Host) -> Finding:
    what = "free memory"
    limit = (
        f"{1e-9 * _GOOD:g} GB, bad below {1e-9 * _BAD:g} GB: a run takes 0.2 GB, reading an hour "
        "of it with all fields 1.8 GB"
    )
    free = meminfo(host).get("MemAvailable")
    if free is None:
        return Finding(AREA, what, "cannot be read", limit, Verdict.UNKNOWN)
    allowed = min((n for n in map(host.number, _CGROUPS) if n is not None), default=_NO_LIMIT)
    value = f"{1e-9 * min(free, allowed):.1f} GB"
    if allowed < free:
        value += ", by the limit of the container or service"
    verdict = graded(-min(free, allowed), -_GOOD, -_BAD)
    advice = "" if verdict is Verdict.GOOD else "close other programs; see `top`"
    return Finding(
        AREA, what, value, limit, verdict, advice, forbidding(verdict, *BOTH), {"bytes": free}
    )


def _swap(host: Host) -> Finding:
    what, limit = "swap in use", "none: what was swapped out comes back while the run waits"
    told = meminfo(host)
    if "SwapTotal" not in told or "SwapFree" not in told:
        return Finding(AREA, what, "cannot be read", limit, Verdict.UNKNOWN)
    used = told["SwapTotal"] - told["SwapFree"]
    if used <= 0:
        return Finding(AREA, what, "none", limit, Verdict.GOOD)
    advice = "`swapoff -a && swapon -a` as root when enough memory is free"
    return Finding(AREA, what, f"{1e-9 * used:.2f} GB", limit, Verdict.WARNING, advice)


def _shared() -> Finding:
    size = ring.CAPACITY * max(row_layout.layout(kind.row_type).size for kind in KINDS.values())
    what, limit = "shared memory", f"{1e-6 * size:.0f} MB at once: the ring between loop and logger"
    try:
        fd = os.memfd_create("wec-rig-doctor", os.MFD_CLOEXEC)
        try:
            os.ftruncate(fd, size)
            with mmap.mmap(fd, size) as memory:
                for at in range(0, size, mmap.PAGESIZE):
                    memory[at] = 1
        finally:
            os.close(fd)
    except (OSError, AttributeError, ValueError) as error:
        advice = "the kernel must know memfd_create (Linux 3.17) and have the memory free"
        return Finding(AREA, what, str(error), limit, Verdict.BAD, advice, BOTH)
    return Finding(AREA, what, "memfd, to be had", limit, Verdict.GOOD)


def _files() -> Finding:
    what = "open files"
    limit = f"{_FILES_GOOD}: pipes, ring, locks, devices and libraries of three processes"
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    count = _NO_LIMIT if soft == resource.RLIM_INFINITY else soft
    verdict = graded(-count, -_FILES_GOOD, -_FILES_BAD)
    return Finding(
        AREA,
        what,
        "without limit" if count == _NO_LIMIT else f"up to {count}",
        limit,
        verdict,
        "" if verdict is Verdict.GOOD else "`ulimit -n 1024`",
        forbidding(verdict, *BOTH),
        {"limit": count},
    )
