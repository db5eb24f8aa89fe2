"""The clocks: what the loop is timed by, and what dates its record."""

import ctypes
import time
from typing import NamedTuple

from rig.host.finding import REALTIME, Finding, Host, Verdict, forbidding, graded

AREA = "clocks"
_SOURCES = "/sys/devices/system/clocksource/clocksource0"
_QUICK = {"tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page", "timebase"}
_READ_GOOD, _READ_BAD = 1e-6, 10e-6  # s
_SLEW_GOOD = 100.0  # ppm; a chronyd that has settled needs a few
_STEP = 1e-3  # s
_ERROR = 0.05  # s
_NTP = {"chronyd", "ntpd", "systemd-timesyn", "openntpd", "ptp4l", "phc2sys"}
_UNSYNCHRONISED = 0x40  # STA_UNSYNC, adjtimex(2)
_NOT_SET = 5  # TIME_ERROR, adjtimex(2)


class Moment(NamedTuple):
    """Three clocks read at one time, s."""

    monotonic: float
    raw: float  # monotonic, not slewed by NTP
    utc: float

    @staticmethod
    def now() -> "Moment":
        """Read all three as close together as it goes: the closest of several tries."""
        best: tuple[float, Moment] | None = None
        for _ in range(20):
            before = time.monotonic()
            made = Moment(before, time.clock_gettime(time.CLOCK_MONOTONIC_RAW), time.time())
            took = time.monotonic() - before
            if best is None or took < best[0]:
                best = took, made
        assert best is not None
        return best[1]


class Kernel(NamedTuple):
    """What the kernel thinks of its UTC; adjtimex(2), which anybody may ask."""

    synchronised: bool
    error: float  # s, at most, as the kernel estimates


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


def kernel() -> Kernel | None:
    """Ask the kernel; None where there is no such call."""
    told = _Timex()
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(told))
    except (OSError, AttributeError):
        return None
    if state < 0:
        return None
    bad = state == _NOT_SET or bool(told.status & _UNSYNCHRONISED)
    return Kernel(not bad, told.maxerror * 1e-6)


def findings(host: Host, before: Moment, after: Moment) -> list[Finding]:
    """``before`` and ``after`` enclose the measurement of wake-ups."""
    return [
        _source(host),
        _cost(),
        _together(before, after),
        _synchronised(host, kernel()),
    ]


def _source(host: Host) -> Finding:
    what, limit = "clock source", "the processor's own counter: others are slow to read"
    name = host.text(f"{_SOURCES}/current_clocksource")
    if not name:
        return Finding(AREA, what, "the kernel does not say", limit, Verdict.UNKNOWN)
    if name in _QUICK:
        return Finding(AREA, what, name, limit, Verdict.GOOD)
    there = host.text(f"{_SOURCES}/available_clocksource") or ""
    advice = (
        f"`echo tsc > {_SOURCES}/current_clocksource` as root"
        if "tsc" in there.split()
        else ("the kernel found the processor's counter unstable: see `dmesg | grep -i tsc`")
    )
    return Finding(AREA, what, name[:40], limit, Verdict.WARNING, advice)


def _cost() -> Finding:
    count = 2000
    began = time.monotonic_ns()
    for _ in range(count):
        time.monotonic_ns()
    cost = (time.monotonic_ns() - began) / count / 1e9
    verdict = graded(cost, _READ_GOOD, _READ_BAD)
    return Finding(
        AREA,
        "reading the clock",
        f"{1e9 * cost:.0f} ns",
        f"at most {1e6 * _READ_GOOD:g} us: it is read three times a tick",
        verdict,
        "" if verdict is Verdict.GOOD else "see clock source",
        forbidding(verdict, *REALTIME),
        {"ns": 1e9 * cost},
    )


def _together(before: Moment, after: Moment) -> Finding:
    span = after.raw - before.raw
    what = "UTC against the loop's clock"
    limit = (
        f"no step beyond {1e3 * _STEP:g} ms, slewed by at most {_SLEW_GOOD:g} ppm: a run ties its "
        "time to UTC once, at its start"
    )
    if span < 0.1:
        return Finding(AREA, what, "not looked at for long enough", limit, Verdict.UNKNOWN)
    step = (after.utc - before.utc) - (after.monotonic - before.monotonic)
    slew = 1e6 * ((after.monotonic - before.monotonic) / span - 1.0)
    good = abs(step) <= _STEP and abs(slew) <= _SLEW_GOOD
    return Finding(
        AREA,
        what,
        f"stepped {1e3 * step:+z.3f} ms, slewed {slew:+z.1f} ppm in {span:.1f} s",
        limit,
        Verdict.GOOD if good else Verdict.WARNING,
        "" if good else "wait until time synchronisation has settled (`chronyc tracking`)",
        (),
        {"step_s": step, "slew_ppm": slew, "span_s": span},
    )


def _synchronised(host: Host, told: Kernel | None) -> Finding:
    what = "UTC"
    limit = (
        f"synchronised within {1e3 * _ERROR:g} ms: the basin's records are laid beside the rig's"
    )
    running = sorted(
        {
            name
            for pid in host.names("/proc")
            if pid.isdigit() and (name := host.text(f"/proc/{pid}/comm")) in _NTP
        }
    )
    by = f" ({', '.join(map(str, running))} runs)" if running else " (no time service runs)"
    if told is None:
        return Finding(AREA, what, "cannot be asked" + by, limit, Verdict.UNKNOWN)
    numbers = {"synchronised": told.synchronised, "error_s": told.error, "services": running}
    if told.synchronised and told.error <= _ERROR:
        value = f"synchronised within {1e3 * told.error:.1f} ms{by}"
        return Finding(AREA, what, value, limit, Verdict.GOOD, "", (), numbers)
    value = (
        f"synchronised only within {1e3 * told.error:.0f} ms"
        if told.synchronised
        else ("not synchronised")
    )
    advice = "install and start chrony with the basin's time server, and wait until it has settled"
    return Finding(AREA, what, value + by, limit, Verdict.WARNING, advice, (), numbers)
