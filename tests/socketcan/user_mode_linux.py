"""Run the tests of this folder on a kernel with SocketCAN: user-mode Linux on this host's files.

    python tests/socketcan/user_mode_linux.py [--seconds S] [COMMAND ...]

Without a command: pytest on this folder, with the Python that runs this. User-mode Linux needs no
privileges, no virtualisation and no CAN in the host's kernel; it is taken from the PATH or else out
of Debian's package, unpacked under .venv and not installed. One processor, 100 ticks a second: what
a test says there of time means nothing.

The exit status is the command's, 77 if no such kernel could be had, with the reason.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from uml_guest import MODULES, STATUS, UP

HERE = Path(__file__).resolve().parent
TREE = HERE.parents[1]
CACHE = TREE / ".venv" / "user-mode-linux"
PACKAGE = "user-mode-linux"
NOT_RUN = 77
MEMORY = "768M"
TESTS = ("-m", "pytest", "-p", "no:cacheprovider", "--color=no", str(HERE))
PATIENCE = 30.0  # s for each step of fetching


class NoKernelError(Exception):
    """User-mode Linux cannot be had here; says why."""


class Kernel(NamedTuple):
    program: Path
    modules: Path  # folder `kernel` of its modules


def kernel_in(program: Path, modules: Path) -> Kernel | None:
    """The kernel, if both the program and the CAN modules are there."""
    for folder in sorted(modules.glob("*/kernel"), reverse=True):
        if program.is_file() and all((folder / name).is_file() for name in MODULES):
            return Kernel(program, folder)
    return None


def kernel() -> Kernel:
    """The kernel of the PATH, of the cache, or fetched into the cache; NoKernelError."""
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        raise NoKernelError(f"there is none for {platform.system()} on {platform.machine()}")
    installed = shutil.which("linux.uml")
    found = installed and kernel_in(Path(installed), Path("/usr/lib/uml/modules"))
    return found or cached() or fetched()


def cached() -> Kernel | None:
    return kernel_in(CACHE / "usr/bin/linux.uml", CACHE / "usr/lib/uml/modules")


def fetched() -> Kernel:
    """Debian's package, downloaded and unpacked beside the cache, then moved to its place."""
    if not (shutil.which("apt-get") and shutil.which("dpkg-deb")):
        raise NoKernelError(f"linux.uml is not on the PATH, and no Debian to take {PACKAGE} from")
    CACHE.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=CACHE.parent) as folder:
        lists = Path(folder) / "lists"
        (lists / "partial").mkdir(parents=True)
        own = ("-o", f"Dir::State::lists={lists}", "-o", "APT::Sandbox::User=root")
        if did(folder, "apt-get", "download", PACKAGE):  # the host knows no packages yet
            did(folder, "apt-get", *own, "update")
            wrong = did(folder, "apt-get", *own, "download", PACKAGE)
            if wrong:
                raise NoKernelError(f"linux.uml is not installed, nor to be fetched: {wrong}")
        for package in Path(folder).glob("*.deb"):
            if wrong := did(folder, "dpkg-deb", "-x", str(package), f"{folder}/files"):
                raise NoKernelError(wrong)
        shutil.rmtree(CACHE, ignore_errors=True)
        (Path(folder) / "files").rename(CACHE)
    found = cached()
    if found is None:
        raise NoKernelError(f"{PACKAGE} has not the kernel modules {', '.join(MODULES)}")
    return found


def did(folder: str, *command: str) -> str:
    """What went wrong with a command, in one line; empty if nothing."""
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, check=False, timeout=PATIENCE
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    said = done.stderr.strip().splitlines() or [f"{command[0]} ended with {done.returncode}"]
    return said[-1] if done.returncode else ""


def run(kernel: Kernel, command: Sequence[str], limit: float) -> int:
    """Boot, run the command there, show what it prints; its exit status, or NoKernelError."""
    with tempfile.TemporaryDirectory() as folder:
        words = [
            str(kernel.program), f"mem={MEMORY}", "root=/dev/root", "rootfstype=hostfs", "ro",
            "con=null", "con0=null,fd:1", "con1=null", "quiet", f"uml_dir={folder}/",
            f"init={sys.executable}", "--", "-I", str(HERE / "uml_guest.py"),
            guest_word({"modules": str(kernel.modules), "tree": str(TREE), "command": [*command]}),
        ]  # fmt: skip
        with subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            errors="replace",
            start_new_session=True,  # one kernel is many processes: they end together
        ) as guest:

            def end() -> None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(guest.pid, signal.SIGKILL)

            def too_late() -> None:
                print(f"user-mode Linux is ended after {limit:g} s", flush=True)
                end()

            timer = threading.Timer(limit, too_late)
            timer.start()
            try:
                return shown(guest)
            finally:
                timer.cancel()
                end()


def guest_word(told: dict[str, object]) -> str:
    """What the guest is told, as one word of a kernel's command line."""
    return base64.urlsafe_b64encode(json.dumps(told).encode()).decode()


def shown(guest: subprocess.Popen[str]) -> int:
    """Print what the guest prints, up to the status of its command; NoKernelError without one.

    A guest that was up and then ended has failed: only one that never came up was not to be had.
    """
    assert guest.stdout is not None
    up, before = False, ""
    for line in guest.stdout:
        text = line.rstrip()
        if text.startswith(STATUS):
            return int(text.removeprefix(STATUS))
        up = up or text.startswith(UP)
        if up:
            print(text, flush=True)
        before = text or before
    if up:
        print("user-mode Linux ended before the command did", flush=True)
        return 1
    raise NoKernelError(f"it does not come up: {before or 'it says nothing'}")


def main() -> int:
    words = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    words.add_argument("--seconds", type=float, default=80.0, help="after which it is ended")
    words.add_argument("command", nargs=argparse.REMAINDER)
    given = words.parse_args()
    command = given.command or [sys.executable, *TESTS]
    try:
        return run(kernel(), command, given.seconds)
    except NoKernelError as why:
        print(
            "*" * 100,
            f"*** THE TESTS ON A KERNEL WITH SOCKETCAN DID NOT RUN: {why}",
            f"*** Debian: apt-get install {PACKAGE}; then make test-socketcan",
            "*" * 100,
            sep="\n",
            flush=True,
        )
        return NOT_RUN


if __name__ == "__main__":
    sys.exit(main())
