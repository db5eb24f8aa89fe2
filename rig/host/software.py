"""The interpreter and the libraries."""

import importlib
import os
import platform
import re
import sys
import sysconfig
import tempfile
import time
import timeit
from importlib import metadata
from pathlib import Path

from rig.host.finding import BOTH, REALTIME, Finding, Verdict, forbidding, graded
from rig.sweep.cache_folder import cache_root

AREA = "software"
DISTRIBUTION = "wec-rig"
PINS = Path(__file__).resolve().parents[2] / "constraints.txt"
_CALLS = 20_000
_CALL_GOOD, _CALL_BAD = 250e-9, 1000e-9  # s; 141 ns go with a tick of 20 to 40 us
_REQUIRED = re.compile(r"([A-Za-z0-9._-]+)\s*>=\s*([0-9.]+)")
_PINNED = re.compile(r"([A-Za-z0-9._-]+)==(\S+)")
_SHOWN = 4


def findings() -> list[Finding]:
    """Build and speed of the interpreter, versions of the libraries, room for compiled code."""
    return [_build(), _speed(), required(_asked()), pinned(PINS), _cache()]


def _build() -> Finding:
    what = "Python"
    limit = "built with profile-guided optimisation: others are up to twice as slow"
    arguments = str(sysconfig.get_config_var("CONFIG_ARGS") or "")
    flags = str(sysconfig.get_config_var("PY_CORE_CFLAGS") or "")
    version = f"{platform.python_implementation()} {platform.python_version()}"
    if sysconfig.get_config_var("Py_DEBUG") or hasattr(sys, "gettotalrefcount"):
        advice = "use an ordinary build"
        return Finding(AREA, what, f"{version}, debug build", limit, Verdict.BAD, advice, REALTIME)
    if "--enable-optimizations" in arguments or "-fprofile-use" in flags:
        return Finding(AREA, what, f"{version}, optimised", limit, Verdict.GOOD)
    if not arguments:
        return Finding(AREA, what, f"{version}, build unknown", limit, Verdict.UNKNOWN)
    advice = "`make clean setup` picks the quickest of the interpreters on the PATH"
    return Finding(AREA, what, f"{version}, not optimised", limit, Verdict.WARNING, advice)


def _speed() -> Finding:
    timer = timeit.Timer("f(f(1.0))", "f = lambda x: (x, x)[0]", time.process_time)
    best = min(timer.repeat(number=_CALLS)) / _CALLS
    verdict = graded(best, _CALL_GOOD, _CALL_BAD)
    return Finding(
        AREA,
        "speed of Python",
        f"{1e9 * best:.0f} ns for two calls",
        f"{1e9 * _CALL_GOOD:.0f} ns, bad above {1e9 * _CALL_BAD:.0f} ns: a tick is some hundred "
        "such calls",
        verdict,
        "" if verdict is Verdict.GOOD else "a quicker processor, or an optimised Python",
        forbidding(verdict, *REALTIME),
        {"seconds": best},
    )


def _asked() -> list[str] | None:
    try:
        return metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        return None


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _order(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version)[:4])


def required(asked: list[str] | None) -> Finding:
    """Whether every library is there and new enough; ``asked`` as in a package's metadata."""
    what, limit = "libraries", "each there, and no older than this version was made for"
    if asked is None:
        return Finding(AREA, what, f"{DISTRIBUTION} is not installed", limit, Verdict.UNKNOWN)
    wrong, count = [], 0
    for line in asked:
        text, _, marker = line.partition(";")
        found = _REQUIRED.match(text.strip())
        if "extra" in marker or found is None:
            continue
        count += 1
        name, least = found[1], found[2]
        have = _version(name)
        if have is None:
            wrong.append(f"{name} is missing")
        elif _order(have) < _order(least):
            wrong.append(f"{name} {have} is older than {least}")
    if not wrong:
        return Finding(AREA, what, f"all {count} there", limit, Verdict.GOOD)
    return Finding(AREA, what, "; ".join(wrong), limit, Verdict.BAD, "`make clean setup`", BOTH)


def pinned(path: Path) -> Finding:
    """Whether the libraries are of the very versions that were tested."""
    what, limit = "tested versions", f"those of {path.name}: what was tested is what runs"
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return Finding(AREA, what, f"no {path.name} here", limit, Verdict.UNKNOWN)
    other, count = [], 0
    for line in lines:
        found = _PINNED.fullmatch(line.strip())
        have = _version(found[1]) if found else None
        if found is None or have is None:
            continue
        count += 1
        if have != found[2]:
            other.append(f"{found[1]} {have} (tested: {found[2]})")
    if not other:
        return Finding(AREA, what, f"all {count} installed ones", limit, Verdict.GOOD)
    value = ", ".join(other[:_SHOWN]) + (f" and {len(other) - _SHOWN} more" * (len(other) > _SHOWN))
    return Finding(AREA, what, value, limit, Verdict.WARNING, "`make clean setup`")


def _cache() -> Finding:
    what = "compiled code"
    limit = "a folder to keep it in: else every rehearsal compiles first, up to a minute"
    try:
        importlib.import_module("rig.sweep.lifting")  # numba: half a second, and it may fail
        place = cache_root()
        standing = place
        while not standing.exists() and standing != standing.parent:
            standing = standing.parent
        with tempfile.TemporaryFile(dir=standing):
            pass
    except ImportError as error:
        return Finding(AREA, what, str(error), limit, Verdict.BAD, "`make clean setup`", BOTH)
    except OSError as error:
        value = f"{place}: {error.strerror or error}"
        advice = "set XDG_CACHE_HOME to a folder that can be written"
        return Finding(AREA, what, value, limit, Verdict.WARNING, advice)
    kept = f"{len(os.listdir(place))} kept" if place.is_dir() else "none yet"
    return Finding(AREA, what, f"{place}, {kept}", limit, Verdict.GOOD)
