"""The disk that takes the log: is there room, and does it keep up."""

import os
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from rig.host.finding import BOTH, REALTIME, Finding, Host, Verdict, forbidding, graded
from rig.kinds import KINDS
from rig.processes import supervisor
from rig.recording import mcap_writer, row_layout
from rig.recording.logger import FLUSH

AREA = "disk"
INDEX_BYTES = 16  # of a message in a chunk's index
_BLOCK, _MOST = 1 << 20, 64 << 20  # bytes
_LONGEST = 5.0  # s of sequential writing
_FLUSHES, _FLUSH_BYTES = 20, 256 << 10
_IN_MEMORY = {"tmpfs", "ramfs"}
_FAR = {"nfs", "nfs4", "cifs", "smb3", "9p", "virtiofs", "fuse", "fuse.sshfs", "overlay"}


class Speed(NamedTuple):
    """What writing in the folder took."""

    rate: float  # bytes/s, sequential, until safe on the disk
    typical: float  # s, median of a flush of `_FLUSH_BYTES` until safe on the disk
    worst: float  # s


def row_bytes() -> int:
    """What a row of the largest kind takes in the log if nothing of it can be compressed."""
    rows = (row_layout.layout(kind.row_type).size for kind in KINDS.values())
    return mcap_writer.MESSAGE_BYTES + INDEX_BYTES + max(rows)


def findings(host: Host, runs: Path, hours: float, rate_hz: float) -> list[Finding]:
    """``hours`` of logging at ``rate_hz`` into the folder of runs, which need not be there yet."""
    place = _standing(runs)
    return [
        _room(place, hours, rate_hz),
        _file_system(host, place),
        *_speed(place, rate_hz),
    ]


def shortage(runs: Path, seconds: float, rate_hz: float) -> str:
    """Words where so long a log may not find room in the folder of runs; empty where it does."""
    try:
        place = _standing(runs)
        seen = os.statvfs(place)
    except OSError:
        return ""  # what is wrong with the folder is said where the run is made in it
    free, need = seen.f_bavail * seen.f_frsize, seconds * rate_hz * row_bytes()
    if free >= need:
        return ""
    return f"{1e-6 * free:.1f} MB free in {place}; this run may write up to {1e-6 * need:.1f} MB"


def _standing(runs: Path) -> Path:
    """The folder, or the nearest one above it that is there."""
    place = runs.absolute()
    while not place.is_dir() and place != place.parent:
        place = place.parent
    return place


def _room(place: Path, hours: float, rate_hz: float) -> Finding:
    need = hours * 3600.0 * rate_hz * row_bytes()
    what = "free space"
    limit = (
        f"{2e-9 * need:.1f} GB: {hours:g} h at {rate_hz:g} Hz write up to {1e-9 * need:.1f} GB, "
        "and a recovery as much again"
    )
    try:
        seen = os.statvfs(place)
    except OSError as error:
        return Finding(AREA, what, error.strerror or str(error), limit, Verdict.UNKNOWN)
    free = seen.f_bavail * seen.f_frsize
    verdict = graded(-free, -2.0 * need, -need)
    return Finding(
        AREA,
        what,
        f"{1e-9 * free:.1f} GB in {place}",
        limit,
        verdict,
        "" if verdict is Verdict.GOOD else "move old runs away, or `--runs` to another disk",
        forbidding(verdict, *BOTH),
        {"free_bytes": free, "needed_bytes": need},
    )


def _file_system(host: Host, place: Path) -> Finding:
    what = "file system"
    limit = "a disk of this machine: memory forgets, networks stall"
    kind, best = "", -1
    for line in (host.text("/proc/mounts") or "").splitlines():
        words = line.split()
        if len(words) < 3:
            continue
        mounted = words[1].replace("\\040", " ")
        if place.is_relative_to(mounted) and len(mounted) >= best:
            kind, best = words[2], len(mounted)
    if not kind:
        return Finding(AREA, what, "cannot be read", limit, Verdict.UNKNOWN)
    if kind in _IN_MEMORY:
        advice = "`--runs` to a folder on a disk: here every run is gone at the next power cut"
        return Finding(
            AREA, what, f"{kind}: in memory", limit, Verdict.BAD, advice, REALTIME, {"kind": kind}
        )
    if kind in _FAR:
        advice = "`--runs` to a disk of this machine; copy the runs away afterwards"
        return Finding(AREA, what, kind, limit, Verdict.WARNING, advice, (), {"kind": kind})
    return Finding(AREA, what, kind[:40], limit, Verdict.GOOD, "", (), {"kind": kind})


def _speed(place: Path, rate_hz: float) -> list[Finding]:
    made = rate_hz * row_bytes()
    rate_limit = f"at least {1e-6 * 10 * made:.1f} MB/s: ten times what the log makes at most"
    patience = supervisor.DISK_TIMEOUT_S
    flush_limit = (
        f"at worst {FLUSH:g} s, the time between two flushes; a disk that fails for "
        f"{patience:g} s ends the run"
    )
    names = ("sequential writing", "flush to the disk")
    try:
        speed = write(place)
    except OSError as error:
        why = error.strerror or str(error)
        advice = f"make {place} writable, or `--runs` to another folder"
        return [Finding(AREA, names[0], why, rate_limit, Verdict.BAD, advice, BOTH)]
    quick = graded(-speed.rate, -10.0 * made, -1.5 * made)
    prompt = graded(speed.worst, FLUSH, patience)
    advice = "see what else writes (`iotop`); use a solid-state disk"
    return [
        Finding(
            AREA,
            names[0],
            f"{1e-6 * speed.rate:.0f} MB/s",
            rate_limit,
            quick,
            "" if quick is Verdict.GOOD else advice,
            forbidding(quick, *BOTH),
            {"bytes_per_s": speed.rate, "made_bytes_per_s": made},
        ),
        Finding(
            AREA,
            names[1],
            f"median {1e3 * speed.typical:.1f} ms, worst {1e3 * speed.worst:.1f} ms",
            flush_limit,
            prompt,
            "" if prompt is Verdict.GOOD else advice,
            forbidding(prompt, *BOTH),
            {"median_s": speed.typical, "worst_s": speed.worst},
        ),
    ]


def write(place: Path) -> Speed:
    """Write up to 64 MB and a few flushes into a nameless file of the folder; OSError if not."""
    seen = os.statvfs(place)
    most = min(_MOST, seen.f_bavail * seen.f_frsize // 10)
    block = os.urandom(_BLOCK)
    with tempfile.TemporaryFile(dir=place) as file:
        fd, done, began = file.fileno(), 0, time.monotonic()
        while done < max(_BLOCK, most) and time.monotonic() - began < _LONGEST:
            done += os.write(fd, block)
        os.fsync(fd)
        rate = done / max(time.monotonic() - began, 1e-9)
        took = []
        for _ in range(_FLUSHES):
            at = time.monotonic()
            os.write(fd, block[:_FLUSH_BYTES])
            os.fdatasync(fd)
            took.append(time.monotonic() - at)
            if time.monotonic() - began > 2 * _LONGEST:
                break
    return Speed(rate, sorted(took)[len(took) // 2], max(took))
