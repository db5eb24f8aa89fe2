"""Loop and simulated plant compiled together, beside the interpreted loop."""

import importlib
import tempfile
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

from benchmarks.support.recorded import garbage_collection_off, write_campaign_file
from benchmarks.support.result import Result, figure
from rig.compilation.tick_code import compile_tick
from rig.kinds.rig_file import kind_of_task
from rig.processes.run_types import ExecutionMode, Task
from rig.processes.tick_compiler import compile_job, source_of
from rig.realtime import loop
from rig.realtime.clock import VirtualClock
from rig.realtime.requests import NO_REQUEST, Request
from rig.recording import ring

MIN_RATIO, MIN_TIMES_REAL = 15.0, 200.0


class Execution(NamedTuple):
    """One execution of a rehearsal's loop, with plant and ring, but without a logger."""

    ticks: int
    us: float  # of processor time, per tick
    rows: bytes  # the last ones, as many as the ring holds


class _Drain:
    """A mailbox without requests that empties the ring whenever it is read."""

    def __init__(self, fd: int) -> None:
        self._reader = ring.RingReader(fd)

    def read(self) -> Request:
        while self._reader.take():
            self._reader.commit()
        return NO_REQUEST

    def live_numbers(self, number: int) -> None:
        """Nobody chooses set points."""


def execute(task: Task, mode: ExecutionMode, code: Path | None) -> Execution:
    """Run the loop of a rehearsal; without ``code`` it is interpreted, its plant is compiled."""
    module = importlib.import_module(mode.device_module)
    devices: Any = module.connect(mode.devices | {"compiled": code is None}, task.dt)
    fd = ring.create(task.kind.row_type)
    rows, drain = ring.RingWriter(fd, task.kind.row_type, wait=True), _Drain(fd)
    with garbage_collection_off():
        began = process_time()
        end = loop.run(
            task.kind, task.params, devices, VirtualClock(task.dt), rows, drain, lambda: 0,
            measure_work=False, code=code, couple=devices.coupling if code else None,
        )  # fmt: skip
        used = process_time() - began
    return Execution(end.ticks, used / end.ticks * 1e6, ring.RingReader(fd).remaining_rows())


def measure(short: bool) -> Result:
    """Alternate both executions of one campaign."""
    seconds, repetitions = (20.0, 1) if short else (240.0, 5)
    with tempfile.TemporaryDirectory() as scratch:
        path = write_campaign_file(Path(scratch), seconds)
        tasks = kind_of_task(path).room("tasks")
        report = tasks.examine(path, predict=False)
        task = tasks.execution_task(report.checked, report.plan)
        mode = tasks.rehearsal_mode(report.checked, real_clock=False)
        source = source_of(task.tick, compile_job(task, mode))
        if source is None:
            raise RuntimeError(f"{mode.device_module} does not couple its plant")
        code = compile_tick(source)
        pairs = [(execute(task, mode, None), execute(task, mode, code)) for _ in range(repetitions)]
    interpreted, coupled = ([pair[i].us for pair in pairs] for i in (0, 1))
    times_real = [task.dt * 1e6 / us for us in coupled]
    ratios = [one / other for one, other in zip(interpreted, coupled, strict=True)]
    differing = sum(one.rows != other.rows for one, other in pairs)
    return Result(
        "coupled",
        "loop and plant of a rehearsal compiled together, beside the interpreted loop",
        f"{repetitions} runs of {pairs[0][0].ticks} ticks of each execution, alternating",
        (
            figure("interpreted loop, compiled plant", "us of processor a tick", interpreted),
            figure("loop and plant together", "us of processor a tick", coupled),
            figure("loop and plant together", "x real time", times_real, at_least=MIN_TIMES_REAL),
            figure("interpreted / together", "x", ratios, at_least=MIN_RATIO),
            figure("runs whose rows differ in a bit", "runs", float(differing), at_most=0.0),
        ),
        ("The ring is emptied in the same process: each figure has the time of reading rows.",),
    )
