"""Processes of runs killed and suspended at random moments: which rows are gone, who had power.

In rehearsals on the virtual and on the real clock, and on the wires of both rigs with their
emulated devices in a process apart.
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
SEED = 20_240_601  # who is killed when follows from it
TARGETS = ("logger", "loop", SUPERVISOR, *PAIRS, ALL)
VIRTUAL, REAL = "rehearsal", "rehearsal on the real clock"


def kill_rehearsals(
    folder: Path, each: int, latest: float, *, real_clock: bool
) -> list[KillOutcome]:
    """``each`` kills of every kind within ``latest`` s of a run's first tick, start or restart."""
    dice = random.Random(SEED + real_clock)
    todo = [kill for who in TARGETS for kill in draw_kills(dice, each, (who,), latest)]
    dice.shuffle(todo)
    wait_realtime_free()
    return run_kills(folder, todo, real_clock=real_clock, workers=1 if real_clock else 2)


def attack_wired_runs(folder: Path, name: str, count: int) -> list[AttackOutcome]:
    """So many attacks on runs of a wired rig."""
    with WIRED_RIGS[name](folder) as rig:
        dice = random.Random(SEED)
        return [
            run_attack(rig, folder / f"run{number}", attack)
            for number, attack in enumerate(draw_attacks(dice, rig, count, 4.0))
        ]


def rehearsed_figures(mode: str, found: list[KillOutcome]) -> list[Figure]:
    """What became of rehearsals, by who was killed."""
    most = MAX_SECONDS_LOST if mode == REAL else None  # a virtual second is gone in no time
    figures = []
    for who in TARGETS:
        some = [fate for fate in found if fate.kill.target == who]
        if not some:
            continue
        name = f"{mode}, {who} killed"
        seconds = [fate.seconds_lost for fate in some]
        figures += [
            figure(name, "times", sum(len(fate.kill.moments) for fate in some)),
            figure(f"{name}: rows lost", "rows a run", [fate.rows_lost for fate in some]),
            figure(f"{name}: time lost", "s", seconds, at_most=most, criterion="worst"),
        ]
        stops = [fate.stop_seconds for fate in some if who in LOOP_SURVIVES and fate.rows_put]
        if stops:
            figures.append(figure(f"{name}: until loop and logger had ended", "s", stops))
    wrong = sum(len(fate.failures) for fate in found)
    return [*figures, figure(f"{mode}: claims that failed", "claims", wrong, at_most=0)]


def wired_figures(name: str, found: list[AttackOutcome]) -> list[Figure]:
    """What became of runs on wires, by who was killed or suspended."""
    figures = []
    for attack in sorted({(one.attack.targets, one.attack.method) for one in found}):
        some = [one for one in found if (one.attack.targets, one.attack.method) == attack]
        who, how = attack
        text = f"{name}, {' and '.join(who)} {'killed' if how == KILLED else 'suspended'}"
        figures += [
            figure(text, "times", len(some)),
            figure(f"{text}: rows lost", "rows a run", [one.rows_lost for one in some]),
        ]
        powerless = [
            one.power_off_after
            for one in some
            if one.power_off_after is not None and not one.attack.starting
        ]
        if powerless:
            figures.append(figure(f"{text}: until no motor had power", "s", powerless))
    wrong = sum(len(one.failures) for one in found)
    return [*figures, figure(f"{name}: claims that failed", "claims", wrong, at_most=0)]


def _format_failures(mode: str, found: Iterable[tuple[object, tuple[str, ...]]]) -> list[str]:
    return [f"{mode}: {what}: {claim}" for what, wrong in found for claim in wrong]


def measure(short: bool) -> Result:
    """Kill and suspend each process, two and all at once, at random moments, in every mode."""
    each, wired, latest = (1, 4, 0.8) if short else (10, 60, 2.5)
    figures, failed, times = list[Figure](), list[str](), 0
    with tempfile.TemporaryDirectory() as scratch:
        for mode in (VIRTUAL, REAL):
            place = Path(scratch) / mode.replace(" ", "_")
            place.mkdir()
            rehearsed = kill_rehearsals(place, each, latest, real_clock=mode == REAL)
            figures += rehearsed_figures(mode, rehearsed)
            failed += _format_failures(mode, ((one.kill.target, one.failures) for one in rehearsed))
            times += sum(len(one.kill.moments) for one in rehearsed)
        for name in WIRED_RIGS:
            place = Path(scratch) / name
            place.mkdir()
            found = attack_wired_runs(place, name, wired)
            figures += wired_figures(name, found)
            failed += _format_failures(name, ((one.attack, one.failures) for one in found))
            times += len(found)
    return Result(
        "crash",
        "processes killed (kill -9) and suspended at random moments of runs at 1 kHz, one in four "
        "while the run starts; the record is recovered and compared with the ring, which a "
        "separate process keeps open; power is read at the emulated drives",
        f"{times} kills and suspensions",
        tuple(figures),
        (
            "claims: every saved row is in the ring to the bit, each once; `rig recover` states "
            "exactly the ticks that are missing; no motor has power later than its table of faults "
            "states, and not sooner than the damping lasts where the loop outlives the supervisor; "
            "no process is left, the locks are free, the next run starts",
            "time lost with the loop counts from the last logged tick to the kill",
            "all killed: the ring dies with its processes, what the logger flushed last is left",
            *sorted(set(failed)),
        ),
    )
