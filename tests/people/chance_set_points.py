"""Manual runs on simulated rigs in this process: set points by chance, and their executions.

Each accepted set point follows the one before after a chance number of ticks; the compiled
execution records when it took them up, and the interpreted one, and one whose code appears in the
middle, get them in the same ticks.
"""

from __future__ import annotations

import importlib
import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from rig.cli.manual import write_task
from rig.compilation.tick_code import compile_tick
from rig.execution.attended import attended_task
from rig.kinds.rig_file import kind_of_task
from rig.people.set_points import LiveColumns, LiveSet
from rig.processes.run_types import ExecutionMode, Task
from rig.processes.tick_compiler import compile_job, source_of
from rig.realtime import coupled_ticks, loop, tick
from rig.realtime.clock import VirtualClock
from rig.realtime.reasons import Reason
from rig.realtime.requests import NO_REQUEST, Request
from rig.realtime.safety import RUN
from rig.realtime.sequence import DONE, MANUAL
from rig.recording import ring
from rig.recording.row_layout import leaves
from rig.recording.runs.mcap_file import row_dtype

CAPACITY = 120_000
MAX_SPACING = 80  # ticks between two set points
POOL = 24  # different accepted set points


class ManualRig(NamedTuple):
    """A manual run, its code, and set points that its checks accept."""

    task: Task
    mode: ExecutionMode
    code: Path
    pool: tuple[tuple[float, ...], ...]

    @property
    def live(self) -> LiveColumns:
        assert self.task.people.live is not None
        return self.task.people.live


def manual_task(
    file: Path, folder: Path, drive: str = "", *, clamped: bool = False, **check: bool
) -> tuple[Task, ExecutionMode]:
    """Return a manual run of a file, and its mode; ``check``: keywords of all checks."""
    path = write_task(file, folder, drive, clamped=clamped)
    tasks = kind_of_task(path).room("tasks")
    report = tasks.examine(path)
    assert report.ok, report.text()
    task = attended_task(
        tasks.execution_task(report.checked, report.plan), report.checked, report.plan, file,
        lambda path: tasks.examine(path, **check), folder / "kept.yaml", manual=True,
        unattended=True,
    )  # fmt: skip
    return task, tasks.rehearsal_mode(report.checked, real_clock=False)


def with_pool(
    task: Task,
    mode: ExecutionMode,
    draw: Callable[[LiveColumns, random.Random], LiveSet],
    seed: str,
) -> ManualRig:
    """Return the run with set points by chance that its checks accept, and its code."""
    live, random_ = task.people.live, random.Random(seed)
    assert live is not None
    pool: list[tuple[float, ...]] = []
    for _ in range(20 * POOL):
        found = live.check(draw(live, random_))
        assert bool(found.numbers) is not bool(found.problems)
        if found.numbers:
            pool.append(tuple(found.numbers))
        if len(pool) == POOL:
            break
    assert len(pool) == POOL
    code = compile_tick(source_of(task.tick, compile_job(task, mode)))
    return ManualRig(task, mode, code, tuple(pool))


def drawn(live: LiveColumns, random_: random.Random) -> LiveSet:
    """Return a set point with values in the allowed ranges, mostly modest."""
    values, signal = dict(live.first().values), dict(live.first().signal)
    for each in live.describe():
        if each["part"] == "values" and "choices" in each:
            values[each["key"]] = random_.choice(each["choices"])
        ends = [each.get("low"), each.get("high")]
        if each["part"] == "values" and None not in ends and random_.random() < 0.7:
            values[each["key"]] = random_.random() ** 3 * random_.choice(ends)
    signal["kind"] = random_.choice(["none", "sine", "step", "chirp"])
    force = next(each for each in live.describe() if each["key"] == "amplitude")["high"]
    signal["amplitude"] = 0.03 * force * random_.random()
    signal["frequency_hz"] = 0.2 + 3.0 * random_.random()
    signal["end_frequency_hz"] = 0.2 + 3.0 * random_.random()
    return LiveSet(values, signal)


