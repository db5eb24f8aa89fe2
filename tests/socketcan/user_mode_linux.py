"""Run the tests of this folder on a kernel with SocketCAN: user-mode Linux on this host's files.

    python tests/socketcan/user_mode_linux.py [--seconds S] [COMMAND ...]

Without a command: pytest on this folder, with the Python that runs this. User-mode Linux needs no
privileges, no virtualisation and no CAN in the host's kernel; it is taken from the PATH or from
Debian's package, which is unpacked in .venv and not installed. The kernel has one processor and 100
ticks per second, so times measured in a test have no meaning.

The exit status is that of the command, or 77 with the reason if no such kernel is available.
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
TIMEOUT_S = 30.0  # of each step of the download


class NoKernelError(Exception):
    """User-mode Linux is not available here, with the reason."""


class Kernel(NamedTuple):
    program: Path
    modules: Path  # folder `kernel` of its modules


def kernel_in(program: Path, modules: Path) -> Kernel | None:
    """Return the kernel if both the program and the CAN modules exist, otherwise None."""
    for folder in sorted(modules.glob("*/kernel"), reverse=True):
        if program.is_file() and all((folder / name).is_file() for name in MODULES):
            return Kernel(program, folder)
    return None


def kernel() -> Kernel:
    """Return the kernel of the PATH, of the cache, or downloaded into the cache.

    Raises NoKernelError if none is available.
    """
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        raise NoKernelError(f"no user-mode Linux for {platform.system()} on {platform.machine()}")
    installed = shutil.which("linux.uml")
    kernel_ = installed and kernel_in(Path(installed), Path("/usr/lib/uml/modules"))
    return kernel_ or cached_kernel() or download_kernel()


def cached_kernel() -> Kernel | None:
    return kernel_in(CACHE / "usr/bin/linux.uml", CACHE / "usr/lib/uml/modules")


def download_kernel() -> Kernel:
    """Download and unpack Debian's package next to the cache, then move it into the cache."""
    if not (shutil.which("apt-get") and shutil.which("dpkg-deb")):
        raise NoKernelError(
            f"linux.uml is not on the PATH, and without Debian {PACKAGE} cannot be downloaded"
        )
    CACHE.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=CACHE.parent) as folder:
        lists = Path(folder) / "lists"
        (lists / "partial").mkdir(parents=True)
        options = ("-o", f"Dir::State::lists={lists}", "-o", "APT::Sandbox::User=root")
        if run_step(folder, "apt-get", "download", PACKAGE):  # the host has no package lists yet
            run_step(folder, "apt-get", *options, "update")
            error_message = run_step(folder, "apt-get", *options, "download", PACKAGE)
            if error_message:
                raise NoKernelError(
                    f"linux.uml is not installed and cannot be downloaded: {error_message}"
                )
        for package in Path(folder).glob("*.deb"):
            if error_message := run_step(folder, "dpkg-deb", "-x", str(package), f"{folder}/files"):
                raise NoKernelError(error_message)
        shutil.rmtree(CACHE, ignore_errors=True)
        (Path(folder) / "files").rename(CACHE)
    kernel_ = cached_kernel()
    if kernel_ is None:
        raise NoKernelError(f"{PACKAGE} has not the kernel modules {', '.join(MODULES)}")
    return kernel_


def run_step(folder: str, *command: str) -> str:
    """Run a command; return its error in one line, empty without one."""
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, check=False, timeout=TIMEOUT_S
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    lines = done.stderr.strip().splitlines() or [f"{command[0]} ended with {done.returncode}"]
    return lines[-1] if done.returncode else ""


def run(kernel: Kernel, command: Sequence[str], limit: float) -> int:
    """Boot, run the command and relay its output; return its exit status, or NoKernelError."""
    with tempfile.TemporaryDirectory() as folder:
        arguments = [
            str(kernel.program), f"mem={MEMORY}", "root=/dev/root", "rootfstype=hostfs", "ro",
            "con=null", "con0=null,fd:1", "con1=null", "quiet", f"uml_dir={folder}/",
            f"init={sys.executable}", "--", "-I", str(HERE / "uml_guest.py"),
            encode_job({"modules": str(kernel.modules), "tree": str(TREE), "command": [*command]}),
        ]  # fmt: skip
        with subprocess.Popen(
            arguments,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            errors="replace",
            start_new_session=True,  # a kernel has many processes, which must end together
        ) as guest:

            def end() -> None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(guest.pid, signal.SIGKILL)

            def on_timeout() -> None:
                print(f"user-mode Linux is killed after {limit:g} s", flush=True)
                end()

            timer = threading.Timer(limit, on_timeout)
            timer.start()
            try:
                return relay_output(guest)
            finally:
                timer.cancel()
                end()


def encode_job(job: dict[str, object]) -> str:
    """Return the guest's job as one argument of a kernel's command line."""
    return base64.urlsafe_b64encode(json.dumps(job).encode()).decode()


def relay_output(guest: subprocess.Popen[str]) -> int:
    """Print the guest's output; return the exit status of its command.

    A guest that ends after it was up has failed (status 1). Raises NoKernelError for a guest that
    never was up: the kernel is not available.
    """
    assert guest.stdout is not None
    up, booting = False, list[str]()
    for line in guest.stdout:
        text = line.rstrip()
        if text.startswith(STATUS):
            if not up:
                print(*booting, sep="\n", flush=True)
            return int(text.removeprefix(STATUS))
        up = up or text.startswith(UP)
        if up:
            print(text, flush=True)
        elif text:
            booting.append(text)
    if up:
        print("user-mode Linux ended before the command did", flush=True)
        return 1
    raise NoKernelError(f"user-mode Linux does not boot: {booting[-1] if booting else 'no output'}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=80.0, help="time limit of the run")
    parser.add_argument("command", nargs=argparse.REMAINDER)
    options = parser.parse_args()
    command = options.command or [sys.executable, *TESTS]
    try:
        return run(kernel(), command, options.seconds)
    except NoKernelError as reason:
        print(
            "*" * 100,
            f"*** THE TESTS ON A KERNEL WITH SOCKETCAN DID NOT RUN: {reason}",
            f"*** Debian: apt-get install {PACKAGE}; then make test-socketcan",
            "*" * 100,
            sep="\n",
            flush=True,
        )
        return NOT_RUN


if __name__ == "__main__":
    sys.exit(main())
