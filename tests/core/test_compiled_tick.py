"""The compiled tick has the bits of the interpreted one, and what it cannot do it reports."""

from __future__ import annotations

import importlib
import inspect
import linecache
import math
import platform
import random
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import golden_bench
import pytest
from golden_runs import KINDS, record

from rig.compilation.cache_folder import code_folder
from rig.compilation.tick_code import CompilationError, compile_tick
from rig.compilation.tick_source import TickSource, all_of, dependencies, tick_source
from rig.execution import replay
from rig.realtime import (
    compiled_tick,
    coupled_ticks,
    cycle,
    object_code,
    safety,
    tick_memory,
)
from rig.realtime.clock import VirtualClock
from rig.realtime.devices import FlatDevices
from rig.realtime.object_code import ObjectCode, ObjectCodeError
from rig.realtime.requests import NO_REQUEST
from rig.realtime.tick import Changeover, CompiledTick, InterpretedTick
from rig.recording import ring
from rig.recording.runs import reader, run_info

TICKS_OF_LOADING = 100  # more than a changeover takes
UNDISTURBED_TICKS = {"cots": 300, "bench_instantaneous": 1900, "bench_flap": 1900}  # rows move then
Inputs = tuple[Any, int, int, cycle.Timing, int]  # of `Tick.step`


class Recorded(NamedTuple):
    """A recorded run as inputs of its ticks."""

    tick: str  # package of the kind's tick
    law: str  # as `find_kind` of it takes it
    kind: cycle.Kind
    params: cycle.Params
    dt: float
    inputs: tuple[Inputs, ...]


@cache
def recorded(kind: str) -> Recorded:
    """Return a golden run."""
    source = reader.open_files(record(kind))
    target = replay._load_target(run_info(record(kind), source.contents))
    task = target.task
    cycle_replay = replay._CycleReplay(target, kind, interpreted=True)
    inputs = tuple(
        (sense, NO_REQUEST, tick, timing, 1)
        for block in reader.blocks(source)
        for tick, timing, sense, _ in cycle_replay._read_inputs(block)
    )
    return Recorded(target.tick, task.law, task.kind, task.params, task.dt, inputs)


def source_of(run: Recorded) -> TickSource:
    return tick_source(run.tick, run.law, run.params, run.dt)


def code_of(run: Recorded) -> Path:
    return compile_tick(source_of(run))


def numbers(tree: Any) -> list[Any]:
    return [
        each for part in tree for each in (numbers(part) if isinstance(part, tuple) else [part])
    ]


class PlaceByPlace(FlatDevices):
    """Devices that store given readings in memory and keep the commands that they find there."""

    def __init__(self, run: Recorded) -> None:
        self.now: Any = None  # readings of the present tick
        self.commands: list[list[Any]] = []
        example, command = tick_memory.examples(run.kind, run.params, run.dt)
        super().__init__(type(example), type(command))

    def attach(self, sense: Any, command: Any) -> None:
        self._sense, self._command = sense, command

    def read_in_place(self, now: float) -> None:
        for put, part in zip(self._sense, self.now, strict=True):
            put(*numbers(part))

    def write_in_place(self) -> None:
        self.commands.append([number for get in self._command for number in get()])


class PreparedTicks(VirtualClock):
    """A clock that prepares every tick."""

    prepare: Callable[[], object] = staticmethod(lambda: None)

    def prepare_ticks(self, prepare: Callable[[], object]) -> None:
        self.prepare = prepare


def execute(run: Recorded, inputs: tuple[Inputs, ...]) -> Any:
    """Return rows, commands, last mode and reason of interpreted ticks."""
    fd = ring.create(run.kind.row_type, 8192)
    rows = ring.RingWriter(fd, run.kind.row_type, wait=False)
    tick, commands = InterpretedTick(run.kind, run.params, run.dt, rows), []
    for each in inputs:
        commands.append(numbers(tick.step(*each)))
        tick.log()
    return ring.RingReader(fd).remaining_rows(), commands, tick.mode, tick.reason


