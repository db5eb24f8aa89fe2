"""Real-time privileges of a process: one place requests them, once, and reports the result.

FIFO scheduling (not inherited by children), a core for the loop alone, locked memory, garbage
collection frozen and disabled, and no deep sleep of the processor. A rehearsal on the virtual clock
never requests them: a busy FIFO process would block all other work on the machine.
"""

import ctypes
import gc
import os
import struct
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

PRIORITY = 80  # above threaded interrupts (50), below the kernel's own watchdogs (99)
_NICE = -15
_LATENCY_FILE = "/dev/cpu_dma_latency"
_ISOLATED = "/sys/devices/system/cpu/isolated"
_MCL_CURRENT_AND_FUTURE = 3

_latency_fds: list[int] = []  # open files keep the latency request for the life of the process


class Privileges(NamedTuple):
    """Result of each request: an empty text if granted, otherwise the cause of the refusal."""

    fifo: str
    core: str
    memory_lock: str
    latency: str

    @property
    def refused(self) -> tuple[str, ...]:
        """The refused privileges, each with its cause, as texts."""
        return tuple(
            f"{name.replace('_', ' ')}: {cause}"
            for name, cause in zip(self._fields, self, strict=True)
            if cause
        )


def freeze_garbage_collector() -> None:
    """Disable garbage collection and exempt everything allocated so far from it."""
    sys.setswitchinterval(1e-4)
    gc.collect()
    gc.freeze()
    gc.disable()


def acquire() -> Privileges:
    """Request all privileges; never raise: the caller decides whether a refusal matters."""
    freeze_garbage_collector()
    return Privileges(
        fifo=_try(_fifo), core=_try(_pin), memory_lock=_try(_lock), latency=_try(_request_latency)
    )


def acquire_for_emulator() -> str:
    """Request FIFO below the loop and off its core, for emulated devices.

    Return the cause of a refusal, or an empty text. A real drive answers within microseconds
    whatever load the host has; so must its emulation.
    """
    freeze_garbage_collector()

    def request() -> None:
        others = os.sched_getaffinity(0) - {loop_core()}
        if others:
            os.sched_setaffinity(0, others)
        parameters = os.sched_param(PRIORITY // 2)
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, parameters)

    return _try(request)


def acquire_for_io() -> str:
    """Request a priority above ordinary work, for processes that serve a bus or a slow line.

    Return the cause of a refusal, or an empty text. Threads started later inherit the priority. On
    a busy host the loop would otherwise trip on the age of values that arrived in time but were not
    read. It is not FIFO: the kernel suspends all FIFO work of a core for a while when there is too
    much of it, emulated devices included.
    """
    return _try(lambda: os.setpriority(os.PRIO_PROCESS, 0, _NICE))


def _try(request: Callable[[], None]) -> str:
    try:
        request()
    except OSError as error:
        return error.strerror or str(error)
    return ""


def _fifo() -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))


def _pin() -> None:
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {loop_core()})
    except OSError:  # an isolated core that a container or service may not use
        os.sched_setaffinity(0, {max(allowed)})


def loop_core() -> int:
    """Return the loop's core: the last of the cores kept free of other work, else the last core.

    A kernel started with ``isolcpus`` starts every process on the other cores.
    """
    isolated: set[int] = set()
    # UTF-8 is loaded at start-up; another codec would be imported here, and a process that has
    # given up root may not be able to read its file.
    with suppress(OSError, ValueError), open(_ISOLATED, encoding="utf-8") as file:
        isolated = parse_core_list(file.read())
    return max(isolated or os.sched_getaffinity(0))


def leave_the_loops_core() -> int:
    """Give way to the run: lower priority, and any core but the loop's, which is returned.

    Afterwards, `loop_core` of this process and its children would find another one.
    """
    core = loop_core()
    with suppress(OSError):
        os.nice(10)
        others = os.sched_getaffinity(0) - {core}
        if others:
            os.sched_setaffinity(0, others)
    return core


def parse_core_list(text: str) -> set[int]:
    """Return the cores in a kernel list such as ``1,3-5``; raise ValueError for other texts."""
    numbers: set[int] = set()
    for part in text.strip().split(","):
        first, _, last = part.partition("-")
        if part:
            numbers.update(range(int(first), int(last or first) + 1))
    return numbers


def _lock() -> None:
    if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT_AND_FUTURE) != 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


def _request_latency() -> None:
    fd = os.open(_LATENCY_FILE, os.O_WRONLY | os.O_CLOEXEC)
    os.write(fd, struct.pack("=i", 0))
    _latency_fds.append(fd)
