"""The executions of golden runs of every kind of rig have the same bits.

The reference is the interpreted loop with an interpreted plant. In the other execution the code
appears at a tick chosen by chance: from there on, the ticks of loop and plant are compiled together
(`coupled`), or the tick alone where the plant cannot be compiled with it (a hoist, an empty basin).
"""

from __future__ import annotations

import importlib
import json
import random
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from golden_bench import GOLDEN, MIN_MOTION
from golden_modular import make_campaign
from golden_runs import KINDS
from numpy.lib.recfunctions import repack_fields
from rehearsing import SilentView

from rig.compilation.tick_code import compile_tick
from rig.execution.task import run_task
from rig.kinds.rig_file import kind_of_task
from rig.processes.run_types import ExecutionMode, Task
from rig.processes.tick_compiler import compile_job, source_of
from rig.realtime import coupled_ticks, loop, safety, tick
from rig.realtime.clock import VirtualClock
from rig.realtime.requests import NO_REQUEST, Request
from rig.realtime.safety import ENABLING, OFF, RUN, STOP_0, STOP_1, STOP_2
from rig.realtime.sequence import Phase
from rig.recording import ring
from rig.recording.row_layout import leaves
from rig.recording.runs import reader

pytestmark = pytest.mark.sampled

NAMES = (*KINDS, "modular", *MIN_MOTION)
NOT_COUPLED = ("hoist", "calibration")
CAPACITY = 65_536  # rows, more than any golden run has
MAX_LOADING = 80  # ticks in which the code of a tick alone is loaded, a slice a tick


class Rehearsal(NamedTuple):
    """A golden run as a rehearsal."""

    task: Task
    mode: ExecutionMode
    code: Path  # of its ticks

    @property
    def coupled(self) -> bool:
        return self.mode.coupled


class Execution(NamedTuple):
    """Rows and end of an execution, and the ticks at which it read its requests."""

    rows: bytes
    end: loop.LoopResult
    taken: dict[int, int]


@cache
def rehearsal(name: str, folder: Path) -> Rehearsal:
    path = make_campaign(folder) if name == "modular" else GOLDEN / f"{name}.yaml"
    tasks = kind_of_task(path).room("tasks")
    report = tasks.examine(path, predict=False)
    assert report.ok, report.text()
    task = tasks.execution_task(report.checked, report.plan)
    mode = tasks.rehearsal_mode(report.checked, real_clock=False)
    assert mode.coupled is (name not in NOT_COUPLED)
    return Rehearsal(task, mode, compile_tick(source_of(task.tick, compile_job(task, mode))))


@pytest.fixture(scope="module")
def open_rehearsal(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Rehearsal]:
    folder = tmp_path_factory.mktemp("modular")
    return lambda name: rehearsal(name, folder)


class Requests:
    """A mailbox whose message from a tick on is a request; it records that tick."""

    def __init__(self, rows: ring.RingWriter, planned: dict[int, int]) -> None:
        self._rows, self._planned = rows, planned
        self.request = NO_REQUEST
        self.taken: dict[int, int] = {}

    def read(self) -> Request:
        tick = self._rows.head
        for planned in [each for each in self._planned if each <= tick]:
            code = self.taken[tick] = self._planned.pop(planned)
            self.request = NO_REQUEST._replace(code=code)
        return self.request

    def live_numbers(self, number: int) -> None:
        """Return None: people choose no set points."""


