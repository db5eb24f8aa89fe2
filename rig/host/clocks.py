"""Checks of the clocks: the loop's clock, and the UTC that dates the record."""

import ctypes
import time
from typing import NamedTuple

from rig.host.finding import REALTIME, Check, Finding, Host, Verdict, grade

AREA = "clocks"
_SOURCES = "/sys/devices/system/clocksource/clocksource0"
_FAST_SOURCES = {"tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page", "timebase"}
_READ_TIME_GOOD, _READ_TIME_BAD = 1e-6, 10e-6  # s
_MAX_SLEW = 100.0  # ppm; a chronyd that has settled needs a few
_MAX_STEP = 1e-3  # s
_MAX_UTC_ERROR = 0.05  # s
_TIME_SERVICES = {"chronyd", "ntpd", "systemd-timesyn", "openntpd", "ptp4l", "phc2sys"}
_UNSYNCHRONISED = 0x40  # STA_UNSYNC, adjtimex(2)
_TIME_ERROR = 5  # TIME_ERROR, adjtimex(2)


class ClockReading(NamedTuple):
    """Readings of three clocks at one time, s."""

    monotonic: float
    raw: float  # monotonic, not slewed by NTP
    utc: float

    @staticmethod
    def now() -> "ClockReading":
        """Read all three clocks; return the readings closest together of several attempts."""
        best: tuple[float, ClockReading] | None = None
        for _ in range(20):
            before = time.monotonic()
            reading = ClockReading(
                before, time.clock_gettime(time.CLOCK_MONOTONIC_RAW), time.time()
            )
            duration = time.monotonic() - before
            if best is None or duration < best[0]:
                best = duration, reading
        assert best is not None
        return best[1]


class KernelClock(NamedTuple):
    """The kernel's state of UTC, from adjtimex(2), which needs no privileges."""

    synchronised: bool
    error: float  # s, the kernel's estimate of the largest error


class _Timex(ctypes.Structure):
    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_char * 256),
    )


def read_kernel_clock() -> KernelClock | None:
    """Return the kernel's state of UTC; None where adjtimex does not exist."""
    timex = _Timex()
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex))
    except (OSError, AttributeError):
        return None
    if state < 0:
        return None
    bad = state == _TIME_ERROR or bool(timex.status & _UNSYNCHRONISED)
    return KernelClock(not bad, timex.maxerror * 1e-6)


def findings(host: Host, before: ClockReading, after: ClockReading) -> list[Finding]:
    """Return the findings; ``before`` and ``after`` enclose the measurement of wake-ups."""
    return [
        _source(host),
        _read_time(),
        _step_and_slew(before, after),
        _synchronised(host, read_kernel_clock()),
    ]


def _source(host: Host) -> Finding:
    check = Check(AREA, "clock source", "the processor's own counter: others are slow to read")
    name = host.read_text(f"{_SOURCES}/current_clocksource")
    if not name:
        return check.unknown("the kernel gives no value")
    if name in _FAST_SOURCES:
        return check.finding(name)
    available = host.read_text(f"{_SOURCES}/available_clocksource") or ""
    advice = (
        f"`echo tsc > {_SOURCES}/current_clocksource` as root"
        if "tsc" in available.split()
        else "the kernel found the processor's counter unstable: see `dmesg | grep -i tsc`"
    )
    return check.finding(name[:40], Verdict.WARNING, advice)


def _read_time() -> Finding:
    count = 2000
    began = time.monotonic_ns()
    for _ in range(count):
        time.monotonic_ns()
    cost = (time.monotonic_ns() - began) / count / 1e9
    limit = f"at most {1e6 * _READ_TIME_GOOD:g} us: it is read three times a tick"
    verdict = grade(cost, _READ_TIME_GOOD, _READ_TIME_BAD)
    return Check(AREA, "reading the clock", limit, REALTIME).finding(
        f"{1e9 * cost:.0f} ns", verdict, "see clock source", ns=1e9 * cost
    )


def _step_and_slew(before: ClockReading, after: ClockReading) -> Finding:
    span = after.raw - before.raw
    limit = (
        f"no step beyond {1e3 * _MAX_STEP:g} ms, slewed by at most {_MAX_SLEW:g} ppm: a run ties "
        "its time to UTC once, at its start"
    )
    check = Check(AREA, "UTC against the loop's clock", limit)
    if span < 0.1:
        return check.unknown("measured for less than 0.1 s")
    step = (after.utc - before.utc) - (after.monotonic - before.monotonic)
    slew = 1e6 * ((after.monotonic - before.monotonic) / span - 1.0)
    good = abs(step) <= _MAX_STEP and abs(slew) <= _MAX_SLEW
    return check.finding(
        f"stepped {1e3 * step:+z.3f} ms, slewed {slew:+z.1f} ppm in {span:.1f} s",
        Verdict.GOOD if good else Verdict.WARNING,
        "wait until time synchronisation has settled (`chronyc tracking`)",
        step_s=step,
        slew_ppm=slew,
        span_s=span,
    )


def _synchronised(host: Host, clock: KernelClock | None) -> Finding:
    limit = (
        f"synchronised within {1e3 * _MAX_UTC_ERROR:g} ms: analysis aligns the basin's records "
        "with the rig's"
    )
    check = Check(AREA, "UTC", limit)
    running = sorted(
        {
            name
            for pid in host.list_names("/proc")
            if pid.isdigit() and (name := host.read_text(f"/proc/{pid}/comm")) in _TIME_SERVICES
        }
    )
    by = f" ({', '.join(map(str, running))} runs)" if running else " (no time service runs)"
    if clock is None:
        return check.unknown("cannot be read" + by)
    numbers = {"synchronised": clock.synchronised, "error_s": clock.error, "services": running}
    if clock.synchronised and clock.error <= _MAX_UTC_ERROR:
        return check.finding(f"synchronised within {1e3 * clock.error:.1f} ms{by}", **numbers)
    value = "not synchronised"
    if clock.synchronised:
        value = f"synchronised only within {1e3 * clock.error:.0f} ms"
    advice = "install and start chrony with the basin's time server, and wait until it has settled"
    return check.finding(value + by, Verdict.WARNING, advice, **numbers)
