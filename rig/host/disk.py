"""Checks of the disk that takes the log: free space and speed."""

import os
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from rig.host.finding import ALL_USES, REALTIME, Check, Finding, Host, Verdict, grade
from rig.kinds.registry import row_types
from rig.processes import supervisor
from rig.processes.logger import FLUSH_INTERVAL
from rig.recording import mcap_writer, row_layout

AREA = "disk"
INDEX_BYTES = 16  # of a message in a chunk's index
BYTES_PER_FIELD = 2.4
"""Size in the log of a field of one tick. Measured on rehearsals, with the noise of the sensors:
1.97 (four rows of the WaveBot in a regular sea), 2.12 (23 min in an irregular sea), 2.42 (a session
of the bench)."""
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


def log_bytes(row_type: type, ticks: float) -> float:
    """Return the expected size of a log of so many ticks, compressed."""
    return BYTES_PER_FIELD * len(row_layout.leaves(row_type)) * ticks


def free_bytes(runs: Path) -> float:
    """Return the free space of the disk of a folder, which need not exist yet; raises OSError."""
    return _free_bytes(_existing_folder(runs))


def space_shortage(runs: Path, seconds: float, rate_hz: float) -> str:
    """Return a warning if a log of this length may not fit into the folder of runs, else ''."""
    try:
        place = _existing_folder(runs)
        free, need = _free_bytes(place), seconds * rate_hz * row_bytes()
    except OSError:
        return ""  # creating the run's folder reports the error
    if free >= need:
        return ""
    return f"{1e-6 * free:.1f} MB free in {place}; this run may write up to {1e-6 * need:.1f} MB"


def _existing_folder(runs: Path) -> Path:
    """Return the folder, or its nearest parent that exists."""
    place = runs.absolute()
    while not place.is_dir() and place != place.parent:
        place = place.parent
    return place


def _free_bytes(place: Path) -> int:
    stats = os.statvfs(place)
    return stats.f_bavail * stats.f_frsize


def _free_space(place: Path, hours: float, rate_hz: float) -> Finding:
    need = hours * 3600.0 * rate_hz * row_bytes()
    limit = (
        f"{2e-9 * need:.1f} GB: {hours:g} h at {rate_hz:g} Hz write up to {1e-9 * need:.1f} GB, "
        "and a recovery writes as much again"
    )
    check = Check(AREA, "free space", limit, ALL_USES)
    try:
        free = _free_bytes(place)
    except OSError as error:
        return check.unknown(error.strerror or str(error))
    return check.finding(
        f"{1e-9 * free:.1f} GB in {place}",
        grade(-free, -2.0 * need, -need),
        "move old runs away, or give `--runs` a folder on another disk",
        free_bytes=free,
        needed_bytes=need,
    )


def _file_system(host: Host, place: Path) -> Finding:
    limit = "a local disk: memory loses the runs at power-off, networks stall"
    check = Check(AREA, "file system", limit, REALTIME)
    kind, best = "", -1
    for line in (host.read_text("/proc/mounts") or "").splitlines():
        columns = line.split()
        if len(columns) < 3:
            continue
        mount_point = columns[1].replace("\\040", " ")
        if place.is_relative_to(mount_point) and len(mount_point) >= best:
            kind, best = columns[2], len(mount_point)
    if not kind:
        return check.unknown()
    if kind in _IN_MEMORY:
        advice = "give `--runs` a folder on a disk: here a power cut deletes every run"
        return check.finding(f"{kind}: in memory", Verdict.BAD, advice, kind=kind)
    if kind in _REMOTE:
        advice = "give `--runs` a folder on a local disk; copy the runs away afterwards"
        return check.finding(kind, Verdict.WARNING, advice, kind=kind)
    return check.finding(kind[:40], kind=kind)


def _speed(place: Path, rate_hz: float) -> list[Finding]:
    log_rate = rate_hz * row_bytes()
    timeout = supervisor.DISK_TIMEOUT_S
    limit = f"at least {1e-6 * 10 * log_rate:.1f} MB/s: ten times the largest rate of the log"
    writing = Check(AREA, "sequential writing", limit, ALL_USES)
    limit = f"at most {FLUSH_INTERVAL:g} s, the time between two flushes; a disk that fails for "
    flush = Check(AREA, "flush to the disk", f"{limit}{timeout:g} s ends the run", ALL_USES)
    try:
        speed = measure_write_speed(place)
    except OSError as error:
        advice = f"make {place} writable, or give `--runs` another folder"
        return [writing.finding(error.strerror or str(error), Verdict.BAD, advice)]
    advice = "find other programs that write (`iotop`); use a solid-state disk"
    return [
        writing.finding(
            f"{1e-6 * speed.rate:.0f} MB/s",
            grade(-speed.rate, -10.0 * log_rate, -1.5 * log_rate),
            advice,
            bytes_per_s=speed.rate,
            log_bytes_per_s=log_rate,
        ),
        flush.finding(
            f"median {1e3 * speed.typical:.1f} ms, worst {1e3 * speed.worst:.1f} ms",
            grade(speed.worst, FLUSH_INTERVAL, timeout),
            advice,
            median_s=speed.typical,
            worst_s=speed.worst,
        ),
    ]


def measure_write_speed(place: Path) -> WriteSpeed:
    """Write up to 64 MB and 20 flushes into an unnamed file of the folder, and return the speed.

    Raises OSError if the folder cannot be written.
    """
    max_bytes = min(_MAX_BYTES, _free_bytes(place) // 10)
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
