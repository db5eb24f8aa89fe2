"""Kill or suspend processes of a run on real wires, and check its power-off and its record.

The devices run in a separate process. The emulated drives report when no motor has power; the ring,
held open from outside, has the rows that the loop put. The allowed time until power-off comes from
the rig's table of faults (configs/faults), and for the supervisor from the rig file.
"""

import os
import random
import signal
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from benchmarks.support.fault_rigs import RIGS
from benchmarks.support.kills import RingObserver, compare_record_with_ring
from benchmarks.support.live_run import LiveRun, TimeOutError, wait_until
from benchmarks.support.wired_rigs import (
    WiredRig,
    process_id,
    processes,
    start_run,
    wait_for_end,
    wait_for_power,
)
from rig.execution.fault_table import LOOP_LOST, NO_STOP
from rig.processes.supervisor import POLL_INTERVAL_S

KILLED, SUSPENDED = "killed", "hung"  # names in the tables of faults
SUPERVISOR, LOGGER, LOOP, ALL = "supervisor", "logger", "loop", "all"
SUPERVISOR_TIMEOUT = 1.0  # s, supervisor_timeout_s of the shipped rigs
REACTION_S = 0.1  # s until a loop has detected the loss, and its drives have switched off
MARGIN = 0.25  # s, for a host with other work
MAX_ROWS_LOST = 1000  # if all processes are killed at once: one second
_SIGNALS = {KILLED: signal.SIGKILL, SUSPENDED: signal.SIGSTOP}


class Attack(NamedTuple):
    """An attack on processes of a run."""

    targets: tuple[str, ...]  # process names; ALL: every process
    method: str  # KILLED or SUSPENDED
    starting: bool  # the moment counts from the start of the run, else from power on a motor
    moment: float  # s

    def __str__(self) -> str:
        since = "the start" if self.starting else "power on"
        return f"{' and '.join(self.targets)} {self.method} {self.moment:.2f} s after {since}"


class AttackOutcome(NamedTuple):
    """Outcome of an attack."""

    attack: Attack
    power_off_after: (
        float | None
    )  # s from the attack until no motor had power; None: it had to keep it
    rows_put: int  # by the loop, into the ring
    rows_lost: int  # of them, missing from the files
    failures: tuple[str, ...]  # messages of failed checks


def draw_attacks(rng: random.Random, rig: WiredRig, count: int, latest: float) -> list[Attack]:
    """Return ``count`` attacks on the processes of a rig's run in turn, at random moments.

    Moments are up to ``latest`` s after power on. A quarter of the kills come while the run starts,
    within 4 s.
    """
    alone: list[tuple[str, ...]] = [
        (name,) for name in (SUPERVISOR, LOOP, LOGGER, *rig.io_processes)
    ]
    several = [(SUPERVISOR, LOGGER), (SUPERVISOR, LOOP), (LOOP, LOGGER), (ALL,)]
    kinds = [(targets, method) for method in (KILLED, SUSPENDED) for targets in alone]
    kinds += [(targets, KILLED) for targets in several]
    rng.shuffle(kinds)
    drawn = []
    for number in range(count):
        targets, method = kinds[number % len(kinds)]
        starting = method == KILLED and rng.random() < 0.25
        drawn.append(
            Attack(targets, method, starting, rng.uniform(0.0, 4.0 if starting else latest))
        )
    return drawn


def power_off_limits(rig: WiredRig, attack: Attack) -> tuple[float, float] | None:
    """Return the allowed range of the time (s) from an attack until no motor has power.

    None: the motors must keep their power.
    """
    targets = set(attack.targets)
    if targets & {LOOP, ALL}:
        return 0.0, _table_limit(rig, LOOP, attack.method)
    if SUPERVISOR in targets:
        wait = SUPERVISOR_TIMEOUT if attack.method == SUSPENDED else 0.0
        soonest = rig.damping + wait - (POLL_INTERVAL_S + 0.05 if wait else 0.01)
        return soonest, rig.damping + wait + REACTION_S
    if targets == {LOGGER}:
        return None
    (name,) = targets
    latest = _table_limit(rig, name, attack.method)
    return None if latest == 0.0 else (0.0, latest)


