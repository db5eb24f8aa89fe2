"""Cost of a compiled tick beside the interpreted one, part by part, in alternating blocks."""

import ctypes
import tempfile
from pathlib import Path
from time import perf_counter_ns, process_time_ns
from typing import Any

from benchmarks.support.recorded import (
    RecordedTicks,
    garbage_collection_off,
    record_ticks,
    write_campaign_file,
)
from benchmarks.support.result import Result, figure
from rig import laws
from rig.compilation.tick_code import compile_tick
from rig.compilation.tick_source import tick_source
from rig.kinds.wavebot.tick import KIND
from rig.realtime import compiled_tick, cycle
from rig.realtime.tick_memory import TickMemory, of_kind
from rig.recording.row_layout import layout, packer

MIN_RATIO = 20.0
_NO_TIMING = cycle.Timing(0.0, 0.0, 0)


class CompiledBlocks:
    """The compiled tick on recorded readings, and each of its parts alone."""

    def __init__(self, recorded: RecordedTicks) -> None:
        self._recorded = recorded
        law = laws.to_request(laws.own("impedance"))
        source = tick_source("rig.kinds.wavebot.tick", law, recorded.params, recorded.dt)
        self._memory: TickMemory = of_kind(KIND, recorded.params, recorded.state, recorded.dt)
        folder, began = compile_tick(source), perf_counter_ns()
        self._code: Any = compiled_tick.load_at_once(folder, self._memory)
        self.load_ms = (perf_counter_ns() - began) / 1e6
        self._row = bytearray(layout(KIND.row_type).size)
        self._address = ctypes.addressof(ctypes.c_char.from_buffer(self._row))

    def differing(self) -> int:
        """Return the number of recorded rows that the compiled tick does not repeat to the bit."""
        recorded, memory, found = self._recorded, self._memory, 0
        expected, pack = bytearray(len(self._row)), packer(KIND.row_type)
        memory.set_state(recorded.state)
        for i, (sense, row) in enumerate(zip(recorded.senses, recorded.rows, strict=True)):
            tick = recorded.first + i
            memory.set_header(0, tick, _NO_TIMING, 1, recorded.dt, self._address)
            memory.set_sense(sense)
            self._code()
            pack(expected, 0, row)
            found += expected != self._row
        return found

    def whole(self) -> float:
        """Return the processor time (us) of a tick, readings in and command out."""
        recorded, memory, code = self._recorded, self._memory, self._code
        memory.set_state(recorded.state)
        began = process_time_ns()
        for tick, sense in enumerate(recorded.senses, recorded.first):
            memory.set_header(0, tick, _NO_TIMING, 1, recorded.dt, self._address)
            memory.set_sense(sense)
            code()
            memory.command()
        return (process_time_ns() - began) / 1e3 / len(recorded.senses)

    def parts(self) -> dict[str, float]:
        """Return the processor time (us) of each part of a tick."""
        memory, dt, sense = self._memory, self._recorded.dt, self._recorded.senses[-1]
        repeat = range(len(self._recorded.senses))
        found = {}
        for name, part, arguments in (
            ("call and work", self._code, ()),
            ("header in", memory.set_header, (0, 1, _NO_TIMING, 1, dt, self._address)),
            ("readings in", memory.set_sense, (sense,)),
            ("command out", memory.command, ()),
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
        state, _, row = step(params, state, sense, 0, tick, _NO_TIMING, 1, dt)
        pack(row_bytes, 0, row)
    return (process_time_ns() - began) / 1e3 / len(recorded.senses)


def measure(short: bool) -> Result:
    """Interpreted and compiled ticks of a WaveBot in alternating blocks, with the row stored."""
    ticks, blocks = (2000, 6) if short else (10_000, 20)
    with tempfile.TemporaryDirectory() as scratch:
        recorded = record_ticks(write_campaign_file(Path(scratch), 60.0), ticks)
    compiled = CompiledBlocks(recorded)
    if differing := compiled.differing():
        raise RuntimeError(f"{differing} rows differ between the two executions")
    plain, whole, parts = [], [], []
    with garbage_collection_off():
        for _ in range(blocks):
            plain.append(interpreted(recorded))
            whole.append(compiled.whole())
            parts.append(compiled.parts())
    code = [each["call and work"] for each in parts]
    return Result(
        "tick",
        "one tick of a WaveBot with its row in place, interpreted and compiled",
        f"{blocks} alternating blocks of {ticks} recorded ticks, whose rows are equal to the bit",
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
        ),
    )
