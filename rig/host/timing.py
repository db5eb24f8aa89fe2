"""Checks of the wake-up lateness of a process that does nothing but wait for its next period."""

import json
import subprocess
from typing import Any, NamedTuple

from rig.host.finding import ALL_USES, REALTIME, Check, Finding, Verdict, grade
from rig.module_process import module_command
from rig.processes.wire_locks import REALTIME_WIRE, acquire
from rig.recording.runs.create import BusyError

AREA = "timing"
P99_GOOD, P99_BAD = 0.10, 0.30  # of the period
MAX_GOOD = 0.50  # of the period; a wake-up later than a whole period skips a tick
# No skip in so many periods: the rate of skips is below 1 in 10 000 with 95 % confidence.
MIN_PERIODS = 30_000
UNPRIVILEGED_S = 5.0  # longest measurement without privileges, for rehearsals on the real clock
_TIMEOUT_MARGIN = 30.0  # s; a measurement that takes so much longer is cancelled
_P99 = (
    "p99 at most {good:g} us, bad above {bad:g} us: a tick's work takes up to a fifth of the "
    "period and must end before the next tick"
)
_LATE_ADVICE = (
    "close other programs, then see the findings on processor and kernel; no setting inside a "
    "virtual machine prevents stalls by its host"
)

_PRIVILEGED = "wake-up with the loop's privileges"
_SKIPPED_ADVICE = "see the advice on the periods skipped"


class WakeupMeasurements(NamedTuple):
    """Results of the two measurements; None for a measurement that failed."""

    unprivileged: dict[str, Any] | None
    privileged: dict[str, Any] | None
    trouble: str  # reason why the privileged measurement failed


def measure(dt: float, seconds: float) -> WakeupMeasurements:
    """Measure wake-ups without and with the loop's privileges, each in a process of its own.

    The privileged measurement takes ``seconds``, the other at most `UNPRIVILEGED_S`. The
    privileged one holds the host's real-time lock, so it never disturbs a run.
    """
    unprivileged, _ = _measure_wakeups(dt, min(seconds, UNPRIVILEGED_S), privileged=False)
    try:
        with acquire((REALTIME_WIRE,), "rig doctor") as acquired:
            privileged, trouble = _measure_wakeups(dt, seconds, privileged=True, locks=acquired.fds)
    except (BusyError, OSError) as error:
        return WakeupMeasurements(unprivileged, None, str(error))
    return WakeupMeasurements(unprivileged, privileged, trouble)


def _measure_wakeups(
    dt: float, seconds: float, *, privileged: bool, locks: tuple[int, ...] = ()
) -> tuple[dict[str, Any] | None, str]:
    request = json.dumps({"dt": dt, "seconds": seconds, "privileged": privileged})
    command = module_command("rig.host.wake")
    try:
        process = subprocess.run(
            command,
            input=request,
            capture_output=True,
            text=True,
            timeout=seconds + _TIMEOUT_MARGIN,
            check=False,
            pass_fds=locks,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return None, str(error)
    try:
        return json.loads(process.stdout), ""
    except ValueError:
        lines = process.stderr.strip().splitlines() or [f"exit code {process.returncode}"]
        return None, lines[-1]


def findings(measured: WakeupMeasurements, dt: float) -> list[Finding]:
    """Return the findings for a loop with the period ``dt`` (s)."""
    unprivileged = _unprivileged(measured.unprivileged, dt)
    if measured.privileged is not None:
        return [*_privileged(measured.privileged, dt), unprivileged]
    limit = _P99.format(good=1e6 * P99_GOOD * dt, bad=1e6 * P99_BAD * dt)
    missing = Check(AREA, _PRIVILEGED, limit).finding(
        measured.trouble, Verdict.UNKNOWN, "measure again when the real-time loop is free"
    )
    return [missing._replace(forbids=REALTIME), unprivileged]


def _lateness_text(wakeups: dict[str, Any]) -> str:
    p50, p99, largest = (wakeups[f"{name}_us"] for name in ("p50", "p99", "max"))
    return f"p50 {p50:.0f}, p99 {p99:.0f}, max {largest:.0f} us late"


def _privileged(wakeups: dict[str, Any], dt: float) -> list[Finding]:
    period = 1e6 * dt
    late = grade(wakeups["p99_us"], P99_GOOD * period, P99_BAD * period)
    if late is Verdict.GOOD and wakeups["max_us"] > MAX_GOOD * period:
        late = Verdict.WARNING
    limit = _P99.format(good=P99_GOOD * period, bad=P99_BAD * period)
    limit += f"; max at most {MAX_GOOD * period:g} us"
    elapsed = wakeups["wakes"] + wakeups["skipped"]
    periods = Verdict.GOOD if elapsed >= MIN_PERIODS else Verdict.BAD
    skips = Verdict.BAD if wakeups["skipped"] else Verdict.GOOD
    measured = f"{MIN_PERIODS} at least: fewer do not show an event of 1 in 10 000"
    skipped = "none: in a skipped period the loop reads no sensors and sends no command"
    gap = f", up to {wakeups['longest_gap']} in a row" if wakeups["skipped"] else ""
    return [
        Check(AREA, "periods measured", measured, REALTIME).finding(
            str(elapsed),
            periods,
            f"`rig doctor --seconds {MIN_PERIODS * dt:g}` or more",
            periods=elapsed,
        ),
        Check(AREA, _PRIVILEGED, limit, REALTIME).finding(
            _lateness_text(wakeups),
            late,
            _SKIPPED_ADVICE if wakeups["skipped"] else _LATE_ADVICE,
            **{key: wakeups[key] for key in ("p50_us", "p99_us", "max_us")},
            period_us=period,
        ),
        Check(AREA, "periods skipped", skipped, REALTIME).finding(
            f"{wakeups['skipped']} of {elapsed}{gap}",
            skips,
            _LATE_ADVICE,
            **{key: wakeups[key] for key in ("skipped", "wakes", "longest_gap")},
        ),
    ]


def _unprivileged(wakeups: dict[str, Any] | None, dt: float) -> Finding:
    limit = "none: a rehearsal on the real clock counts its lost ticks and stays correct"
    check = Check(AREA, "wake-up without privileges", limit)
    if wakeups is None:
        advice = "run `python -m rig.host.wake` by hand to see why"
        missing = check.finding("the measuring process failed", Verdict.UNKNOWN, advice)
        return missing._replace(forbids=ALL_USES)
    elapsed = wakeups["wakes"] + wakeups["skipped"]
    value = f"{_lateness_text(wakeups)}, {wakeups['skipped']} of {elapsed} skipped"
    verdict = Verdict.WARNING if wakeups["p99_us"] > 1e6 * dt else Verdict.GOOD
    advice = "rehearse on the virtual clock, which has no lateness"
    return check.finding(value, verdict, advice, **wakeups)