def _table_limit(rig: WiredRig, name: str, method: str) -> float:
    """Return the time limit (s) of a process in the rig's table of faults; 0 if the run goes on."""
    for row in RIGS[rig.name].rows():
        if (row.device, row.fault, row.onset) == (f"process {name}", method, ""):
            assert row.expected == LOOP_LOST or row.expected in NO_STOP or row.max_seconds > 0.0
            return row.max_seconds
    raise LookupError(f"{rig.name}: no row of the fault table for the process {name}, {method}")


def run_attack(rig: WiredRig, runs: Path, attack: Attack) -> AttackOutcome:
    """Start a run in ``runs`` (new), attack it, and check its power and its record."""
    failures = list[str]()
    powerless: float | None = None
    with start_run(rig, runs) as run:
        observer = RingObserver(run)
        try:
            if not attack.starting:
                wait_for_power(rig, run)
            observer.observe(time.monotonic() + attack.moment)
            at = _attack_processes(runs, attack)
            powerless = _check_power(rig, attack, at, failures)
            _wait_for_end(run, runs, observer, attack)
        except TimeOutError as error:
            failures.append(str(error))
        if rig.has_power():
            failures.append("a motor has power after the run")
        _, _, lost, claims = compare_record_with_ring(observer, runs, rig.row_type)
    max_lost = 0 if ALL not in attack.targets else MAX_ROWS_LOST
    if lost > max_lost:
        failures.append(f"{lost} rows are lost")
    return AttackOutcome(attack, powerless, observer.rows_put, lost, (*failures, *claims))


def _attack_processes(runs: Path, attack: Attack) -> float:
    """Wait for the processes, then kill or suspend them; return the time (s, monotonic)."""
    names = list(processes(runs)) if ALL in attack.targets else list(attack.targets)
    pids = [process_id(runs, name) for name in names]
    at = time.monotonic()
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, _SIGNALS[attack.method])
    return at


def _check_power(rig: WiredRig, attack: Attack, at: float, failures: list[str]) -> float | None:
    """Check when the motors lose their power; return the seconds from the attack."""
    limits = power_off_limits(rig, attack)
    if limits is None:
        time.sleep(0.5)
        if not attack.starting and not rig.has_power():
            failures.append("the motors lost their power although the run goes on")
        return None
    soonest, latest = limits
    power_off = rig.power_off_time(latest + 2.0)
    if power_off is None:
        failures.append(f"a motor still has power {latest + 2.0:.1f} s later")
        return None
    seconds = power_off - at
    if seconds > latest + MARGIN or (seconds < soonest and not attack.starting):
        failures.append(f"power off after {seconds:.3f} s, due {soonest:.2f} to {latest:.2f} s")
    return max(0.0, seconds)


def _wait_for_end(run: LiveRun, runs: Path, observer: RingObserver, attack: Attack) -> None:
    """Resume a suspended process that is not replaced, stop a continuing run, wait for the end."""
    if attack.targets == (SUPERVISOR,) and attack.method == SUSPENDED:
        wait_for_end(runs, except_for=(SUPERVISOR,))
        run.process.send_signal(signal.SIGCONT)
    elif attack.targets == (LOGGER,):
        observer.observe(time.monotonic() + 1.0)
        if attack.method == SUSPENDED:
            os.kill(process_id(runs, LOGGER), signal.SIGCONT)
        run.stop()
    elif {SUPERVISOR, ALL}.isdisjoint(attack.targets):
        observer.observe(time.monotonic() + 1.0)
        run.stop()  # the table of faults lets it go on
    wait_until(lambda: run.process.poll() is not None, "the end of the supervisor")
    wait_for_end(runs)
    observer.observe(0.0)
