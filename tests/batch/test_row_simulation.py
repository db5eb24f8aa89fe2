"""Windows of a simulated campaign from blocks of rows, and the code that a sweep ticks with."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from both_ways import open_simulator
from rehearsing import write_campaign

from rig.compilation import loaded_code, tick_code
from rig.emulation.row_simulation import RowBlock, RowSimulation, Stored
from rig.kinds.rig_file import kind_of_task
from rig.kinds.wavebot.tick import KIND, WaveBotRow
from rig.processes.tick_compiler import compile_job, source_of
from rig.realtime import object_code
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.reasons import Reason
from rig.realtime.requests import NO_REQUEST
from rig.realtime.safety import RUN, STOP_0
from rig.realtime.sequence import MEASURE, SETTLE, Segments
from rig.recording.row_layout import leaves
from rig.recording.runs.windows import REQUIRED_FIELDS

NAMES = [leaf.name for leaf in leaves(WaveBotRow)]
PLACES = {name: NAMES.index(name) for name in (*REQUIRED_FIELDS, "heave.estimate.position")}
INTEGERS = {leaf.name for leaf in leaves(WaveBotRow) if leaf.code == "q"}


class ScriptedTicks:
    """Ticks whose rows are given as (phase, plan row, reason); power goes with a reason."""

    def __init__(self, rows: list[tuple[int, int, int]], block: RowBlock) -> None:
        self._rows, self._block, self.mode, self.reason = rows, block, RUN, 0

    def execute(self, tick: int, request: int, max_ticks: int) -> int:
        space = 1 if self.mode == STOP_0 else min(max_ticks, len(self._block.numbers))
        count = 0
        for at in range(tick, min(tick + space, len(self._rows))):
            phase, row, self.reason = self._rows[at]
            self.mode = STOP_0 if self.reason else RUN
            line = self._block.numbers[at - tick]
            given = {"tick": at, "plan.phase": phase, "plan.row": row, "safety.reason": self.reason}
            for name, place in PLACES.items():
                value = given.get(name, 0)
                line[place : place + 1].view(np.int64 if name in INTEGERS else float)[:] = value
            line[PLACES["heave.estimate.position"]] = 0.5 * at
            count += 1
            if self.mode == STOP_0:
                break
        return count


def windows(*stretches: tuple[int, int, int, int]) -> Iterator[tuple[int, list[int], str]]:
    """Yield row, ticks and reason of each window for stretches (ticks, phase, row, reason)."""
    rows = [each[1:] for each in stretches for _ in range(each[0])]
    rows += [rows[-1]] * LINGER_TICKS
    block = RowBlock(WaveBotRow)
    ticks: Any = ScriptedTicks(rows, block)
    segments: Any = [Segments._field_defaults]
    segments = Segments(*((0,) * len(stretches) for _ in Segments._fields))._replace(
        phase=tuple(each[1] for each in stretches), ticks=tuple(each[0] for each in stretches)
    )
    simulation = RowSimulation(
        ticks, block, Stored.of_row(WaveBotRow, PLACES), segments, 0.001, KIND.reason_table,
        lambda: None,
    )  # fmt: skip
    for window in simulation:
        numbers = window.data["tick"].tolist()
        assert window.data["heave.estimate.position"].tolist() == [0.5 * n for n in numbers]
        yield window.row, [numbers[0], numbers[-1], len(numbers)], window.incomplete_reason


BLOCK = len(RowBlock(WaveBotRow).numbers)
END, TRIP = int(Reason.PLAN_END), int(Reason.ENCODER_JUMP)
SHORT = BLOCK // 8


@pytest.mark.parametrize("length", [1, SHORT, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 7])
def test_windows_of_any_length_are_found(length: int) -> None:
    """They begin and end anywhere in a block, and at its edges."""
    for before in (1, BLOCK - length % BLOCK, BLOCK):
        found = list(windows(
            (before, SETTLE, 0, 0), (length, MEASURE, 0, 0), (length, MEASURE, 1, 0),
            (5, SETTLE, 2, 0), (length, MEASURE, 2, 0), (1, SETTLE, 2, END),
        ))  # fmt: skip
        first, second, third = before, before + length, before + 2 * length + 5
        assert found == [
            (0, [first, first + length - 1, length], ""),
            (1, [second, second + length - 1, length], ""),
            (2, [third, third + length - 1, length], ""),
        ]


def test_a_trip_makes_its_own_window_incomplete_and_no_other() -> None:
    """All of it is in one block: the windows are read when the trip has already happened."""
    trip = "run stopped: ENCODER_JUMP"
    in_window = windows((9, SETTLE, 0, 0), (SHORT, MEASURE, 0, 0), (9, SETTLE, 1, 0),
                        (SHORT, MEASURE, 1, 0), (1, SETTLE, 1, TRIP))  # fmt: skip
    assert [reason for _, _, reason in in_window] == ["", trip]
    after_window = windows((9, SETTLE, 0, 0), (SHORT, MEASURE, 0, 0), (9, SETTLE, 1, 0),
                           (1, SETTLE, 1, TRIP))  # fmt: skip
    assert [reason for _, _, reason in after_window] == [""]
    measuring_to_the_end = windows((9, SETTLE, 0, 0), (SHORT, MEASURE, 0, 0), (1, MEASURE, 0, TRIP))
    assert [reason for _, _, reason in measuring_to_the_end] == [trip]


# --- code


@pytest.fixture(name="path")
def of_path(tmp_path: Path) -> Path:
    """Return a campaign of one row."""
    return write_campaign(
        tmp_path,
        sea={"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
        timing={"settle_s": 1, "interval_s": 5.5},
        matrix={"list": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}]},
    )


def heave(simulator: Any, plan: Any) -> Any:
    (window,) = (window.data.copy() for window in simulator.simulate(plan))
    return window["heave.estimate.position"]


def test_a_sweep_ticks_with_the_code_of_a_rehearsal(path: Path) -> None:
    simulator, _ = open_simulator(path)
    tasks = kind_of_task(path).room("tasks")
    report = tasks.examine(path, None, predict=False)
    task = tasks.execution_task(report.checked, report.plan)
    mode = tasks.rehearsal_mode(report.checked, real_clock=False)
    rehearsed = source_of(task.tick, compile_job(task, mode))
    assert simulator.source.folder == rehearsed.folder


@pytest.mark.slow  # if the loop is not compiled yet
def test_other_threads_run_during_a_call_of_the_code(
    path: Path,
) -> None:
    """Python itself would not interrupt the thread that calls for ten seconds."""
    interval = sys.getswitchinterval()
    simulator, plan = open_simulator(path)
    block = RowBlock(WaveBotRow)
    block.numbers = np.empty((5000, block.numbers.shape[1]))
    ticks = simulator.ticks(plan, block)
    block.reserve = lambda max_rows=1: (block.numbers.ctypes.data, max_rows)  # type: ignore[method-assign]
    steps, ended = 0, threading.Event()

    def count() -> None:
        nonlocal steps
        while not ended.is_set():
            steps += 1
            time.sleep(0)  # lets the other thread run

    counter = threading.Thread(target=count)
    sys.setswitchinterval(10.0)
    try:
        counter.start()
        during, tick = [], 0
        while tick < 5000:
            before = steps
            tick += ticks.execute(tick, NO_REQUEST, 5000 - tick)
            during.append(steps - before)
    finally:
        ended.set()
        sys.setswitchinterval(interval)
    counter.join()
    assert max(during) > 0


@pytest.mark.slow  # if the loop is not compiled yet
def test_on_another_processor_the_compiler_links_the_code(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulator, plan = open_simulator(path)
    expected = heave(simulator, plan)
    monkeypatch.setattr(loaded_code, "_loaded", {})
    monkeypatch.setattr(object_code, "is_supported", lambda: False)
    other, plan = open_simulator(path)
    assert np.array_equal(heave(other, plan), expected)
    (code,) = loaded_code._loaded.values()
    assert isinstance(code, tick_code.LinkedByCompiler)


@pytest.mark.long  # it compiles
def test_a_cache_that_cannot_be_written_costs_only_time(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulator, plan = open_simulator(path)
    expected = heave(simulator, plan)
    monkeypatch.setattr(loaded_code, "_loaded", {})
    (tmp_path / "file").write_text("in place of the folder of caches")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    other, plan = open_simulator(path)
    assert not other.is_compiled()
    assert np.array_equal(heave(other, plan), expected)
