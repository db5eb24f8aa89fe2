"""The two executions of a tick: interpreted, the reference, and compiled, with the same bits.

The loop starts with the interpreted tick. As soon as the code of the compiled one is there, a
`Changeover` loads it and hands over the state between two ticks.
"""

import struct
from collections.abc import Callable, Generator
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from rig.realtime import cycle, tick_memory
from rig.realtime.clock import Clock
from rig.realtime.compiled_tick import exists, load
from rig.realtime.devices import Devices, FlatDevices, PackedDevices
from rig.realtime.live_setpoints import (
    Numbers,
    copy_live_setpoints,
    with_live_setpoint,
    write_live_setpoint,
)
from rig.realtime.object_code import ObjectCodeError
from rig.realtime.requests import NO_REQUEST, Request
from rig.realtime.safety import RUN
from rig.realtime.sequence import CHOICE

TICKS_BETWEEN_LOOKS = 100
_NO_TIMING = cycle.Timing(0.0, 0.0, 0)


class RowSink(Protocol):
    """The receiver of the rows of the ticks."""

    def put(self, row: Any) -> None:
        """Take the row of a tick; never block on the real clock."""

    def reserve(self, max_rows: int = 1) -> tuple[int, int]:
        """Return the address where the next rows may be written, and their number, at least 1.

        It never blocks on the real clock.
        """

    def publish(self, count: int = 1) -> None:
        """Take the rows at the reserved address; none are taken with ``count`` 0."""

    def finish(self) -> None:
        """Mark the end of the rows."""


Exchange = Callable[[float, Request, int, cycle.Timing, int], None]
"""``exchange(now, request, tick, timing, periods)``: read the devices, run the cycle, and send the
command; arguments as of `rig.realtime.devices` and `rig.realtime.cycle.make`."""


class Tick(Protocol):
    """An execution of the cycle of a rig."""

    @property
    def mode(self) -> int:
        """Mode of the safety machine after the last step."""

    @property
    def reason(self) -> int:
        """Reason of a stop, as of the safety machine."""

    @property
    def awaits_choice(self) -> bool:
        """Whether the plan waits until the next row is chosen (`sequence.CHOICE`)."""

    def step(
        self, sense: Any, request: Request, tick: int, timing: cycle.Timing, periods: int
    ) -> Any:
        """Return the command for the readings of a tick (arguments as of `cycle.make`)."""

    def connect(self, devices: Devices, clock: Clock) -> Exchange:
        """Return the function that runs a step between reading and writing the devices.

        ``clock``: that of the loop, which may be asked for time to prepare ticks.
        """

    def log(self) -> None:
        """Hand over the row of the last step, whose command has been sent."""

    def set_live(self, number: int, numbers: Numbers) -> None:
        """Store a set point that people chose, for the requests with its number."""

    def save(self) -> Any:
        """Return the state after the last step, for `restore`."""

    def restore(self, saved: Any) -> None:
        """Return to a saved state, as before the steps since."""


def choice_reader(memory: tick_memory.FlatMemory) -> Callable[[], bool]:
    """Return the function that looks whether the plan in a memory waits for the next row.

    It does not in manual mode, in which the plan is paused.
    """
    phases = memory.numbers_of("params", memory.sections["params"].tree.segments.phase)
    segment = memory.number("state", "sequence", "segment")
    paused = memory.number("state", "sequence", "paused")
    mode = memory.number("state", "safety", "mode")
    return lambda: mode[0] == RUN and not paused[0] and phases[int(segment[0])] == CHOICE


class InterpretedTick:
    """The cycle as it stands."""

    def __init__(self, kind: cycle.Kind, params: cycle.Params, dt: float, rows: RowSink) -> None:
        self._step, self.params, self._dt, self._rows = cycle.make(kind), params, dt, rows
        self.state = cycle.start(kind, params, 0)

    @property
    def mode(self) -> int:
        return self.state.safety.mode

    @property
    def reason(self) -> int:
        return self.state.safety.reason

    @property
    def awaits_choice(self) -> bool:
        plan = self.state.sequence
        phase = self.params.segments.phase[plan.segment]
        return self.mode == RUN and not plan.paused and phase == CHOICE

    def step(
        self, sense: Any, request: Request, tick: int, timing: cycle.Timing, periods: int
    ) -> Any:
        self.state, command, self._row = self._step(
            self.params, self.state, sense, request, tick, timing, periods, self._dt
        )
        return command

    def connect(self, devices: Devices, clock: Clock) -> Exchange:
        read, step, write = devices.read, self.step, devices.write

        def exchange(
            now: float, request: Request, tick: int, timing: cycle.Timing, periods: int
        ) -> None:
            write(step(read(now), request, tick, timing, periods))

        return exchange

    def log(self) -> None:
        self._rows.put(self._row)

    def set_live(self, number: int, numbers: Numbers) -> None:
        self.params = with_live_setpoint(self.params, number, numbers)

    def save(self) -> cycle.State:
        return self.state

    def restore(self, saved: cycle.State) -> None:
        self.state = saved


