"""One run on real wires, one of its processes killed or suspended, and what witnesses say of it.

The devices are a process apart. When no motor had power is asked at the emulated drives; which rows
the loop put is seen in the ring, held open from outside. How soon the motors must be without power
is stated elsewhere: by the rig's table of faults (configs/faults), and for the supervisor by the
rig file.
"""

import os
import random
import signal
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from benchmarks.support.fault_rigs import RIGS
from benchmarks.support.fault_table import LOOP_LOST, NO_STOP
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
from rig.processes.supervisor import POLL_INTERVAL_S

KILLED, SUSPENDED = "killed", "hung"  # as the tables of faults call them
SUPERVISOR, LOGGER, LOOP, ALL = "supervisor", "logger", "loop", "all"
SUPERVISOR_TIMEOUT = 1.0  # s, supervisor_timeout_s of the shipped rigs
REACTION_S = 0.1  # s until a loop has noticed, and its drives have gone off
MARGIN = 0.25  # s of a host with other work
MAX_ROWS_LOST = 1000  # rows, when everything is killed at once: a second
_SIGNALS = {KILLED: signal.SIGKILL, SUSPENDED: signal.SIGSTOP}


class Attack(NamedTuple):
    """What to do to a run."""

    targets: tuple[str, ...]  # processes by name; ALL: every one
    method: str  # KILLED or SUSPENDED
    starting: bool  # the moment counts from the start of the run, else from power on the motors
    moment: float  # s

    def __str__(self) -> str:
        since = "the start" if self.starting else "power on"
        return f"{' and '.join(self.targets)} {self.method} {self.moment:.2f} s after {since}"


class AttackOutcome(NamedTuple):
    """What an attack led to."""

    attack: Attack
    power_off_after: (
        float | None
    )  # s from the attack until no motor had power; None: it had to keep it
    rows_put: int  # rows that the loop put into the ring
    rows_lost: int  # of them, rows that are nowhere in the files
    failures: tuple[str, ...]  # claims that do not hold


def draw_attacks(rng: random.Random, rig: WiredRig, count: int, latest: float) -> list[Attack]:
    """So many attacks on all processes of a rig's run in turn, at moments drawn by ``dice``.

    Moments lie up to ``latest`` s after power on; a quarter of the attacks come while the run
    starts, within 4 s.
    """
    alone: list[tuple[str, ...]] = [
        (name,) for name in (SUPERVISOR, LOOP, LOGGER, *rig.io_processes)
    ]
    several = [(SUPERVISOR, LOGGER), (SUPERVISOR, LOOP), (LOOP, LOGGER), (ALL,)]
    kinds = [(who, how) for how in (KILLED, SUSPENDED) for who in alone]
    kinds += [(who, KILLED) for who in several]
    rng.shuffle(kinds)
    made = []
    for number in range(count):
        who, how = kinds[number % len(kinds)]
        starting = how == KILLED and rng.random() < 0.25
        made.append(Attack(who, how, starting, rng.uniform(0.0, 4.0 if starting else latest)))
    return made


def power_off_limits(rig: WiredRig, attack: Attack) -> tuple[float, float] | None:
    """Soonest and latest time (s) from an attack until no motor has power; None: they keep it."""
    who = set(attack.targets)
    if who & {LOOP, ALL}:
        return 0.0, _table_limit(rig, LOOP, attack.method)
    if SUPERVISOR in who:
        waits = SUPERVISOR_TIMEOUT if attack.method == SUSPENDED else 0.0
        soonest = rig.damping + waits - (POLL_INTERVAL_S + 0.05 if waits else 0.01)
        return soonest, rig.damping + waits + REACTION_S
    if who == {LOGGER}:
        return None
    (name,) = who
    latest = _table_limit(rig, name, attack.method)
    return None if latest == 0.0 else (0.0, latest)


def _table_limit(rig: WiredRig, name: str, how: str) -> float:
    """What the rig's table of faults says of a process; 0 if the run goes on."""
    for row in RIGS[rig.name].rows():
        if (row.device, row.fault, row.onset) == (f"process {name}", how, ""):
            assert row.expected == LOOP_LOST or row.expected in NO_STOP or row.max_seconds > 0.0
            return row.max_seconds
    raise LookupError(f"{rig.name}: no row says what happens when {name} is {how}")


def run_attack(rig: WiredRig, runs: Path, attack: Attack) -> AttackOutcome:
    """Start a run in ``runs`` (new), attack it, and compare its record with the witnesses."""
    wrong = list[str]()
    powerless: float | None = None
    with start_run(rig, runs) as run:
        witness = RingObserver(run)
        try:
            if not attack.starting:
                wait_for_power(rig, run)
            witness.observe(time.monotonic() + attack.moment)
            at = _attack_processes(runs, attack)
            powerless = _check_power(rig, attack, at, wrong)
            _wait_for_end(run, runs, witness, attack)
        except TimeOutError as error:
            wrong.append(str(error))
        if rig.has_power():
            wrong.append("a motor has power after the run")
        _, _, lost, claims = compare_record_with_ring(witness, runs, rig.row_type)
    most = 0 if ALL not in attack.targets else MAX_ROWS_LOST
    if lost > most:
        wrong.append(f"{lost} rows are lost")
    return AttackOutcome(attack, powerless, witness.rows_put, lost, (*wrong, *claims))


def _attack_processes(runs: Path, attack: Attack) -> float:
    """Kill or suspend; gives when (s, monotonic). A process that is not there yet is waited for."""
    wanted = list(processes(runs)) if ALL in attack.targets else list(attack.targets)
    pids = [process_id(runs, name) for name in wanted]
    at = time.monotonic()
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, _SIGNALS[attack.method])
    return at


def _check_power(rig: WiredRig, attack: Attack, at: float, wrong: list[str]) -> float | None:
    """See whether the motors lose their power when they have to; gives how soon they did (s)."""
    times = power_off_limits(rig, attack)
    if times is None:
        time.sleep(0.5)
        if not attack.starting and not rig.has_power():
            wrong.append("the motors lost their power, and should have kept it")
        return None
    soonest, latest = times
    gone = rig.power_off_time(latest + 2.0)
    if gone is None:
        wrong.append(f"a motor still has power {latest + 2.0:.1f} s later")
        return None
    seconds = gone - at
    if seconds > latest + MARGIN or (seconds < soonest and not attack.starting):
        wrong.append(f"power off after {seconds:.3f} s, due {soonest:.2f} to {latest:.2f} s")
    return max(0.0, seconds)


def _wait_for_end(run: LiveRun, runs: Path, witness: RingObserver, attack: Attack) -> None:
    """Wake who was suspended and could not be replaced; stop what goes on; wait for the end."""
    if attack.targets == (SUPERVISOR,) and attack.method == SUSPENDED:
        wait_for_end(runs, except_for=(SUPERVISOR,))
        run.process.send_signal(signal.SIGCONT)
    elif attack.targets == (LOGGER,):
        witness.observe(time.monotonic() + 1.0)
        if attack.method == SUSPENDED:
            os.kill(process_id(runs, LOGGER), signal.SIGCONT)
        run.stop()
    elif {SUPERVISOR, ALL}.isdisjoint(attack.targets):
        witness.observe(time.monotonic() + 1.0)
        run.stop()  # where the table says that it goes on
    wait_until(lambda: run.process.poll() is not None, "the end of the supervisor")
    wait_for_end(runs)
    witness.observe(0.0)
