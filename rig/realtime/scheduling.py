"""Asking the host for real-time privileges, in one place, once, with a report of what was granted.

FIFO scheduling (not inherited by children), a core of its own, memory locked, garbage collection
frozen and off, and the processor kept out of deep sleep. A rehearsal on the virtual clock never
asks: a busy FIFO process would take the machine away from everything else.
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

_held: list[int] = []  # keeps the latency request open for the life of the process


class Privileges(NamedTuple):
    """What was asked and granted; an empty text means granted, otherwise it says why not."""

    fifo: str
    core: str
    memory_lock: str
    latency: str

    @property
    def refused(self) -> tuple[str, ...]:
        """The refusals in words."""
        return tuple(
            f"{name.replace('_', ' ')}: {why}"
            for name, why in zip(self._fields, self, strict=True)
            if why
        )


def quiet_memory() -> None:
    """No garbage collection from here on; nothing allocated so far is ever looked at again."""
    sys.setswitchinterval(1e-4)
    gc.collect()
    gc.freeze()
    gc.disable()


def acquire() -> Privileges:
    """Ask for all privileges; never raises, the caller decides whether a refusal matters."""
    quiet_memory()
    return Privileges(
        fifo=_try(_fifo), core=_try(_pin), memory_lock=_try(_lock), latency=_try(_hold_latency)
    )


def beside_the_loop() -> str:
    """For what plays real devices: FIFO below the loop and off its core; why not, or empty.

    A drive answers within its microseconds whatever the host has to do.
    """
    quiet_memory()

    def ask() -> None:
        others = os.sched_getaffinity(0) - {core()}
        if others:
            os.sched_setaffinity(0, others)
        parameters = os.sched_param(PRIORITY // 2)
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, parameters)

    return _try(ask)


def at_its_service() -> str:
    """For what watches a bus or asks a slow line: ahead of ordinary work; why not, or empty.

    Threads started later have it too. On a host with other work the loop would otherwise stop for
    the age of values that only nobody had fetched. It is not FIFO: the kernel stops all of a core's
    FIFO work for a while when there is too much of it, emulated devices among it.
    """
    return _try(lambda: os.setpriority(os.PRIO_PROCESS, 0, _NICE))


def _try(ask: Callable[[], None]) -> str:
    try:
        ask()
    except OSError as error:
        return error.strerror or str(error)
    return ""


def _fifo() -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))


def _pin() -> None:
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {core()})
    except OSError:  # an isolated core that a container or service may not use
        os.sched_setaffinity(0, {max(allowed)})


def core() -> int:
    """The core that is the loop's: the last that is kept free of other work, else the last one.

    A kernel started with ``isolcpus`` starts every process on the other cores.
    """
    isolated: set[int] = set()
    # UTF-8 is there from the start; another codec would be imported, and whoever has given up root
    # may not be able to read where it lies.
    with suppress(OSError, ValueError), open(_ISOLATED, encoding="utf-8") as file:
        isolated = cores(file.read())
    return max(isolated or os.sched_getaffinity(0))


def cores(text: str) -> set[int]:
    """The cores of a kernel's list, such as ``1,3-5``; ValueError if it is none."""
    found: set[int] = set()
    for part in text.strip().split(","):
        first, _, last = part.partition("-")
        if part:
            found.update(range(int(first), int(last or first) + 1))
    return found


def _lock() -> None:
    if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT_AND_FUTURE) != 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


def _hold_latency() -> None:
    fd = os.open(_LATENCY_FILE, os.O_WRONLY | os.O_CLOEXEC)
    os.write(fd, struct.pack("=i", 0))
    _held.append(fd)