def execute_compiled(
    run: Recorded, inputs: tuple[Inputs, ...], start: int, *, prepared: bool = True
) -> Any:
    """Return the same from devices in flat memory; in tick ``start`` the loading begins."""
    fd = ring.create(run.kind.row_type, 8192)
    rows = ring.RingWriter(fd, run.kind.row_type, wait=False)
    interpreted = InterpretedTick(run.kind, run.params, run.dt, rows)
    execution: Any = interpreted
    devices, clock = PlaceByPlace(run), PreparedTicks(run.dt)
    exchange = execution.connect(devices, clock)
    changeover, changed = None, False
    for i, (sense, request, tick, timing, periods) in enumerate(inputs):
        if prepared:  # with the readings of the last tick
            clock.prepare()
        devices.now = sense
        exchange(tick * run.dt, request, tick, timing, periods)
        execution.log()
        if i == start:
            folder = code_of(run)
            changeover = Changeover(folder, run.kind, run.params, run.dt, rows, interpreted)
        if changeover is not None and (found := changeover.advance()) is not None:
            assert changeover.problem == ""
            execution, changeover, changed = found, None, True
            exchange = execution.connect(devices, clock)
    assert changed
    return ring.RingReader(fd).remaining_rows(), devices.commands, execution.mode, execution.reason


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("kind", [*KINDS, *golden_bench.MIN_MOTION])
def test_a_changeover_at_any_tick_keeps_every_bit(kind: str) -> None:
    """Ten ticks of each golden run, chosen by chance; rows, commands, mode and reason are equal."""
    run = recorded(kind)
    expected = execute(run, run.inputs)
    choose = random.Random(kind)
    for _ in range(10):
        start = choose.randrange(len(run.inputs) - TICKS_OF_LOADING)
        assert execute_compiled(run, run.inputs, start) == expected, start
    assert execute_compiled(run, run.inputs, 0, prepared=False) == expected


def disturbed(run: Recorded, undisturbed: int, seed: int) -> tuple[Inputs, ...]:
    """Return inputs with requests, lost ticks, and readings that are late, faulty or no numbers.

    The first ``undisturbed`` inputs are those of the run.
    """
    choose = random.Random(seed)
    found, skipped = list(run.inputs[:undisturbed]), 0
    for logged, _, tick, _, _ in run.inputs[undisturbed:]:
        sense, periods, request = logged, 1, NO_REQUEST
        if choose.random() < 0.002:
            field = choose.choice(sense._fields)
            part = getattr(sense, field)
            name = choose.choice(part._fields)
            value = getattr(part, name)
            other = (
                choose.choice([0, 1, -1, 2**31])
                if isinstance(value, int)
                else choose.choice([math.nan, math.inf, -math.inf, 0.0, 1e9, -1e-3])
            )
            sense = sense._replace(**{field: part._replace(**{name: other})})
        if choose.random() < 0.01:
            periods = choose.choice([2, 2, 3, 29])
            skipped += periods - 1
        if choose.random() < 0.002:
            code = choose.choice([safety.REQUEST_HOLD, safety.REQUEST_RESUME])
            request = NO_REQUEST._replace(code=code)
        timing = cycle.Timing(choose.random() * 1e-3, choose.random() * 1e-4, skipped)
        found.append((sense, request, tick + skipped, timing, periods))
    return tuple(found)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["cots", "bench_instantaneous", "bench_flap"])
def test_faults_requests_and_lost_ticks_are_equal_to_the_bit(kind: str, seed: int) -> None:
    run = recorded(kind)
    inputs = disturbed(run, UNDISTURBED_TICKS[kind], seed)
    expected, got = execute(run, inputs), execute_compiled(run, inputs, 0)
    assert got[0] == expected[0]  # bytes: a NaN equals itself
    assert got[2:] == expected[2:]


