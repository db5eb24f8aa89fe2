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
from rig.host.finding import ALL_USES, REALTIME, Finding, Verdict, forbidden_uses, grade

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
    check = "Python"
    limit = "built with profile-guided optimisation: others are up to twice as slow"
    arguments = str(sysconfig.get_config_var("CONFIG_ARGS") or "")
    flags = str(sysconfig.get_config_var("PY_CORE_CFLAGS") or "")
    version = f"{platform.python_implementation()} {platform.python_version()}"
    if sysconfig.get_config_var("Py_DEBUG") or hasattr(sys, "gettotalrefcount"):
        advice = "use a release build of Python"
        return Finding(AREA, check, f"{version}, debug build", limit, Verdict.BAD, advice, REALTIME)
    if "--enable-optimizations" in arguments or "-fprofile-use" in flags:
        return Finding(AREA, check, f"{version}, optimised", limit, Verdict.GOOD)
    if not arguments:
        return Finding(AREA, check, f"{version}, build unknown", limit, Verdict.UNKNOWN)
    advice = "use a Python built so; `make clean setup` selects the fastest one on the PATH"
    return Finding(AREA, check, f"{version}, not optimised", limit, Verdict.WARNING, advice)


def _speed() -> Finding:
    timer = timeit.Timer("f(f(1.0))", "f = lambda x: (x, x)[0]", time.process_time)
    best = min(timer.repeat(number=_CALLS)) / _CALLS
    verdict = grade(best, _CALL_GOOD, _CALL_BAD)
    return Finding(
        AREA,
        "speed of Python",
        f"{1e9 * best:.0f} ns for two calls",
        f"{1e9 * _CALL_GOOD:.0f} ns, bad above {1e9 * _CALL_BAD:.0f} ns: a tick makes some "
        "hundred such calls",
        verdict,
        "" if verdict is Verdict.GOOD else "use a faster processor, or an optimised Python",
        forbidden_uses(verdict, *REALTIME),
        {"seconds": best},
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
    check, limit = "libraries", "each installed, and not older than wec-rig requires"
    if requirements is None:
        return Finding(AREA, check, f"{DISTRIBUTION} is not installed", limit, Verdict.UNKNOWN)
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
        return Finding(AREA, check, f"all {count} installed", limit, Verdict.GOOD)
    return Finding(AREA, check, "; ".join(wrong), limit, Verdict.BAD, REINSTALL, ALL_USES)


def check_pinned(path: Path) -> Finding:
    """Check that the libraries have the versions that were tested, those of a constraints file."""
    check, limit = "tested versions", f"those of {path.name}: run the versions that were tested"
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return Finding(AREA, check, f"no {path.name} here", limit, Verdict.UNKNOWN)
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
        return Finding(AREA, check, f"all {count} installed ones", limit, Verdict.GOOD)
    value = ", ".join(other[:_MAX_LISTED]) + (
        f" and {len(other) - _MAX_LISTED} more" * (len(other) > _MAX_LISTED)
    )
    return Finding(AREA, check, value, limit, Verdict.WARNING, REINSTALL)


def _cache() -> Finding:
    check = "compiled code"
    limit = "a writable cache folder: without one every rehearsal first compiles, up to a minute"
    try:
        importlib.import_module("rig.compilation.lifting")  # numba: half a second, and it may fail
        folder = cache_root()
        existing = folder
        while not existing.exists() and existing != existing.parent:
            existing = existing.parent
        with tempfile.TemporaryFile(dir=existing):
            pass
    except ImportError as error:
        return Finding(AREA, check, str(error), limit, Verdict.BAD, REINSTALL, ALL_USES)
    except OSError as error:
        value = f"{folder}: {error.strerror or error}"
        advice = "set XDG_CACHE_HOME to a writable folder"
        return Finding(AREA, check, value, limit, Verdict.WARNING, advice)
    cached = f"{len(os.listdir(folder))} cached" if folder.is_dir() else "none yet"
    return Finding(AREA, check, f"{folder}, {cached}", limit, Verdict.GOOD)