class CompiledTick:
    """The same cycle compiled; it works on a `TickMemory` and writes rows in their place."""

    def __init__(
        self,
        memory: tick_memory.TickMemory,
        code: Any,
        dt: float,
        rows: RowSink,
        mode: int,
        interpreted: InterpretedTick | None = None,
    ) -> None:
        """``code``: of `rig.realtime.compiled_tick.load`; ``mode``: before the first step.

        ``interpreted`` repeats a step that raises, for the message of the exception.
        """
        self._memory = memory  # it owns the tables that the code reads
        self._interpreted = interpreted
        self._code, self._mode = code, mode
        self._set_header = partial(memory.sections["header"].layout.pack_into, memory.buffer, 0)
        self._dt, self._reserve, self.log = dt, rows.reserve, rows.publish
        self._set_sense, self._get_command = memory.setter("sense"), memory.getter("command")
        self._reason = memory.number("state", "safety", "reason")
        self._awaits_choice = choice_reader(memory)
        self._state = memory.bytes_of("state")
        self._last: tuple[float, int] | None = None  # time and tick of the last exchange

    @property
    def mode(self) -> int:
        return self._mode

    @property
    def reason(self) -> int:
        return int(self._reason[0])

    @property
    def awaits_choice(self) -> bool:
        return self._awaits_choice()

    def step(
        self, sense: Any, request: Request, tick: int, timing: cycle.Timing, periods: int
    ) -> Any:
        self._set_sense(sense)
        self.step_in_place(request, tick, timing, periods)
        return self._get_command()

    def step_in_place(
        self, request: Request, tick: int, timing: cycle.Timing, periods: int
    ) -> None:
        """Run a step on the readings in memory, which then also has the command."""
        row, _ = self._reserve()
        self._set_header(*request, tick, *timing, periods, self._dt, row)
        try:
            self._mode = self._code()
        except ArithmeticError:
            if self._interpreted is not None:
                self._interpreted.state = self._memory.state()
                sense = self._memory.get("sense")
                self._interpreted.step(sense, request, tick, timing, periods)
            raise

    def connect(self, devices: Devices, clock: Clock) -> Exchange:
        flat: FlatDevices | PackedDevices
        if isinstance(devices, FlatDevices):
            devices.use(self._memory)
            flat = devices
        else:
            flat = PackedDevices(devices, self._memory)
        read, step, write = flat.read_in_place, self.step_in_place, flat.write_in_place
        self._prepare_devices = flat.prepare
        clock.prepare_ticks(self._prepare)

        def exchange(
            now: float, request: Request, tick: int, timing: cycle.Timing, periods: int
        ) -> None:
            self._last = now, tick
            read(now)
            step(request, tick, timing, periods)
            write()

        return exchange

    def _prepare(self) -> None:
        """Prepare the devices, then run the next step and undo it.

        The processor then has code, tables, memory and the ring in its caches.
        """
        if self._last is None:
            return
        now, tick = self._last
        self._prepare_devices(now + self._dt)
        mode, state = self._mode, self.save()
        self.step_in_place(NO_REQUEST, tick + 1, _NO_TIMING, 1)
        self.log(0)
        self._mode = mode
        self.restore(state)

    def set_live(self, number: int, numbers: Numbers) -> None:
        write_live_setpoint(self._memory, number, numbers)

    def save(self) -> bytes:
        return self._state.tobytes()

    def restore(self, saved: bytes) -> None:
        self._state[:] = saved


class Changeover:
    """The way from the interpreted tick to the compiled one, a little at a time."""

    def __init__(
        self,
        folder: Path,
        kind: cycle.Kind,
        params: cycle.Params,
        dt: float,
        rows: RowSink,
        interpreted: InterpretedTick,
    ) -> None:
        self._folder, self._kind, self._params, self._dt = folder, kind, params, dt
        self._rows, self._interpreted = rows, interpreted
        self._work = self._load()
        self.problem = ""  # why the code cannot be used

    def advance(self) -> Tick | None:
        """Do the work of less than a tick; return the tick to go on with, None if not yet."""
        try:
            next(self._work)
        except StopIteration as end:
            found: Tick = end.value
            return found
        except (OSError, ObjectCodeError, struct.error) as error:
            self.problem = str(error)
            return self._interpreted
        return None

    def _load(self) -> Generator[None, None, Tick]:
        while not exists(self._folder):
            for _ in range(TICKS_BETWEEN_LOOKS):
                yield
        yield
        sense, command = tick_memory.examples(self._kind, self._params, self._dt)
        yield
        state = self._interpreted.state  # of this tick; the last one comes with the code
        memory = tick_memory.TickMemory(self._params, state, sense, command, self._dt)
        yield
        code = yield from load(self._folder, memory)
        memory.set_state(self._interpreted.state)
        copy_live_setpoints(self._interpreted.params, memory)
        mode = self._interpreted.mode
        return CompiledTick(memory, code, self._dt, self._rows, mode, self._interpreted)