def execute(
    run: Rehearsal, requests: dict[int, int] | None = None, *, code_at: int | None = None
) -> Execution:
    """Execute a rehearsal in this process; its code appears after ``code_at`` ticks, or never."""
    task, mode = run.task, run.mode
    module = importlib.import_module(mode.device_module)
    called = code_at is not None and not run.coupled  # the plant, by a compiled tick
    devices = module.connect(mode.devices | {"compiled": called}, task.dt)
    fd = ring.create(task.kind.row_type, CAPACITY)
    rows = ring.RingWriter(fd, task.kind.row_type, wait=False)
    mailbox = Requests(rows, dict(requests or {}))
    with pytest.MonkeyPatch.context() as patch:
        for module in (coupled_ticks, tick):
            patch.setattr(module, "TICKS_BETWEEN_LOOKS", 1)
            patch.setattr(module, "exists", lambda _: rows.head >= (code_at or 0))
        end = loop.run(
            task.kind, task.params, devices, VirtualClock(task.dt), rows, mailbox, lambda: 0,
            measure_work=False, code=run.code if code_at is not None else None,
            couple=devices.coupling if run.coupled and code_at is not None else None,
        )  # fmt: skip
    return Execution(ring.RingReader(fd).remaining_rows(), end, mailbox.taken)


_INTERPRETED: dict[str, Execution] = {}


def interpreted(run: Rehearsal) -> Execution:
    """Return the undisturbed run."""
    if run.task.name not in _INTERPRETED:
        _INTERPRETED[run.task.name] = execute(run)
    return _INTERPRETED[run.task.name]


def assert_same_from(
    run: Rehearsal, code_at: int, expected: Execution, requests: dict[int, int] | None = None
) -> None:
    """Assert that the run is the expected one if its code appears after a number of ticks."""
    got = execute(run, requests, code_at=code_at)
    loading = got.end.compiled_from - code_at
    assert loading == 0 if run.coupled else 0 < loading < MAX_LOADING, (code_at, loading)
    assert got.end._replace(compiled_from=-1) == expected.end, code_at
    assert got.rows == expected.rows, code_at


def columns(run: Rehearsal, rows: bytes, *names: str) -> list[Any]:
    """Return fields of rows over the ticks."""
    row = leaves(run.task.kind.row_type)
    table = np.frombuffer(rows, np.dtype([(leaf.name, f"={leaf.code}") for leaf in row]))
    return [table[name] for name in names]


