"""Open-loop replay of a run: today's cycle processes the logged senses; its rows are compared.

The cycle is pure, so the same senses must give the same commands and modes to the last bit. Where
they do not, code or configuration have changed. The replay does not simulate the body: a changed
command does not change the senses, which stay those of the log.

The cycle runs compiled where the code of the tick is in the cache, with the same bits.

Requests are in the rows, and set points that people chose in the run's journal; the replay gives
both to the cycle. Older runs did not log requests: where their safety machine reached a mode that
only a request leads to, the replay gives the cycle that request.
"""

import ctypes
import itertools
import os
import struct
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from rig.compilation.tick_source import tick_source
from rig.kinds import registry
from rig.people.attendance import attendance, attended
from rig.processes.run_types import RecordedTask
from rig.realtime import cycle, requests, safety, tick_memory
from rig.realtime.compiled_tick import is_complete, load_at_once
from rig.realtime.requests import NO_REQUEST
from rig.realtime.tick import CompiledTick, InterpretedTick, Tick
from rig.recording import row_layout
from rig.recording.journal import JOURNAL, read_journal
from rig.recording.runs import RunError, RunInfo, reader
from rig.recording.runs.mcap_file import Records, row_dtype
from rig.recording.runs.reader import stage_info

_INPUT_FIELDS = ("tick", "time", "timing", "tick_end")
_TIMING_FIELDS = ("timing.lateness", "timing.work", "timing.skipped")
_SAFETY_FIELDS = ("safety.mode", "safety.reason")
_REQUEST_FIELDS = tuple(f"plan.request.{name}" for name in requests.Request._fields)
_REQUEST_CODES = {
    "STOP": safety.REQUEST_STOP,
    "ABORT": safety.REQUEST_ABORT,
    "HOLD": safety.REQUEST_HOLD,
    "RESUME": safety.REQUEST_RESUME,
    "LOGGER_LOST": safety.REQUEST_LOGGER_LOST,
    "SUPERVISOR_LOST": safety.REQUEST_SUPERVISOR_LOST,
    "NO_OPERATOR": safety.REQUEST_NO_OPERATOR,
}
_REQUEST_NAMES = {code: name for name, code in _REQUEST_CODES.items()}
ProgressCallback = Callable[[int], None]


class _ReplayTarget(NamedTuple):
    """A recorded task, and the fields of its rows that are inputs of the cycle."""

    task: RecordedTask
    tick: str  # package of the kind's tick
    live: dict[int, Sequence[float]]  # numbers of the set points that people chose, by number
    sense: Any  # NamedTuple type of the sense
    row_prefixes: dict[str, str]  # by field of the sense

    def sense_fields(self) -> list[str]:
        """Return the row fields that make up a sense, in its order."""
        names = []
        for leaf in row_layout.leaves(self.sense):
            first, *rest = leaf.path
            names.append(".".join([self.row_prefixes[first], *rest]))
        return names

    def is_input(self, name: str) -> bool:
        """Return whether a row field is an input of the cycle, not a result."""
        prefixes = tuple(f"{each}." for each in (*_INPUT_FIELDS, *self.row_prefixes.values()))
        return name in (*_INPUT_FIELDS, *_REQUEST_FIELDS) or name.startswith(prefixes)


class Difference(NamedTuple):
    """A field whose replayed values differ from the logged ones."""

    field: str
    unit: str
    ticks: int  # number of differing ticks
    first: int  # first differing tick
    logged: float  # value in that tick
    replayed: float  # value in that tick
    largest: float  # largest difference; NaN where one of the two values is NaN


class LoggedRequest(NamedTuple):
    """A request in the log, or that its modes imply."""

    tick: int
    name: str


class ReplayReport(NamedTuple):
    """The comparison of a run with its replay."""

    run: str
    ticks: int
    fields: int  # number of compared fields
    differences: tuple[Difference, ...]  # the earliest first; empty: no difference
    requests: tuple[LoggedRequest, ...]
    absent: tuple[str, ...]  # fields of today's rows that the run does not have
    finished: bool  # False: the logger did not end the record; lost last rows are not compared
    notice: str = ""  # how the law of today differs from that of the run; empty: it does not
    compiled: bool = False  # whether the cycle ran compiled

    @property
    def identical(self) -> bool:
        """Whether no field differs."""
        return not self.differences