def test_an_edit_of_any_function_of_the_cycle_gives_another_folder(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run = recorded("cots")
    before = source_of(run).folder
    found = {module.__name__ for module in source_of(run).modules}
    assert found >= {
        "controllers.estimator", "controllers.impedance", "controllers.blocks",
        "rig.kinds.wavebot.tick.cycle", "rig.kinds.wavebot.tick.check", "rig.realtime.axis",
        "rig.realtime.limits", "rig.realtime.safety", "rig.realtime.sequence",
    }  # fmt: skip
    getsource = inspect.getsource
    for edited in ("controllers.estimator", "rig.kinds.wavebot.tick.check", "rig.realtime.limits"):

        def read(module: Any, edited: str = edited) -> str:
            return getsource(module) + ("# edited" if module.__name__ == edited else "")

        monkeypatch.setattr(inspect, "getsource", read)
        assert source_of(run).folder != before, edited
        monkeypatch.undo()
    limits = importlib.import_module("rig.realtime.limits")
    grant = limits.grant

    def other(*given: Any) -> Any:  # loaded in this process, not in the file
        return grant(*given)

    other.__module__ = limits.__name__
    monkeypatch.setattr(limits, "grant", other)
    assert source_of(run).folder != before


def test_plans_of_any_length_share_one_code() -> None:
    run = recorded("cots")
    segments = run.params.segments
    longer = segments._replace(**{name: column * 2 for name, column in segments._asdict().items()})
    other = run._replace(params=run.params._replace(segments=longer))
    assert source_of(other).folder == source_of(run).folder


def test_memory_gives_back_what_it_was_given() -> None:
    run = recorded("open_loop")
    state = cycle.start(run.kind, run.params, 0)
    memory = tick_memory.of_kind(run.kind, run.params, state, run.dt)
    assert memory.state() == state
    step = cycle.make(run.kind)
    for each in run.inputs[:50]:
        sense, request, tick, timing, periods = each
        state, _, _ = step(run.params, state, sense, request, tick, timing, periods, run.dt)
    memory.set_state(state)
    assert memory.state() == state
    assert type(memory.state().rig) is type(state.rig)


def load(contents: list[bytes]) -> ObjectCode:
    code = ObjectCode(contents)
    for _ in code.load():
        pass
    return code


def objects() -> list[bytes]:
    return compiled_tick.read_objects(code_of(recorded("cots")))


@pytest.mark.slow
def test_damaged_code_is_refused() -> None:
    """A cut or changed file is an error, never a crash: nothing of it runs."""
    tick, entry = objects()
    choose = random.Random(1)
    for _ in range(60):
        cut = tick[: choose.randrange(len(tick) - 3000)]  # the symbols stand at the end
        with pytest.raises(ObjectCodeError):
            load([cut, entry])
    for at, value in ((0, 0), (4, 1), (16, 2), (18, 3)):  # magic, width, type, machine
        changed = bytearray(tick)
        changed[at] = value
        with pytest.raises(ObjectCodeError):
            load([bytes(changed), entry])


@pytest.mark.slow
def test_unknown_references_and_processors_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    tick, entry = objects()
    with pytest.raises(ObjectCodeError, match="which neither Python nor libm has"):
        load([entry])
    missing = entry.replace(b"PyErr_SetString", b"PyErr_SetStrong")
    with pytest.raises(ObjectCodeError, match="refers to PyErr_SetStrong"):
        load([tick, missing])
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")
    with pytest.raises(ObjectCodeError, match="compiled for x86_64, this is riscv64"):
        load([tick, entry])


@pytest.mark.slow
def test_the_loop_goes_on_interpreted_with_code_that_cannot_be_loaded(tmp_path: Path) -> None:
    run = recorded("cots")
    for name in compiled_tick.FILES:
        (tmp_path / name).write_bytes(compiled_tick.with_checksum(b"no code"))
    fd = ring.create(run.kind.row_type, 8192)
    rows = ring.RingWriter(fd, run.kind.row_type, wait=False)
    interpreted = InterpretedTick(run.kind, run.params, run.dt, rows)
    changeover = Changeover(tmp_path, run.kind, run.params, run.dt, rows, interpreted)
    found = None
    while found is None:
        found = changeover.advance()
    assert found is interpreted
    assert changeover.problem.startswith("damaged object code: ")


@pytest.mark.slow
@pytest.mark.parametrize("lets_others_run", [False, True])
def test_an_exception_in_the_code_is_raised(tmp_path: Path, *, lets_others_run: bool) -> None:
    """A compiled function that raises ends in a Python exception, which stops the rig."""
    from numba import njit

    from rig.compilation.tick_code import _objects

    @njit("int64(int64)", no_cpython_wrapper=True, no_cfunc_wrapper=True)
    def fails(address: int) -> int:
        if address != 0:
            raise ValueError("no")
        return 1

    code = load(list(_objects(fails, lets_others_run=lets_others_run)))
    run: Callable[[], int] = code.function(compiled_tick.ENTRY, (5).to_bytes(8, "little"))
    with pytest.raises(ArithmeticError, match="the compiled tick raised an exception"):
        run()
    assert code.function(compiled_tick.ENTRY, bytes(8))() == 1


@pytest.mark.parametrize("raises", [True, False])
def test_a_compiled_step_that_raises_is_repeated_interpreted(*, raises: bool) -> None:
    """From the state and the readings before it, so that the exception has file and line."""
    run = recorded("cots")
    state = cycle.start(run.kind, run.params, 0)
    memory = tick_memory.of_kind(run.kind, run.params, state, run.dt)
    fd = ring.create(run.kind.row_type, 64)
    rows = ring.RingWriter(fd, run.kind.row_type, wait=False)

    def fails() -> int:
        raise ArithmeticError(compiled_tick.EXCEPTION_TEXT)

    interpreted = InterpretedTick(run.kind, run.params, run.dt, rows)
    repeated: list[Any] = []

    def step(*arguments: Any) -> Any:
        repeated.append(arguments)
        if raises:
            raise ZeroDivisionError("of the law")
        return arguments[1], None, None

    interpreted._step = step
    tick = CompiledTick(memory, fails, run.dt, rows, 0, interpreted)
    sense = memory.get("sense")
    error = ZeroDivisionError if raises else ArithmeticError
    with pytest.raises(error, match="of the law" if raises else compiled_tick.EXCEPTION_TEXT):
        tick.step(sense, NO_REQUEST, 7, cycle.Timing(0.0, 0.0, 0), 1)
    ((_, before, readings, request, number, *_),) = repeated
    assert (before, readings, request, number) == (memory.state(), sense, NO_REQUEST, 7)


def test_memory_is_never_writable_and_executable() -> None:
    """The mapping that holds code loses its write permission before anything runs."""
    load(objects())
    _, base = object_code._LOADED[-1].ranges()[0]
    permissions = [
        access
        for place, access, *_ in map(str.split, Path("/proc/self/maps").read_text().splitlines())
        for first, end in [(int(each, 16) for each in place.split("-"))]
        if first <= base < end
    ]
    assert permissions == ["r-xp"]


def test_a_function_that_cannot_be_compiled_is_named() -> None:
    run = recorded("cots")
    source = source_of(run)
    broken = source._replace(text=source.text.replace("step(", "unknown_name(", 1))
    with pytest.raises(CompilationError, match="unknown_name"):
        compile_tick(broken)


class Gains(NamedTuple):
    gain: float
    count: int


def test_a_number_is_stored_by_its_annotation() -> None:
    """A law may give an int where its field is a float; the handover to the loop makes it one."""
    memory = tick_memory.FlatMemory(params=Gains(2, 3), state=Gains(0, 1))
    tree, _, layout = memory.sections["params"]
    assert (type(tree.gain), layout.format) == (float, "@dq")
    memory.set("state", Gains(4, 5))
    assert memory.get("state") == Gains(4.0, 5)
    assert type(memory.get("state").gain) is float
    assert memory.number("state", "gain")[0] == 4.0


CONSTANTS = "FACTOR = {factor}\n"
LAW = """
import {constants} as constants


def make(limit):
    def step(x):
        return min(constants.FACTOR * x, limit)

    return step
"""


ARRAY = "import numpy as np\n\nT = np.array([1.0, {}])\n"
OF_A_USER = "import numba\n\nB = {}\n\n\n@numba.njit\ndef f(x):\n    return B * x\n"


def test_an_edit_of_a_constant_or_of_a_value_in_a_closure_gives_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)

    def found(factor: int, limit: float) -> tuple[list[str], str, Path]:
        (tmp_path / "own_constants.py").write_text(CONSTANTS.format(factor=factor))
        (tmp_path / "own_law.py").write_text(LAW.format(constants="own_constants"))
        for name in ("own_constants", "own_law"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        linecache.clearcache()
        step = importlib.import_module("own_law").make(limit)
        needed = dependencies(recorded("cots").kind, [step])
        own = [each for each in needed.modules if each.__name__.startswith("own_")]
        return [each.__name__ for each in own], needed.digest, code_folder("", own)

    names, digest, folder = found(2, 5.0)
    assert names == ["own_constants", "own_law"]
    assert found(2, 5.0) == (names, digest, folder)
    assert found(3, 5.0)[2] != folder
    assert found(2, 6.0)[1] != digest


@pytest.mark.parametrize(
    ("imports", "law", "helper"),
    [
        ("import own_package.part", "step(x): return own_package.part.GAIN * x", "GAIN = {}"),
        ("from own_package import part", "step(x, top=part.TOP): return top * x", "TOP = {}"),
        ("from own_package.part import T", "step(x): return T[0] * x", ARRAY),
        ("from own_package.part import f", "step(x): return f(x)", "def f(x, a={}): return a * x"),
        ("from own_package.part import f", "step(x): return f(x)", OF_A_USER),
        ("from own_package.part import A\nB = (1.0, A)", "step(x): return B[1]", "A = {}"),
    ],
)
def test_an_edit_of_what_a_law_imports_gives_another_folder(
    imports: str, law: str, helper: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a module in a package, a default, an array, a function that the user compiled."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "own_package").mkdir()
    (tmp_path / "own_package" / "__init__.py").write_text("")
    (tmp_path / "own_step.py").write_text(f"{imports}\n\n\ndef {law}\n")

    def found(value: float) -> tuple[str, Path]:
        (tmp_path / "own_package" / "part.py").write_text(helper.format(value) + "\n")
        for name in ("own_package", "own_package.part", "own_step"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        linecache.clearcache()
        needed = all_of([importlib.import_module("own_step").step])
        return needed.digest, code_folder("", needed.modules)

    assert found(2.0) == found(2.0)
    assert len({found(2.0), found(3.0), found(2.5)}) == 3


class Rows:
    """A ring that counts."""

    def __init__(self) -> None:
        self.published = 0

    def reserve(self, max_rows: int = 1) -> tuple[int, int]:
        return 0, max_rows

    def publish(self, count: int = 1) -> None:
        self.published += count


def test_rows_before_a_tick_that_raises_are_kept() -> None:
    run = recorded("cots")

    class Plant:
        plant = device = Gains(1.0, 1)

        def attach(self, memory: Any) -> None:
            self.executed = memory.number("header", "executed")

        def ticks_until_due(self, tick: int) -> int:
            return 20

        def act(self, tick: int) -> None:
            raise AssertionError("not after a failure")

    plant, rows = Plant(), Rows()

    def fails() -> int:
        plant.executed[0] = 7
        raise ArithmeticError("no")

    state = cycle.start(run.kind, run.params, 0)
    memory = coupled_ticks.memory_of(run.params, state, plant)
    ticks = coupled_ticks.CoupledTicks(memory, fails, plant, run.dt, rows)  # type: ignore[arg-type]
    with pytest.raises(ArithmeticError):
        ticks.execute(1, NO_REQUEST, 50)
    assert rows.published == 7
