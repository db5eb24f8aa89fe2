"""Checks of the interpreter and the libraries."""

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

from rig.compilation.cache_folder import cache_root
from rig.host.finding import ALL_USES, REALTIME, Check, Finding, Verdict, grade

AREA = "software"
DISTRIBUTION = "wec-rig"
_PACKAGE = Path(__file__).resolve().parents[1]
_SOURCE_PINS = _PACKAGE.with_name("constraints.txt")
PINS = _SOURCE_PINS if _SOURCE_PINS.is_file() else _PACKAGE / "constraints.txt"
REINSTALL = (
    "`make clean setup`"
    if PINS == _SOURCE_PINS
    else f"`python -m pip install --constraint {PINS} {DISTRIBUTION}`"
)
_CALLS = 20_000
_CALL_GOOD, _CALL_BAD = 250e-9, 1000e-9  # s; 141 ns come with a tick of 20 to 40 us
_REQUIRED = re.compile(r"([A-Za-z0-9._-]+)\s*>=\s*([0-9.]+)")
_PINNED = re.compile(r"([A-Za-z0-9._-]+)==(\S+)")
_MAX_LISTED = 4


def findings() -> list[Finding]:
    """Return findings on the interpreter's build and speed, the libraries, and the code cache."""
    return [_build(), _speed(), check_required(_requirements()), check_pinned(PINS), _cache()]


def _build() -> Finding:
    limit = "built with profile-guided optimisation: others are up to twice as slow"
    check = Check(AREA, "Python", limit, REALTIME)
    arguments = str(sysconfig.get_config_var("CONFIG_ARGS") or "")
    flags = str(sysconfig.get_config_var("PY_CORE_CFLAGS") or "")
    version = f"{platform.python_implementation()} {platform.python_version()}"
    if sysconfig.get_config_var("Py_DEBUG") or hasattr(sys, "gettotalrefcount"):
        advice = "use a release build of Python"
        return check.finding(f"{version}, debug build", Verdict.BAD, advice)
    if "--enable-optimizations" in arguments or "-fprofile-use" in flags:
        return check.finding(f"{version}, optimised")
    if not arguments:
        return check.unknown(f"{version}, build unknown")
    advice = "use a Python built so; `make clean setup` selects the fastest one on the PATH"
    return check.finding(f"{version}, not optimised", Verdict.WARNING, advice)


def _speed() -> Finding:
    timer = timeit.Timer("f(f(1.0))", "f = lambda x: (x, x)[0]", time.process_time)
    best = min(timer.repeat(number=_CALLS)) / _CALLS
    limit = (
        f"{1e9 * _CALL_GOOD:.0f} ns, bad above {1e9 * _CALL_BAD:.0f} ns: a tick makes some "
        "hundred such calls"
    )
    return Check(AREA, "speed of Python", limit, REALTIME).finding(
        f"{1e9 * best:.0f} ns for two calls",
        grade(best, _CALL_GOOD, _CALL_BAD),
        "use a faster processor, or an optimised Python",
        seconds=best,
    )


def _requirements() -> list[str] | None:
    try:
        return metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        return None


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _version_key(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version)[:4])


def check_required(requirements: list[str] | None) -> Finding:
    """Check that every library is installed and recent enough.

    ``requirements`` has the form of a package's metadata; None: the package is not installed.
    """
    limit = "each installed, and not older than wec-rig requires"
    check = Check(AREA, "libraries", limit, ALL_USES)
    if requirements is None:
        return check.unknown(f"{DISTRIBUTION} is not installed")
    wrong, count = [], 0
    for line in requirements:
        text, _, marker = line.partition(";")
        requirement = _REQUIRED.match(text.strip())
        if "extra" in marker or requirement is None:
            continue
        count += 1
        name, least = requirement[1], requirement[2]
        installed = _version(name)
        if installed is None:
            wrong.append(f"{name} is missing")
        elif _version_key(installed) < _version_key(least):
            wrong.append(f"{name} {installed} is older than {least}")
    if not wrong:
        return check.finding(f"all {count} installed")
    return check.finding("; ".join(wrong), Verdict.BAD, REINSTALL)


def check_pinned(path: Path) -> Finding:
    """Check that the libraries have the versions that were tested, those of a constraints file."""
    limit = f"those of {path.name}: run the versions that were tested"
    check = Check(AREA, "tested versions", limit)
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return check.unknown(f"no {path.name} here")
    other, count = [], 0
    for line in lines:
        pin = _PINNED.fullmatch(line.strip())
        installed = _version(pin[1]) if pin else None
        if pin is None or installed is None:
            continue
        count += 1
        if installed != pin[2]:
            other.append(f"{pin[1]} {installed} (tested: {pin[2]})")
    if not other:
        return check.finding(f"all {count} installed ones")
    value = ", ".join(other[:_MAX_LISTED]) + (
        f" and {len(other) - _MAX_LISTED} more" * (len(other) > _MAX_LISTED)
    )
    return check.finding(value, Verdict.WARNING, REINSTALL)


def _cache() -> Finding:
    limit = "a writable cache folder: without one every rehearsal first compiles, up to a minute"
    check = Check(AREA, "compiled code", limit, ALL_USES)
    try:
        importlib.import_module("rig.compilation.lifting")  # numba: half a second, and it may fail
        folder = cache_root()
        existing = folder
        while not existing.exists() and existing != existing.parent:
            existing = existing.parent
        with tempfile.TemporaryFile(dir=existing):
            pass
    except ImportError as error:
        return check.finding(str(error), Verdict.BAD, REINSTALL)
    except OSError as error:
        value = f"{folder}: {error.strerror or error}"
        advice = "set XDG_CACHE_HOME to a writable folder"
        return check.finding(value, Verdict.WARNING, advice)
    cached = f"{len(os.listdir(folder))} cached" if folder.is_dir() else "none yet"
    return check.finding(f"{folder}, {cached}")