def replay(
    run: str | os.PathLike[str],
    on_progress: ProgressCallback = lambda ticks: None,
    *,
    interpreted: bool = False,
) -> ReplayReport:
    """Replay every tick of a run with today's cycle and return the comparison.

    ``on_progress`` is called with the number of ticks replayed so far. ``interpreted``: do not use
    compiled code. Raises RunError for a run
    that cannot be replayed: its configuration is not valid today, it has no tick or not the first
    one, ticks are missing from the log, or a sense was not logged.
    """
    source = reader.open_files(run)
    names = [leaf.name for leaf in source.leaves]
    comparison, requests, compiled = _Comparison(), list[LoggedRequest](), list[bool]()
    done = 0
    for stage in source.stages:  # each began with the state of a new run
        run_facts = stage_info(run, stage)
        target = _load_target(run_facts)
        fields = (*target.sense_fields(), *_TIMING_FIELDS, *_SAFETY_FIELDS)
        if absent_senses := [name for name in fields if name not in names]:
            raise RunError(f"{run_facts.run}: it did not log {', '.join(absent_senses)}")
        today = row_layout.leaves(target.task.kind.row_type)
        compared = [leaf for leaf in today if leaf.name in names and not target.is_input(leaf.name)]
        cycle_replay = _CycleReplay(target, run_facts.run, interpreted=interpreted)
        for block in reader.stage_blocks(stage):
            comparison.add(compared, block, cycle_replay.replay_block(block), stage.first_tick)
            done += len(block)
            on_progress(done)
        requests += [
            request._replace(tick=stage.first_tick + request.tick)
            for request in cycle_replay.requests
        ]
        compiled.append(cycle_replay.compiled)
    if not done:
        raise RunError(f"{run_facts.run}: it logged no tick")
    inputs = (*_REQUEST_FIELDS, "plan.live")  # of older runs: found by their modes, and 0
    absent = tuple(
        leaf.name for leaf in today if leaf.name not in names and leaf.name not in inputs
    )
    return ReplayReport(
        run_facts.run,
        done,
        len(compared),
        comparison.differences(),
        tuple(requests),
        absent,
        all(contents.finished for contents in source.contents),
        target.task.notice,
        all(compiled),
    )


class _Rows:
    """The rows of a block of ticks, as a `rig.realtime.tick.RowSink`."""

    def __init__(self, row_type: Any) -> None:
        self._pack = row_layout.packer(row_type)
        self._dtype = row_dtype(row_layout.leaves(row_type))

    def begin(self, rows: int) -> None:
        """Take the rows of a new block."""
        self._packed, self._end = bytearray(self._dtype.itemsize * rows), 0

    def put(self, row: Any) -> None:
        self._pack(self._packed, self._end, row)
        self.publish()

    def reserve(self, max_rows: int = 1) -> tuple[int, int]:
        place = ctypes.c_char.from_buffer(self._packed, self._end)
        return ctypes.addressof(place), 1

    def publish(self, count: int = 1) -> None:
        self._end += count * self._dtype.itemsize

    def finish(self) -> None:
        """Do nothing: blocks end with their last row."""

    def records(self) -> Records:
        """Return the rows of the block."""
        return np.frombuffer(self._packed, self._dtype)


def _compiled_tick(target: _ReplayTarget, rows: _Rows) -> CompiledTick | None:
    """Return the compiled tick; None if there is no code of it that can be used here."""
    task = target.task
    try:
        folder = tick_source(target.tick, task.law, task.params, task.dt, task.kind).folder
        if not is_complete(folder):
            return None
        state = cycle.start(task.kind, task.params, 0)
        memory = tick_memory.of_kind(task.kind, task.params, state, task.dt)
        code = load_at_once(folder, memory)
    except (OSError, TypeError, ValueError, struct.error):
        return None
    return CompiledTick(memory, code, task.dt, rows, state.safety.mode)


