"""kill -9 of logger, loop and supervisor at random moments: which rows are gone."""

import random
import tempfile
from pathlib import Path

from benchmarks.support.kills import ALL, SUPERVISOR, Fate, plans, soak
from benchmarks.support.live import wait_realtime_free
from benchmarks.support.result import Figure, Result, figure

SECONDS_LOST = 1.0
DICE = 20_240_601  # who is killed when follows from it
WORKERS = 2  # runs at a time, each worker with a real-time place of its own
WHOM = ("logger", "loop", SUPERVISOR, ALL)


def fates(folder: Path, each: int, latest: float) -> list[Fate]:
    """``each`` kills of every kind within ``latest`` s of a run's first tick, start or restart."""
    dice = random.Random(DICE)
    todo = [kill for who in WHOM for kill in plans(dice, each, (who,), latest)]
    dice.shuffle(todo)
    wait_realtime_free()
    return soak(folder, todo, real_clock=True, workers=WORKERS)


def figures(who: str, found: list[Fate]) -> list[Figure]:
    """What became of the runs in which one kind of process was killed."""
    name = f"{who} killed"
    made = [
        figure(name, "times", sum(len(fate.kill.moments) for fate in found)),
        figure(f"{name}: rows put by then", "rows a run", [fate.put for fate in found]),
        figure(f"{name}: rows lost", "rows a run", [fate.lost for fate in found]),
        figure(
            f"{name}: time lost",
            "s",
            [fate.seconds for fate in found],
            at_most=SECONDS_LOST,
            judge="worst",
        ),
    ]
    stops = [fate.stopping for fate in found if fate.kill.who == SUPERVISOR and fate.put]
    if stops:
        made.append(figure(f"{name}: until loop and logger had ended", "s", stops))
    wrong = sum(len(fate.wrong) for fate in found)
    made.append(figure(f"{name}: claims that failed", "claims", wrong, at_most=0))
    return made


def measure(short: bool) -> Result:
    """Kill each of the three processes, and all at once, at random moments of real-time runs."""
    each, latest = (1, 0.8) if short else (50, 2.5)
    with tempfile.TemporaryDirectory() as scratch:
        found = fates(Path(scratch), each, latest)
    made = [
        one
        for who in WHOM
        for one in figures(who, [fate for fate in found if fate.kill.who == who])
    ]
    failed = sorted({f"{fate.kill.who}: {text}" for fate in found for text in fate.wrong})
    return Result(
        "crash",
        "kill -9 at random moments of runs at 1 kHz on the real clock, one in four in starting up; "
        "what is left is recovered and held against the ring, which a witness kept open",
        f"{sum(len(fate.kill.moments) for fate in found)} kills in {len(found)} runs, "
        f"{WORKERS} at a time; the logger up to four times in one run",
        tuple(made),
        (
            "claims: every saved row is in the ring to the bit, each once; `rig recover` states "
            "exactly the ticks that are missing; after the supervisor's death the plant's drive is "
            "off; no process is left, the locks are free, the next run starts",
            "time lost with the loop counts from the last logged tick to the kill",
            "all killed: the ring dies with its processes, what the logger flushed last is left",
            *failed,
        ),
    )