class People:
    """Requests that change the set point at given ticks, or later, and then finish the run."""

    def __init__(
        self, rows: ring.RingWriter, sets: Sequence[tuple[int, tuple[float, ...]]], last: int
    ) -> None:
        self._rows, self._sets, self._last = rows, sets, last
        self.taken: list[tuple[int, tuple[float, ...]]] = []
        self.request = NO_REQUEST

    def read(self) -> Request:
        head = self._rows.head
        number = len(self.taken)
        if number < len(self._sets) and self._sets[number][0] <= head:
            self.taken.append((head, self._sets[number][1]))
            self.request = self.request._replace(live=number + 1)
        elif self.request.jump == 0 and number == len(self._sets) and head >= self._end():
            self.finished_at = head
            self.request = self.request._replace(jump=1, segment=self._last)
        return self.request

    def _end(self) -> int:
        return self.taken[-1][0] + 500

    def live_numbers(self, number: int) -> Sequence[float]:
        return self.taken[number - 1][1]


def execute(
    rig: ManualRig, sets: Sequence[tuple[int, tuple[float, ...]]], *, code_at: int | None
) -> tuple[np.ndarray[Any, Any], People]:
    """Return the rows of a run whose code appears after ``code_at`` ticks, or never."""
    task, mode = rig.task, rig.mode
    module = importlib.import_module(mode.device_module)
    devices = module.connect(mode.devices | {"compiled": False}, task.dt)
    fd = ring.create(task.kind.row_type, CAPACITY)
    rows = ring.RingWriter(fd, task.kind.row_type, wait=False)
    people = People(rows, sets, len(task.params.segments.row) - 1)
    with pytest.MonkeyPatch.context() as patch:
        for each in (coupled_ticks, tick):
            patch.setattr(each, "TICKS_BETWEEN_LOOKS", 1)
            patch.setattr(each, "exists", lambda _: rows.head >= (code_at or 0))
        end = loop.run(
            task.kind, task.params, devices, VirtualClock(task.dt), rows, people, lambda: 0,
            measure_work=False, code=rig.code if code_at is not None else None,
            couple=devices.coupling if mode.coupled and code_at is not None else None,
        )  # fmt: skip
    assert end.reason == Reason.PLAN_END, task.kind.reason_table.name(end.reason)
    assert (end.compiled_from >= 0) is (code_at is not None)
    packed = ring.RingReader(fd).remaining_rows()
    return np.frombuffer(packed, row_dtype(leaves(task.kind.row_type))), people


def run_by_chance(
    rig: ManualRig, count: int, seed: int, spacing: int = MAX_SPACING
) -> tuple[np.ndarray[Any, Any], People]:
    """Return the rows of a run with set points by chance until it is finished.

    Every set point is in force from the tick in which it was taken up, nothing stops the run, and
    interpreted rows and those of a change-over are the same to the bit.
    """
    random_ = random.Random(seed)
    at, sets = 0, []
    first = 200 + sum(
        rig.task.params.segments.ticks[: rig.task.params.segments.phase.index(MANUAL)]
    )
    for _ in range(count):
        at += random_.randint(1, spacing)
        sets.append((first + at, random_.choice(rig.pool)))
    compiled, people = execute(rig, sets, code_at=0)
    assert len(people.taken) == count
    assert len(np.unique(compiled["plan.live"])) == count + 1
    for number, (tick_, _) in enumerate(people.taken, 1):
        assert compiled["plan.live"][tick_] == number
        assert compiled["plan.live"][tick_ - 1] == number - 1
    manual = compiled["plan.phase"] == MANUAL
    running = manual & (compiled["safety.mode"] == RUN)
    assert running.sum() >= people.taken[-1][0] - people.taken[0][0]
    before_the_end = compiled[: people.finished_at]
    assert not before_the_end["safety.reason"].any()
    assert compiled["plan.phase"][-1] == DONE
    # The chunks of compiled ticks, between which requests are read, are then the same, too.
    for code_at in (None, people.taken[count // 2][0]):
        other, _ = execute(rig, people.taken, code_at=code_at)
        # The order to finish is read at another tick, so the ends differ.
        ticks = people.taken[-1][0] + 400
        assert compiled[:ticks].tobytes() == other[:ticks].tobytes()
    return before_the_end, people