class _CycleReplay:
    """The cycle and its state, stepped through blocks of logged ticks."""

    def __init__(self, target: _ReplayTarget, run: str, *, interpreted: bool) -> None:
        task, self._run = target.task, run
        self._rows = _Rows(task.kind.row_type)
        found = None if interpreted else _compiled_tick(target, self._rows)
        self.compiled = found is not None
        self._tick: Tick = found or InterpretedTick(task.kind, task.params, task.dt, self._rows)
        self._fields = target.sense_fields()
        self._sense = target.sense
        kinds: list[Any] = list(target.sense.__annotations__.values())
        self._parts = [(kind, len(kind._fields)) for kind in kinds]
        self._next = self._skipped = 0
        self._live = target.live
        self._request = NO_REQUEST
        self.requests: list[LoggedRequest] = []

    def replay_block(self, block: Records) -> Records:
        """Return the rows that today's cycle gives for these ticks."""
        self._rows.begin(len(block))
        are_logged = set(_REQUEST_FIELDS) <= set(block.dtype.names or ())
        logged_requests = _read_requests(block) if are_logged else itertools.repeat(None)
        inputs = zip(self._read_inputs(block), logged_requests, strict=False)
        for (tick, timing, sense, logged), request in inputs:
            skipped = timing.skipped - self._skipped
            if tick != self._next + skipped:
                raise RunError(
                    f"{self._run}: tick {self._next} is not in the log; the ticks after it cannot "
                    "be replayed"
                )
            self._next, self._skipped = tick + 1, timing.skipped
            if request is None:
                self._replay_tick(tick, timing, sense, logged, 1 + skipped)
            else:
                self._follow(request, tick)
                self._tick.step(sense, request, tick, timing, 1 + skipped)
                self._tick.log()
        return self._rows.records()

    def _follow(self, request: requests.Request, tick: int) -> None:
        """Note a new request, and store the set point that it puts in force."""
        if request == self._request:
            return
        if request.code not in (self._request.code, safety.REQUEST_NONE):
            self.requests.append(LoggedRequest(tick, _REQUEST_NAMES[request.code]))
        if request.live not in (self._request.live, 0):
            if request.live not in self._live:
                raise RunError(
                    f"{self._run}: {JOURNAL} does not have set point {request.live} of tick {tick}"
                )
            self._tick.set_live(request.live, self._live[request.live])
        self._request = request

    def _replay_tick(
        self, tick: int, timing: cycle.Timing, sense: Any, logged: tuple[int, int], periods: int
    ) -> None:
        """Add one row. Where only a request explains the logged mode and reason, apply it."""
        before = self._tick.save()

        def explains(code: int) -> bool:
            self._tick.restore(before)
            self._tick.step(sense, NO_REQUEST._replace(code=code), tick, timing, periods)
            return (self._tick.mode, self._tick.reason) == logged

        if not explains(safety.REQUEST_NONE):
            for name, code in _REQUEST_CODES.items():
                if explains(code):
                    self.requests.append(LoggedRequest(tick, name))
                    break
            else:
                explains(safety.REQUEST_NONE)
        self._tick.log()

    def _read_inputs(
        self, block: Records
    ) -> Iterator[tuple[int, cycle.Timing, Any, tuple[int, int]]]:
        """Yield tick, timing, sense, and logged mode and reason of each tick of a block."""
        columns = [block[name].tolist() for name in self._fields]
        ticks = block["tick"].tolist()
        timings = zip(*(block[name].tolist() for name in _TIMING_FIELDS), strict=True)
        logged = zip(*(block[name].tolist() for name in _SAFETY_FIELDS), strict=True)
        for tick, timing, mode_and_reason, values in zip(
            ticks, timings, logged, zip(*columns, strict=True), strict=True
        ):
            parts, at = [], 0
            for kind, length in self._parts:
                parts.append(kind(*values[at : at + length]))
                at += length
            yield tick, cycle.Timing(*timing), self._sense(*parts), mode_and_reason


def _read_requests(block: Records) -> Iterator[requests.Request]:
    """Yield the request of each tick of a block; one object as long as it does not change."""
    last = NO_REQUEST
    for values in zip(*(block[name].tolist() for name in _REQUEST_FIELDS), strict=True):
        if values != last:
            last = requests.Request(*values)
        yield last


class _Comparison:
    """The differences by field, collected block by block."""

    def __init__(self) -> None:
        self._differences: dict[str, Difference] = {}

    def add(
        self, leaves: list[row_layout.Leaf], logged: Records, replayed: Records, first_tick: int
    ) -> None:
        """Compare the leaves of a block of ticks, counted from ``first_tick``; NaN equals NaN."""
        for leaf in leaves:
            one, other = logged[leaf.name], replayed[leaf.name]
            differs = (one != other) & ~(np.isnan(one) & np.isnan(other))
            at = np.flatnonzero(differs)
            if len(at) == 0:
                continue
            size = float(np.abs(one[at].astype(float) - other[at]).max())
            i = at[0]
            first = Difference(
                leaf.name,
                leaf.unit,
                0,
                first_tick + int(logged["tick"][i]),
                float(one[i]),
                float(other[i]),
                size,
            )
            before = self._differences.get(leaf.name, first)
            largest = float(np.maximum(before.largest, size))
            self._differences[leaf.name] = before._replace(
                ticks=before.ticks + len(at), largest=largest
            )

    def differences(self) -> tuple[Difference, ...]:
        """Return all differences, the earliest first; those of one tick in the row's order."""
        return tuple(sorted(self._differences.values(), key=lambda difference: difference.first))


def _load_target(run_facts: RunInfo) -> _ReplayTarget:
    """Return the task that today's code builds from the configuration of a run."""
    try:
        kind = registry.find(run_facts.kind)
        task: RecordedTask = kind.room("recorded").recorded_task(run_facts)
    except registry.KindError as error:
        raise RunError(f"{run_facts.run}: {error}") from None
    except KeyError as error:
        raise RunError(f"{run_facts.run}: its record holds no configuration ({error})") from None
    except ValueError as error:
        text = f"{run_facts.run}: its configuration is not valid today: {error}"
        raise RunError(text) from None
    tick = kind.room("tick")
    sense = tick.Sense if task.sense is None else task.sense
    renamed = tick.SENSE_IN_ROW if task.sense_in_row is None else task.sense_in_row
    prefixes = {name: renamed.get(name, name) for name in sense._fields}
    task = task._replace(params=attended(task.params, attendance(run_facts.plan)))
    entries = read_journal(run_facts.journal)
    live = {entry.number: entry.numbers for entry in entries if entry.accepted and entry.number}
    return _ReplayTarget(task, tick.__name__, live, sense, prefixes)
