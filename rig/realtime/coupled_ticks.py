"""Ticks of a rig together with its simulated plant, compiled and executed many at a time.

On the virtual clock nothing outside acts between two ticks, except for requests, and for the parts
of a plant that are not compiled: so ticks run in chunks that end there. Rows go straight into the
memory of the ring.
"""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from rig.realtime import cycle
from rig.realtime.compiled_tick import exists, load_at_once
from rig.realtime.live_setpoints import Numbers, write_live_setpoint
from rig.realtime.object_code import ObjectCodeError
from rig.realtime.requests import NO_REQUEST, Request
from rig.realtime.tick import TICKS_BETWEEN_LOOKS, InterpretedTick, RowSink, choice_reader
from rig.realtime.tick_memory import FlatMemory


class ChunkHeader(NamedTuple):
    """The inputs of a chunk besides parameters, plant and states."""

    request: Request = NO_REQUEST
    tick: int = 0  # the first one
    max_ticks: int = 0
    dt: float = 0.0  # s
    row: int = 0  # address of the first row
    executed: int = 0  # ticks, written by the code after each one


class Coupling(Protocol):
    """A simulated plant as compiled ticks take it, and what of it acts between chunks."""

    plant: Any
    """Its constants, a NamedTuple that may hold `rig.realtime.tick_memory.Numbers`."""

    device: Any
    """Its state and the signals between plant and loop, after the last executed tick."""

    def attach(self, memory: FlatMemory) -> None:
        """Take the memory with the sections `plant` and `device`, on which ticks work from now."""

    def ticks_until_due(self, tick: int) -> int:
        """Return how many ticks from ``tick`` on may be executed before `act`, at least 1."""

    def act(self, tick: int) -> None:
        """Do what is due before ``tick``, the next one."""


def memory_of(params: cycle.Params, state: cycle.State, coupling: Coupling) -> FlatMemory:
    """Return the memory of ticks from a state on."""
    own = {"params": params, "state": state}
    return FlatMemory(header=ChunkHeader(), **own, plant=coupling.plant, device=coupling.device)


class CoupledTicks:
    """The compiled ticks of loop and plant from a tick on."""

    def __init__(
        self, memory: FlatMemory, code: Callable[[], int], coupling: Coupling, dt: float,
        rows: RowSink,
    ) -> None:  # fmt: skip
        """``code``: of `rig.realtime.compiled_tick.load_at_once` for the memory."""
        self.memory, self._code, self._coupling = memory, code, coupling
        self._dt, self._rows = dt, rows
        self._pack_header = memory.sections["header"].layout.pack_into
        self._mode = memory.number("state", "safety", "mode")
        self._reason = memory.number("state", "safety", "reason")
        self._awaits_choice = choice_reader(memory)
        self._executed = memory.number("header", "executed")
        coupling.attach(memory)

    @property
    def plant(self) -> Any:
        """The plant's constants and columns, which the ticks change."""
        return self._coupling.plant

    @property
    def mode(self) -> int:
        """Mode of the safety machine after the last tick."""
        return int(self._mode[0])

    @property
    def reason(self) -> int:
        """Reason of a stop, as of the safety machine."""
        return int(self._reason[0])

    @property
    def awaits_choice(self) -> bool:
        """Whether the plan waits until the next row is chosen (`sequence.CHOICE`)."""
        return self._awaits_choice()

    def set_live(self, number: int, numbers: Numbers) -> None:
        """Store a set point that people chose, for the requests with its number."""
        write_live_setpoint(self.memory, number, numbers)

    def execute(self, tick: int, request: Request, max_ticks: int) -> int:
        """Execute ticks from ``tick`` on; return their number, at least 1.

        Without power each chunk has one tick, and so it has while the next row is being chosen. If
        a tick raises, the rows before it are kept.
        """
        address, space = self._rows.reserve(min(max_ticks, self._coupling.ticks_until_due(tick)))
        self._pack_header(self.memory.buffer, 0, *request, tick, space, self._dt, address, 0)
        try:
            executed = self._code()
        finally:
            self._rows.publish(int(self._executed[0]))
        self._coupling.act(tick + executed)
        return executed


class CoupledChangeover:
    """The way from ticks of their own to compiled ticks of loop and plant."""

    def __init__(
        self,
        folder: Path,
        couple: Callable[[], Coupling],
        dt: float,
        rows: RowSink,
        interpreted: InterpretedTick,
    ) -> None:
        """``couple`` returns the plant as it is between two ticks."""
        self._folder, self._couple = folder, couple
        self._dt, self._rows = dt, rows
        self._interpreted = interpreted
        self._calls = 0
        self.problem = ""  # why the code cannot be used

    def advance(self) -> CoupledTicks | InterpretedTick | None:
        """Return the ticks to go on with if the code is there; call it between two ticks."""
        looks = self._calls % TICKS_BETWEEN_LOOKS == 0
        self._calls += 1
        if not looks or not exists(self._folder):
            return None
        try:
            coupling = self._couple()
            memory = memory_of(self._interpreted.params, self._interpreted.state, coupling)
            code = load_at_once(self._folder, memory)
        except (OSError, ObjectCodeError, struct.error) as error:
            self.problem = str(error)
            return self._interpreted
        return CoupledTicks(memory, code, coupling, self._dt, self._rows)