def stages(run: Rehearsal, rows: bytes) -> dict[tuple[int, int], Any]:
    """Return the ticks of each stage, a phase of the plan in a mode of the safety machine.

    These are the ticks after which a changeover may come: not the last ones before power is off.
    """
    phases, modes = columns(run, rows, "plan.phase", "safety.mode")
    end = np.flatnonzero(modes == STOP_0)[0] - (0 if run.coupled else MAX_LOADING)
    ticks = np.arange(1, end)
    found = sorted(set(zip(phases[ticks].tolist(), modes[ticks].tolist(), strict=True)))
    return {
        (phase, mode): ticks[(phases[ticks] == phase) & (modes[ticks] == mode)]
        for phase, mode in found
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("count", [0, pytest.param(50, marks=pytest.mark.long)])
def test_a_changeover_at_any_tick_keeps_every_bit(
    count: int, name: str, open_rehearsal: Callable[[str], Rehearsal]
) -> None:
    """From the first tick on, and from ``count`` ticks by chance, at least one of each stage.

    With ``count`` 0 that is 99 changeovers of all golden runs together.
    """
    run = open_rehearsal(name)
    expected = interpreted(run)
    assert (expected.end.skipped, expected.end.compiled_from) == (0, -1)
    found = stages(run, expected.rows)
    phases, modes = (set(each) for each in zip(*found, strict=True))
    if name != "calibration":  # without a device there is no power
        assert phases >= {Phase.TARE, Phase.SETTLE, Phase.MEASURE}
        assert modes == {OFF, ENABLING, RUN, STOP_1}
    choose = random.Random(f"{name} {count}")
    in_turn = [ticks for _ in range(-(-count // len(found)) or 1) for ticks in found.values()]
    for code_at in {1, *(int(choose.choice(ticks)) for ticks in in_turn)}:
        assert_same_from(run, code_at, expected)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cots", "custom", "modular", "bench_velocity", "bench_flap"])
@pytest.mark.parametrize(
    "request_kind",
    [
        safety.REQUEST_STOP,
        safety.REQUEST_ABORT,
        safety.REQUEST_HOLD,
        safety.REQUEST_LOGGER_LOST,
        safety.REQUEST_SUPERVISOR_LOST,
        safety.REQUEST_NO_OPERATOR,
    ],
)
def test_a_request_acts_as_in_the_interpreted_loop(
    name: str, request_kind: int, open_rehearsal: Callable[[str], Rehearsal]
) -> None:
    """A request acts at the start of a chunk; held rows go on when the hold ends.

    The run is compiled from its first tick on, or from the middle of the stop or hold.
    """
    run = open_rehearsal(name)
    complete = interpreted(run).end
    at = random.Random(f"{name} {request_kind}").randrange(
        complete.ticks // 2, complete.ticks - 300
    )
    planned = {at: request_kind}
    if request_kind == safety.REQUEST_HOLD:
        planned[at + 200] = safety.REQUEST_RESUME
    for code_at in (1, at + 1 if request_kind == safety.REQUEST_ABORT else at + 100):
        got = execute(run, planned, code_at=code_at)
        assert len(got.taken) == len(planned)
        assert 0 <= min(got.taken) - at <= 50
        expected = execute(run, got.taken)
        assert got.end._replace(compiled_from=-1) == expected.end
        assert got.rows == expected.rows
        (modes,) = columns(run, got.rows, "safety.mode")
        assert (STOP_2 in modes) is (request_kind == safety.REQUEST_HOLD)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "axis", "field"),
    [
        ("cots", "heave", "heave.estimate.velocity"),
        ("custom", "heave", "heave.estimate.velocity"),
        ("modular", "pitch", "pitch.estimate.velocity"),
        ("bench_velocity", "motor", "motor.velocity"),
        ("bench_flap", "motor", "motor.velocity"),
    ],
)
def test_a_trip_of_the_plant_is_the_same(
    name: str, axis: str, field: str, open_rehearsal: Callable[[str], Rehearsal]
) -> None:
    """An axis that may have half of the velocity of its rows ends the run in the same tick.

    The run is compiled from its first tick on, from the tick of the trip, the one after it, three
    ticks of the stop chosen by chance, its last tick, and the one that removes the power.
    """
    run = open_rehearsal(name)
    velocity, modes = columns(run, interpreted(run).rows, field, "safety.mode")
    task = run.task
    params = getattr(task.params.rig, axis)
    bound = 0.5 * float(np.abs(velocity[modes == RUN]).max())
    tight = params._replace(limits=params.limits._replace(velocity_stop=bound))
    rig = task.params.rig._replace(**{axis: tight})
    tripped = run._replace(task=task._replace(params=task.params._replace(rig=rig)))
    expected = execute(tripped)
    assert "VELOCITY" in task.kind.reason_table.name(expected.end.reason)
    (modes,) = columns(run, expected.rows, "safety.mode")
    stop = np.flatnonzero(modes == STOP_1).tolist()
    assert len(stop) >= 100
    by_chance = random.Random(name).sample(stop[2:-1], 3)
    for code_at in (1, *stop[:2], *by_chance, stop[-1], stop[-1] + 1):
        assert_same_from(tripped, code_at, expected)


@pytest.mark.slow
def test_a_run_is_coupled_from_its_first_ticks(
    tmp_path: Path, open_rehearsal: Callable[[str], Rehearsal]
) -> None:
    """By the processes of `rig run`, with the rows of the same run interpreted."""
    run = open_rehearsal("custom")
    ended = run_task(run.task, tmp_path, SilentView(), run.mode)
    status: dict[str, Any] = json.loads((ended.folder / "run.json").read_text())
    assert (status["status"], status["compiled_from"]) == ("complete", 1)
    assert not (ended.folder / "compiler.stderr").exists()
    blocks = reader.blocks(reader.open_files(ended.folder))
    names = [leaf.name for leaf in leaves(run.task.kind.row_type)]
    rows = b"".join(repack_fields(block[names]).tobytes() for block in blocks)
    assert rows == interpreted(run).rows
