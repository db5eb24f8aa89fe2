"""Cost of a compiled tick beside the interpreted one: in blocks, and in a loop at its real rate."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter_ns, process_time_ns
from typing import Any

from benchmarks.support.live_run import wait_realtime_free
from benchmarks.support.recorded import (
    ROOT,
    RecordedTicks,
    build_loop_parts,
    garbage_collection_off,
    record_ticks,
    write_campaign_file,
)
from benchmarks.support.result import Result, figure
from benchmarks.support.tick_process import tick_source_of
from rig.compilation.tick_code import compile_tick
from rig.emulation.row_simulation import RowBlock
from rig.kinds.wavebot.tick import KIND
from rig.realtime import compiled_tick, cycle
from rig.realtime.requests import NO_REQUEST
from rig.realtime.tick import CompiledTick
from rig.realtime.tick_memory import TickMemory, of_kind
from rig.recording.row_layout import layout, packer

MIN_RATIO = 20.0
MODULE = "benchmarks.support.tick_process"
MAX_P50_US, MAX_P999_US = 10.0, 40.0  # of a compiled cycle in a loop at its real rate
_NO_TIMING = cycle.Timing(0.0, 0.0, 0)


class OneRow(RowBlock):
    """The place of one row, to which every tick writes."""

    def __init__(self, row_type: type) -> None:
        super().__init__(row_type)
        self._place = super().reserve()  # looked up once: a ring's place costs no more

    def reserve(self, max_rows: int = 1) -> tuple[int, int]:
        return self._place

    def content(self) -> bytes:
        """Return the bytes of the row."""
        return self.numbers[0].tobytes()


class CompiledBlocks:
    """The compiled tick on recorded readings, and each of its parts alone."""

    def __init__(self, recorded: RecordedTicks, folder: Path) -> None:
        """``folder``: of the code."""
        self._recorded = recorded
        self._memory: TickMemory = of_kind(KIND, recorded.params, recorded.state, recorded.dt)
        began = perf_counter_ns()
        self._code: Any = compiled_tick.load_at_once(folder, self._memory)
        self.load_ms = (perf_counter_ns() - began) / 1e6
        self._row = OneRow(KIND.row_type)
        self._tick = CompiledTick(
            self._memory, self._code, recorded.dt, self._row, recorded.state.safety.mode
        )

    def differing(self) -> int:
        """Return the number of recorded rows that the compiled tick does not repeat to the bit."""
        recorded, found = self._recorded, 0
        expected, pack = bytearray(layout(KIND.row_type).size), packer(KIND.row_type)
        self._memory.set_state(recorded.state)
        for i, (sense, logged) in enumerate(zip(recorded.senses, recorded.rows, strict=True)):
            self._tick.step(sense, NO_REQUEST, recorded.first + i, _NO_TIMING, 1)
            pack(expected, 0, logged)
            found += expected != self._row.content()
        return found

    def whole(self) -> float:
        """Return the processor time (us) of a tick, readings and command as NamedTuples."""
        recorded, step = self._recorded, self._tick.step
        self._memory.set_state(recorded.state)
        began = process_time_ns()
        for tick, sense in enumerate(recorded.senses, recorded.first):
            step(sense, NO_REQUEST, tick, _NO_TIMING, 1)
        return (process_time_ns() - began) / 1e3 / len(recorded.senses)

    def parts(self) -> dict[str, float]:
        """Return the processor time (us) of a tick in place, and of each part of the others."""
        memory, sense = self._memory, self._recorded.senses[-1]
        repeat = range(len(self._recorded.senses))
        found = {}
        for name, part, arguments in (
            (
                "readings and command in place",
                self._tick.step_in_place,
                (NO_REQUEST, 1, _NO_TIMING, 1),
            ),
            ("of that, call and work", self._code, ()),
            ("readings of a NamedTuple stored", memory.setter("sense"), (sense,)),
            ("command returned as a NamedTuple", memory.getter("command"), ()),
        ):
            began = process_time_ns()
            for _ in repeat:
                part(*arguments)
            found[name] = (process_time_ns() - began) / 1e3 / len(repeat)
        return found


def interpreted(recorded: RecordedTicks) -> float:
    """Return the processor time (us) of an interpreted tick with its row packed."""
    step, pack = cycle.make(KIND), packer(KIND.row_type)
    params, state, dt = recorded.params, recorded.state, recorded.dt
    row_bytes = bytearray(layout(KIND.row_type).size)
    began = process_time_ns()
    for tick, sense in enumerate(recorded.senses, recorded.first):
        state, _, row = step(params, state, sense, NO_REQUEST, tick, _NO_TIMING, 1, dt)
        pack(row_bytes, 0, row)
    return (process_time_ns() - began) / 1e3 / len(recorded.senses)


def compile_ticks(campaign: Path) -> Path:
    """Return the folder with the code of a campaign's ticks, compiled if need be."""
    parts = build_loop_parts(campaign)
    return compile_tick(tick_source_of(parts.params, parts.plan.dt))


