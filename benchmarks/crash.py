"""Processes of runs killed and suspended at random moments: lost rows, and time until power-off.

In rehearsals on the virtual and on the real clock, and on the wires of both rigs with their
emulated devices in a separate process.
"""

import random
import tempfile
from collections.abc import Iterable
from pathlib import Path

from benchmarks.support.kills import (
    ALL,
    LOOP_SURVIVES,
    PAIRS,
    SUPERVISOR,
    KillOutcome,
    draw_kills,
    run_kills,
)
from benchmarks.support.live_run import wait_realtime_free
from benchmarks.support.result import Figure, Result, figure
from benchmarks.support.wired_attacks import KILLED, AttackOutcome, draw_attacks, run_attack
from benchmarks.support.wired_rigs import WIRED_RIGS

MAX_SECONDS_LOST = 1.0
SEED = 20_240_601  # of the random targets and moments
TARGETS = ("logger", "loop", SUPERVISOR, *PAIRS, ALL)
_LATEST_VIRTUAL = 0.6  # s
VIRTUAL, REAL = "rehearsal", "rehearsal on the real clock"


def kill_rehearsals(
    folder: Path, each: int, latest: float, *, real_clock: bool
) -> list[KillOutcome]:
    """Kill every target ``each`` times, up to ``latest`` s after a run's first tick or start.

    A rehearsal on the virtual clock is over in some seconds, so there it is earlier.
    """
    if not real_clock:
        latest = min(latest, _LATEST_VIRTUAL)
    rng = random.Random(SEED + real_clock)
    kills = [kill for target in TARGETS for kill in draw_kills(rng, each, (target,), latest)]
    rng.shuffle(kills)
    wait_realtime_free()
    return run_kills(folder, kills, real_clock=real_clock, workers=1 if real_clock else 2)


def attack_wired_runs(folder: Path, name: str, count: int) -> list[AttackOutcome]:
    """Execute ``count`` attacks on runs of a wired rig."""
    with WIRED_RIGS[name](folder) as rig:
        rng = random.Random(SEED)
        return [
            run_attack(rig, folder / f"run{number}", attack)
            for number, attack in enumerate(draw_attacks(rng, rig, count, 4.0))
        ]


def rehearsed_figures(mode: str, outcomes: list[KillOutcome]) -> list[Figure]:
    """Return the figures of killed rehearsals, by target."""
    limit = MAX_SECONDS_LOST if mode == REAL else None  # virtual seconds pass much faster
    figures = []
    for target in TARGETS:
        selected = [outcome for outcome in outcomes if outcome.kill.target == target]
        if not selected:
            continue
        name = f"{mode}, {target} killed"
        seconds = [outcome.seconds_lost for outcome in selected]
        figures += [
            figure(name, "times", sum(len(outcome.kill.moments) for outcome in selected)),
            figure(f"{name}: rows lost", "rows a run", [outcome.rows_lost for outcome in selected]),
            figure(f"{name}: time lost", "s", seconds, at_most=limit, criterion="worst"),
        ]
        stops = [
            outcome.stop_seconds
            for outcome in selected
            if target in LOOP_SURVIVES and outcome.rows_put
        ]
        if stops:
            figures.append(figure(f"{name}: until loop and logger had ended", "s", stops))
    failures = sum(len(outcome.failures) for outcome in outcomes)
    return [*figures, figure(f"{mode}: claims that failed", "claims", failures, at_most=0)]


def wired_figures(name: str, outcomes: list[AttackOutcome]) -> list[Figure]:
    """Return the figures of attacked runs on wires, by target and method."""
    figures = []
    for attack in sorted({(outcome.attack.targets, outcome.attack.method) for outcome in outcomes}):
        selected = [
            outcome
            for outcome in outcomes
            if (outcome.attack.targets, outcome.attack.method) == attack
        ]
        target, method = attack
        text = f"{name}, {' and '.join(target)} {'killed' if method == KILLED else 'suspended'}"
        figures += [
            figure(text, "times", len(selected)),
            figure(f"{text}: rows lost", "rows a run", [outcome.rows_lost for outcome in selected]),
        ]
        power_off = [
            outcome.power_off_after
            for outcome in selected
            if outcome.power_off_after is not None and not outcome.attack.starting
        ]
        if power_off:
            figures.append(figure(f"{text}: until no motor had power", "s", power_off))
    failures = sum(len(outcome.failures) for outcome in outcomes)
    return [*figures, figure(f"{name}: claims that failed", "claims", failures, at_most=0)]


def _format_failures(mode: str, outcomes: Iterable[tuple[object, tuple[str, ...]]]) -> list[str]:
    return [f"{mode}: {attack}: {claim}" for attack, failures in outcomes for claim in failures]


def measure(short: bool) -> Result:
    """Kill and suspend each process, two, and all at once, at random moments, in every mode."""
    each, wired, latest = (1, 4, 0.8) if short else (10, 60, 2.5)
    figures, failed, times = list[Figure](), list[str](), 0
    with tempfile.TemporaryDirectory() as scratch:
        for mode in (VIRTUAL, REAL):
            folder = Path(scratch) / mode.replace(" ", "_")
            folder.mkdir()
            rehearsed = kill_rehearsals(folder, each, latest, real_clock=mode == REAL)
            figures += rehearsed_figures(mode, rehearsed)
            failed += _format_failures(
                mode, ((outcome.kill.target, outcome.failures) for outcome in rehearsed)
            )
            times += sum(len(outcome.kill.moments) for outcome in rehearsed)
        for name in WIRED_RIGS:
            folder = Path(scratch) / name
            folder.mkdir()
            outcomes = attack_wired_runs(folder, name, wired)
            figures += wired_figures(name, outcomes)
            failed += _format_failures(
                name, ((outcome.attack, outcome.failures) for outcome in outcomes)
            )
            times += len(outcomes)
    return Result(
        "crash",
        "processes killed (kill -9) and suspended at random moments of runs at 1 kHz, one in four "
        "while the run starts; the record is recovered and compared with the ring, which a "
        "separate process keeps open; power is read at the emulated drives",
        f"{times} kills and suspensions",
        tuple(figures),
        (
            "claims: every saved row equals its row in the ring to the bit and occurs once; `rig "
            "recover` states exactly the missing ticks; no motor has power for longer than the "
            "table of faults allows, nor for less than the damping if the loop outlives the "
            "supervisor; no process remains, the locks are free, the next run starts",
            "loop killed: the time lost counts from the last logged tick to the kill",
            "all killed: the ring ends with its processes, the rows of the last flush remain",
            *sorted(set(failed)),
        ),
    )
