"""Checks of the disk that takes the log: free space and speed."""

import os
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from rig.host.finding import ALL_USES, REALTIME, Finding, Host, Verdict, forbidden_uses, grade
from rig.kinds import row_types
from rig.processes import supervisor
from rig.recording import mcap_writer, row_layout
from rig.recording.logger import FLUSH_INTERVAL

AREA = "disk"
INDEX_BYTES = 16  # of a message in a chunk's index
_BLOCK_BYTES, _MAX_BYTES = 1 << 20, 64 << 20  # bytes
_MAX_DURATION = 5.0  # s of sequential writing
_FLUSH_COUNT, _FLUSH_BYTES = 20, 256 << 10
_IN_MEMORY = {"tmpfs", "ramfs"}
_REMOTE = {"nfs", "nfs4", "cifs", "smb3", "9p", "virtiofs", "fuse", "fuse.sshfs", "overlay"}


class WriteSpeed(NamedTuple):
    """Measured speed of writing in a folder, data synchronised to the disk included."""

    rate: float  # bytes/s, sequential
    typical: float  # s, median of a flush of `_FLUSH_BYTES`
    worst: float  # s


def row_bytes() -> int:
    """Return the size in the log of an incompressible row of the rig kind with the largest row."""
    rows = (row_layout.layout(row_type).size for row_type in row_types())
    return mcap_writer.MESSAGE_BYTES + INDEX_BYTES + max(rows)


def findings(host: Host, runs: Path, hours: float, rate_hz: float) -> list[Finding]:
    """Return the findings for ``hours`` of logging at ``rate_hz`` into the folder of runs.

    The folder need not exist yet.
    """
    place = _existing_folder(runs)
    return [
        _free_space(place, hours, rate_hz),
        _file_system(host, place),
        *_speed(place, rate_hz),
    ]


def space_shortage(runs: Path, seconds: float, rate_hz: float) -> str:
    """Return a warning if a log of this length may not fit into the folder of runs, else ''."""
    try:
        place = _existing_folder(runs)
        stats = os.statvfs(place)
    except OSError:
        return ""  # creating the run's folder reports the error
    free, need = stats.f_bavail * stats.f_frsize, seconds * rate_hz * row_bytes()
    if free >= need:
        return ""
    return f"{1e-6 * free:.1f} MB free in {place}; this run may write up to {1e-6 * need:.1f} MB"


def _existing_folder(runs: Path) -> Path:
    """Return the folder, or its nearest parent that exists."""
    place = runs.absolute()
    while not place.is_dir() and place != place.parent:
        place = place.parent
    return place


def _free_space(place: Path, hours: float, rate_hz: float) -> Finding:
    need = hours * 3600.0 * rate_hz * row_bytes()
    check = "free space"
    limit = (
        f"{2e-9 * need:.1f} GB: {hours:g} h at {rate_hz:g} Hz write up to {1e-9 * need:.1f} GB, "
        "and a recovery writes as much again"
    )
    try:
        stats = os.statvfs(place)
    except OSError as error:
        return Finding(AREA, check, error.strerror or str(error), limit, Verdict.UNKNOWN)
    free = stats.f_bavail * stats.f_frsize
    verdict = grade(-free, -2.0 * need, -need)
    return Finding(
        AREA,
        check,
        f"{1e-9 * free:.1f} GB in {place}",
        limit,
        verdict,
        ""
        if verdict is Verdict.GOOD
        else "move old runs away, or give `--runs` a folder on another disk",
        forbidden_uses(verdict, *ALL_USES),
        {"free_bytes": free, "needed_bytes": need},
    )