def run_on_real_clock(campaign: Path, execution: str, seconds: float) -> dict[str, Any]:
    """Time the parts of a loop at its real rate: the cycle follows a sleep, with cold caches."""
    wait_realtime_free()
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "benchmarks.support.tick_process",
            campaign,
            execution,
            str(seconds),
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def measure(short: bool) -> Result:
    """Interpreted and compiled ticks of a WaveBot in alternating blocks, with the row stored."""
    ticks, blocks, seconds, loops = (2000, 6, 2.0, 1) if short else (10_000, 20, 10.0, 5)
    executions = ("interpreted", "compiled")
    with tempfile.TemporaryDirectory() as scratch:
        path = write_campaign_file(Path(scratch), 60.0)
        recorded = record_ticks(path, ticks)
        compiled = CompiledBlocks(recorded, compile_ticks(path))
        real = {execution: list[dict[str, Any]]() for execution in executions}
        for _ in range(loops):
            for execution in executions:
                real[execution].append(run_on_real_clock(path, execution, seconds))
    if differing := compiled.differing():
        raise RuntimeError(f"{differing} rows differ between the two executions")
    plain, whole, parts = [], [], []
    with garbage_collection_off():
        for _ in range(blocks):
            plain.append(interpreted(recorded))
            whole.append(compiled.whole())
            parts.append(compiled.parts())
    code = [each["of that, call and work"] for each in parts]
    return Result(
        "tick",
        "one tick of a WaveBot with its row in place, interpreted and compiled",
        f"{blocks} alternating blocks of {ticks} recorded ticks, whose rows are equal to the bit; "
        f"{loops} x {seconds:g} s of each on the real clock, alternating",
        (
            figure("interpreted", "us of processor", plain),
            figure("compiled, readings and command as NamedTuples", "us of processor", whole),
            figure("ratio of these two", "x", [a / b for a, b in zip(plain, whole, strict=True)]),
            *(
                figure(f"compiled: {name}", "us of processor", [each[name] for each in parts])
                for name in parts[0]
            ),
            figure(
                "ratio of interpreted to call and work",
                "x",
                [a / b for a, b in zip(plain, code, strict=True)],
                at_least=MIN_RATIO,
            ),
            figure("object code loaded in", "ms", [compiled.load_ms]),
            *(
                figure(
                    f"{execution}, in a loop at its real rate: {key}",
                    "us",
                    [each["us"]["cycle"][key] for each in real[execution]],
                    at_most=limit if execution == "compiled" else None,
                )
                for key, limit in (("p50", MAX_P50_US), ("p99", None), ("p99.9", MAX_P999_US))
                for execution in executions
            ),
        ),
        tuple(
            f"on the real clock not granted: {why}"
            for why in sorted({why for each in real["compiled"] for why in each["refused"]})
        ),
    )
