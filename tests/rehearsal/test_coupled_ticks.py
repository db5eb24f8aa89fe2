"""Ticks compiled together with the plant have the bits of an interpreted loop with its plant."""

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
from numpy.lib.recfunctions import repack_fields
from rehearsing import SilentView

from rig.compilation.tick_code import compile_tick
from rig.execution.task import run_task
from rig.kinds.rig_file import kind_of_task
from rig.processes.run_types import ExecutionMode, Task
from rig.processes.tick_compiler import compile_job, source_of
from rig.realtime import coupled_ticks, loop, safety
from rig.realtime.clock import VirtualClock
from rig.recording import ring
from rig.recording.row_layout import leaves
from rig.recording.runs import reader

WAVEBOT = ("cots", "custom", "open_loop")
NAMES = (*WAVEBOT, "modular", *MIN_MOTION)
CAPACITY = 16_384  # rows, more than any golden run has


class Rehearsal(NamedTuple):
    """A golden run as a rehearsal."""

    task: Task
    mode: ExecutionMode
    code: Path  # of its coupled ticks


@cache
def rehearsal(name: str, folder: Path) -> Rehearsal:
    path = make_campaign(folder) if name == "modular" else GOLDEN / f"{name}.yaml"
    tasks = kind_of_task(path).room("tasks")
    report = tasks.examine(path, predict=False)
    assert report.ok, report.text()
    task = tasks.execution_task(report.checked, report.plan)
    mode = tasks.rehearsal_mode(report.checked, real_clock=False)
    source = source_of(task.tick, compile_job(task, mode))
    assert source is not None
    return Rehearsal(task, mode, compile_tick(source))


@pytest.fixture(scope="module")
def open_rehearsal(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Rehearsal]:
    folder = tmp_path_factory.mktemp("modular")
    return lambda name: rehearsal(name, folder)


class Requests:
    """A mailbox whose message from a tick on is a request; it records that tick."""

    def __init__(self, rows: ring.RingWriter, planned: dict[int, int]) -> None:
        self._rows, self._planned = rows, planned
        self.request = 0
        self.taken: dict[int, int] = {}

    def read(self) -> Requests:
        tick = self._rows.head
        for planned in [each for each in self._planned if each <= tick]:
            self.request = self.taken[tick] = self._planned.pop(planned)
        return self


def execute(
    run: Rehearsal, requests: dict[int, int], *, coupled: bool
) -> tuple[bytes, loop.LoopResult, dict[int, int]]:
    """Return rows, end, and the ticks at which the requests were read."""
    task, mode = run.task, run.mode
    module = importlib.import_module(mode.device_module)
    connect = module.couple_devices if coupled else module.connect
    devices = connect(mode.devices, task.dt)
    fd = ring.create(task.kind.row_type, CAPACITY)
    rows = ring.RingWriter(fd, task.kind.row_type, wait=False)
    mailbox = Requests(rows, dict(requests))
    end = loop.run(
        task.kind, task.params, devices, VirtualClock(task.dt), rows, mailbox, lambda: 0,
        measure_work=False, code=run.code if coupled else None,
        couple=devices.coupling if coupled else None,
    )  # fmt: skip
    return ring.RingReader(fd).remaining_rows(), end, mailbox.taken


_INTERPRETED: dict[str, tuple[bytes, loop.LoopResult]] = {}


def interpreted(run: Rehearsal) -> tuple[bytes, loop.LoopResult]:
    """Return rows and end of the undisturbed run."""
    if run.task.name not in _INTERPRETED:
        _INTERPRETED[run.task.name] = execute(run, {}, coupled=False)[:2]
    return _INTERPRETED[run.task.name]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_changeover_at_any_tick_keeps_every_bit(
    name: str, open_rehearsal: Callable[[str], Rehearsal], monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the first tick on, and from three ticks chosen by chance."""
    run = open_rehearsal(name)
    expected, end = interpreted(run)
    assert (end.skipped, end.compiled_from) == (0, -1)
    choose = random.Random(name)
    monkeypatch.setattr(coupled_ticks, "TICKS_BETWEEN_LOOKS", 1)
    for first in (1, *(choose.randrange(2, end.ticks - 100) for _ in range(3))):
        looks = iter(range(1, end.ticks))
        monkeypatch.setattr(
            coupled_ticks, "is_complete", lambda _, n=looks, first=first: next(n) >= first
        )
        got, coupled_end, _ = execute(run, {}, coupled=True)
        assert coupled_end == end._replace(compiled_from=first)
        assert got == expected, first


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cots", "modular", "bench_velocity", "bench_flap"])
@pytest.mark.parametrize(
    "request_kind", [safety.REQUEST_STOP, safety.REQUEST_ABORT, safety.REQUEST_HOLD]
)
def test_a_request_acts_as_in_the_interpreted_loop(
    name: str, request_kind: int, open_rehearsal: Callable[[str], Rehearsal]
) -> None:
    """A request acts at the start of a chunk; held rows go on when the hold ends."""
    run = open_rehearsal(name)
    _, complete = interpreted(run)
    at = random.Random(f"{name} {request_kind}").randrange(
        complete.ticks // 2, complete.ticks - 300
    )
    planned = {at: request_kind}
    if request_kind == safety.REQUEST_HOLD:
        planned[at + 200] = safety.REQUEST_RESUME
    got, end, taken = execute(run, planned, coupled=True)
    assert len(taken) == len(planned)
    assert 0 <= min(taken) - at <= 50
    expected, same_end, _ = execute(run, taken, coupled=False)
    assert end._replace(compiled_from=-1) == same_end
    assert got == expected


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "axis", "field"),
    [
        ("cots", "heave", "heave.estimate.velocity"),
        ("modular", "pitch", "pitch.estimate.velocity"),
        ("bench_velocity", "motor", "motor.velocity"),
    ],
)
def test_a_trip_of_the_plant_is_the_same(
    name: str, axis: str, field: str, open_rehearsal: Callable[[str], Rehearsal]
) -> None:
    """An axis that may have half of its greatest velocity ends the run in the same tick."""
    run = open_rehearsal(name)
    names = [leaf.name for leaf in leaves(run.task.kind.row_type)]
    rows = np.frombuffer(interpreted(run)[0]).reshape(-1, len(names))
    greatest = float(np.abs(rows[:, names.index(field)]).max())
    task = run.task
    params = getattr(task.params.rig, axis)
    tight = params._replace(limits=params.limits._replace(velocity_stop=0.5 * greatest))
    rig = task.params.rig._replace(**{axis: tight})
    tripped = run._replace(task=task._replace(params=task.params._replace(rig=rig)))
    expected, end, _ = execute(tripped, {}, coupled=False)
    got, coupled_end, _ = execute(tripped, {}, coupled=True)
    assert "VELOCITY" in task.kind.reason_table.name(end.reason)
    assert coupled_end._replace(compiled_from=-1) == end
    assert got == expected


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
    assert rows == interpreted(run)[0]
