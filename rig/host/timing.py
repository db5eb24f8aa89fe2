"""How late this host wakes a process that asks for nothing but to be woken."""

import json
import subprocess
import sys
from typing import Any, NamedTuple

from rig.host.finding import BOTH, REALTIME, Finding, Verdict, forbidding, graded
from rig.processes.wire_locks import REALTIME_PLACE, hold
from rig.recording.runs.create import BusyError

AREA = "timing"
P99_GOOD, P99_BAD = 0.10, 0.30  # of the period
MAX_GOOD = 0.50  # of the period; beyond a whole one it is skipped
LEAST = 30_000  # periods: none skipped in so many means less than 1 in 10 000, with 95 %
PLAIN = 5.0  # s, of the measurement that only rehearsals on the real clock depend on
_STALL = 30.0  # s beyond the measuring after which a measurement is given up
_P99 = (
    "p99 at most {good:g} us, bad above {bad:g} us: the tick's own work must end before the next "
    "one is due, and takes up to a fifth of the period"
)
_QUIET = (
    "close what else runs, then see the findings on processor and kernel; a virtual machine is "
    "stalled by its host and no setting inside it helps"
)

_BELOW = "as for the periods skipped"


class Measured(NamedTuple):
    """What the two measurements gave; None where one could not be made."""

    plain: dict[str, Any] | None
    privileged: dict[str, Any] | None
    trouble: str  # why the second one could not be made


def measure(dt: float, seconds: float) -> Measured:
    """Measure without (at most `PLAIN` s) and for ``seconds`` with the loop's privileges.

    Each in a process of its own. The second holds the host's real-time place meanwhile: a run is
    never disturbed.
    """
    plain, _ = _woken(dt, min(seconds, PLAIN), privileged=False)
    try:
        with hold((REALTIME_PLACE,), "rig doctor") as held:
            privileged, trouble = _woken(dt, seconds, privileged=True, locks=held.fds)
    except (BusyError, OSError) as error:
        return Measured(plain, None, str(error))
    return Measured(plain, privileged, trouble)


def _woken(
    dt: float, seconds: float, *, privileged: bool, locks: tuple[int, ...] = ()
) -> tuple[dict[str, Any] | None, str]:
    job = json.dumps({"dt": dt, "seconds": seconds, "privileged": privileged})
    command = [sys.executable, "-m", "rig.host.wake"]
    try:
        done = subprocess.run(
            command,
            input=job,
            capture_output=True,
            text=True,
            timeout=seconds + _STALL,
            check=False,
            pass_fds=locks,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return None, str(error)
    try:
        return json.loads(done.stdout), ""
    except ValueError:
        words = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        return None, words[-1]


def findings(measured: Measured, dt: float) -> list[Finding]:
    """What the measurements mean for a loop of this period (s)."""
    found = []
    if measured.privileged is None:
        found.append(
            Finding(
                AREA,
                "wake-up with the loop's privileges",
                measured.trouble,
                _P99.format(good=1e6 * P99_GOOD * dt, bad=1e6 * P99_BAD * dt),
                Verdict.UNKNOWN,
                "measure again when the real-time loop is free",
                REALTIME,
            )
        )
    else:
        found += _judged(measured.privileged, dt)
    found.append(_plain(measured.plain, dt))
    return found


def _words(told: dict[str, Any]) -> str:
    return f"p50 {told['p50_us']:.0f}, p99 {told['p99_us']:.0f}, max {told['max_us']:.0f} us late"


def _judged(told: dict[str, Any], dt: float) -> list[Finding]:
    period = 1e6 * dt
    late = graded(told["p99_us"], P99_GOOD * period, P99_BAD * period)
    if late is Verdict.GOOD and told["max_us"] > MAX_GOOD * period:
        late = Verdict.WARNING
    limit = _P99.format(good=P99_GOOD * period, bad=P99_BAD * period)
    elapsed = told["wakes"] + told["skipped"]
    enough = Verdict.GOOD if elapsed >= LEAST else Verdict.BAD
    skips = Verdict.BAD if told["skipped"] else Verdict.GOOD
    return [
        Finding(
            AREA,
            "periods measured",
            str(elapsed),
            f"{LEAST} at least: fewer do not show what happens once in 10 000",
            enough,
            "" if enough is Verdict.GOOD else f"`rig doctor --seconds {LEAST * dt:g}` or more",
            forbidding(enough, *REALTIME),
            {"periods": elapsed},
        ),
        Finding(
            AREA,
            "wake-up with the loop's privileges",
            _words(told),
            f"{limit}; max at most {MAX_GOOD * period:g} us",
            late,
            "" if late is Verdict.GOOD else _BELOW if told["skipped"] else _QUIET,
            forbidding(late, *REALTIME),
            {key: told[key] for key in ("p50_us", "p99_us", "max_us")} | {"period_us": period},
        ),
        Finding(
            AREA,
            "periods skipped",
            f"{told['skipped']} of {elapsed}"
            + (f", up to {told['longest_gap']} in a row" if told["skipped"] else ""),
            "none: a skipped period is a tick without sense and command",
            skips,
            _QUIET if told["skipped"] else "",
            forbidding(skips, *REALTIME),
            {key: told[key] for key in ("skipped", "wakes", "longest_gap")},
        ),
    ]


def _plain(told: dict[str, Any] | None, dt: float) -> Finding:
    what = "wake-up without privileges"
    limit = "none: a real-clock rehearsal without them shows what is lost, and stays correct"
    if told is None:
        unknown = "the measuring process failed"
        advice = "run `python -m rig.host.wake` by hand to see why"
        return Finding(AREA, what, unknown, limit, Verdict.UNKNOWN, advice, BOTH)
    value = f"{_words(told)}, {told['skipped']} of {told['wakes'] + told['skipped']} skipped"
    verdict = Verdict.WARNING if told["p99_us"] > 1e6 * dt else Verdict.GOOD
    advice = (
        "" if verdict is Verdict.GOOD else "rehearse on the virtual clock; nothing is late there"
    )
    return Finding(AREA, what, value, limit, verdict, advice, (), told)