def _file_system(host: Host, place: Path) -> Finding:
    check = "file system"
    limit = "a local disk: memory loses the runs at power-off, networks stall"
    kind, best = "", -1
    for line in (host.read_text("/proc/mounts") or "").splitlines():
        columns = line.split()
        if len(columns) < 3:
            continue
        mount_point = columns[1].replace("\\040", " ")
        if place.is_relative_to(mount_point) and len(mount_point) >= best:
            kind, best = columns[2], len(mount_point)
    if not kind:
        return Finding(AREA, check, "cannot be read", limit, Verdict.UNKNOWN)
    if kind in _IN_MEMORY:
        advice = "give `--runs` a folder on a disk: here a power cut deletes every run"
        return Finding(
            AREA, check, f"{kind}: in memory", limit, Verdict.BAD, advice, REALTIME, {"kind": kind}
        )
    if kind in _REMOTE:
        advice = "give `--runs` a folder on a local disk; copy the runs away afterwards"
        return Finding(AREA, check, kind, limit, Verdict.WARNING, advice, (), {"kind": kind})
    return Finding(AREA, check, kind[:40], limit, Verdict.GOOD, "", (), {"kind": kind})


def _speed(place: Path, rate_hz: float) -> list[Finding]:
    log_rate = rate_hz * row_bytes()
    rate_limit = f"at least {1e-6 * 10 * log_rate:.1f} MB/s: ten times the largest rate of the log"
    timeout = supervisor.DISK_TIMEOUT_S
    flush_limit = (
        f"at most {FLUSH_INTERVAL:g} s, the time between two flushes; a disk that fails for "
        f"{timeout:g} s "
        "ends the run"
    )
    names = ("sequential writing", "flush to the disk")
    try:
        speed = measure_write_speed(place)
    except OSError as error:
        reason = error.strerror or str(error)
        advice = f"make {place} writable, or give `--runs` another folder"
        return [Finding(AREA, names[0], reason, rate_limit, Verdict.BAD, advice, ALL_USES)]
    rate_verdict = grade(-speed.rate, -10.0 * log_rate, -1.5 * log_rate)
    flush_verdict = grade(speed.worst, FLUSH_INTERVAL, timeout)
    advice = "find other programs that write (`iotop`); use a solid-state disk"
    return [
        Finding(
            AREA,
            names[0],
            f"{1e-6 * speed.rate:.0f} MB/s",
            rate_limit,
            rate_verdict,
            "" if rate_verdict is Verdict.GOOD else advice,
            forbidden_uses(rate_verdict, *ALL_USES),
            {"bytes_per_s": speed.rate, "log_bytes_per_s": log_rate},
        ),
        Finding(
            AREA,
            names[1],
            f"median {1e3 * speed.typical:.1f} ms, worst {1e3 * speed.worst:.1f} ms",
            flush_limit,
            flush_verdict,
            "" if flush_verdict is Verdict.GOOD else advice,
            forbidden_uses(flush_verdict, *ALL_USES),
            {"median_s": speed.typical, "worst_s": speed.worst},
        ),
    ]


def measure_write_speed(place: Path) -> WriteSpeed:
    """Write up to 64 MB and 20 flushes into an unnamed file of the folder, and return the speed.

    Raises OSError if the folder cannot be written.
    """
    stats = os.statvfs(place)
    max_bytes = min(_MAX_BYTES, stats.f_bavail * stats.f_frsize // 10)
    block = os.urandom(_BLOCK_BYTES)
    with tempfile.TemporaryFile(dir=place) as file:
        fd, done, began = file.fileno(), 0, time.monotonic()
        while done < max(_BLOCK_BYTES, max_bytes) and time.monotonic() - began < _MAX_DURATION:
            done += os.write(fd, block)
        os.fsync(fd)
        rate = done / max(time.monotonic() - began, 1e-9)
        flush_times = []
        for _ in range(_FLUSH_COUNT):
            flush_began = time.monotonic()
            os.write(fd, block[:_FLUSH_BYTES])
            os.fdatasync(fd)
            flush_times.append(time.monotonic() - flush_began)
            if time.monotonic() - began > 2 * _MAX_DURATION:
                break
    return WriteSpeed(rate, sorted(flush_times)[len(flush_times) // 2], max(flush_times))
