"""The measured windows of a simulated task, row by row: a rehearsal without clock and log.

The ticks are those of a rehearsal, compiled together with the plant (`rig.realtime.coupled_ticks`).
Their rows go to a small block of memory; the fields that the analysis needs are kept, of measured
ticks, field by field.
"""

import importlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import groupby, pairwise
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from rig.compilation.column import Column
from rig.compilation.loaded_code import Bind, load_code
from rig.compilation.tick_source import PlantCode, TickSource, coupled_source
from rig.planning.reference import index_realisations, list_realisations
from rig.realtime import coupled_ticks, cycle
from rig.realtime.compiled_tick import is_complete
from rig.realtime.coupled_ticks import CoupledTicks, Coupling
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.reasons import Reason, ReasonTable
from rig.realtime.requests import NO_REQUEST
from rig.realtime.safety import STOP_0
from rig.realtime.sequence import MEASURE, Segments
from rig.realtime.tick import RowSink
from rig.recording.row_layout import leaves
from rig.recording.runs.mcap_file import Records
from rig.recording.runs.windows import Window

Floats = npt.NDArray[np.float64]

_BLOCK_TICKS = 512  # of one call: its rows stay in the processor's cache
_SPARE_BUFFERS: list[Floats] = []  # of finished simulations: allocation costs a tenth of one


class Stored(NamedTuple):
    """The fields of a tick that a simulation stores in its windows."""

    fields: tuple[str, ...]
    dtype: np.dtype[Any]
    places: tuple[int, ...]  # of the fields among the numbers of a row
    phase: int  # place
    reason: int  # place of that of a stop

    @classmethod
    def of_row(cls, row_type: type, names: Sequence[str]) -> "Stored":
        """Return the fields ``names`` of a log row, without repetitions."""
        found = leaves(row_type)
        places = {leaf.name: place for place, leaf in enumerate(found)}
        fields = tuple(dict.fromkeys(names))
        types = [(leaf.name, "<f8" if leaf.code == "d" else "<i8") for leaf in found]
        dtype = np.dtype([each for each in types if each[0] in fields])
        phase, reason = places["plan.phase"], places["safety.reason"]
        return cls(fields, dtype, tuple(places[name] for name in fields), phase, reason)


class Simulator(ABC):
    """A rig and its simulated plant; each simulation starts anew. Threads may share a simulator."""

    def __init__(
        self, tick: str, law: str, params: cycle.Params, code: PlantCode, fields: Sequence[str]
    ) -> None:
        """``tick``: package of the kind's tick; ``law``: for its `find_kind`.

        ``fields``: of a row, to be kept.
        """
        self._tick, self._law, self._params, self._code = tick, law, params, code
        self.kind: cycle.Kind = importlib.import_module(tick).find_kind(law)
        self.stored = Stored.of_row(self.kind.row_type, fields)
        self._start = cycle.start(self.kind, params, 0)

    @abstractmethod
    def coupling(self, place: float | None) -> Coupling:
        """Return the plant at power-on.

        ``place`` is the position of the part that moves between rows; default is the plant's own.
        """

    @cached_property
    def source(self) -> TickSource:
        """The source of the compiled ticks."""
        return coupled_source(self._tick, self._law, self._params, self.coupling(None), self._code)

    def is_compiled(self) -> bool:
        """Return whether this host has the code already."""
        return is_complete(self.source.folder)

    def prepare(self) -> None:
        """Load the code; compile it if this host does not have it.

        Raises `rig.compilation.tick_code.CompilationError`, a ValueError, if it cannot.
        """
        _ = self._bind

    @cached_property
    def _bind(self) -> Bind:
        return load_code(self.source)

    def simulate(
        self,
        plan: Any,
        check: Callable[[], None] = lambda: None,
        place: float | None = None,
    ) -> "RowSimulation":
        """Return the simulation of a plan from power-on to its end or a trip.

        ``place`` is that of `coupling`. The simulation calls ``check`` many times per second; an
        exception of it ends the simulation.
        """
        rows = RowBlock(self.kind.row_type)
        ticks = self.ticks(plan, rows, place)
        contact = getattr(ticks.plant, "contact", None)
        stored, reasons = self.stored, self.kind.reason_table
        return RowSimulation(
            ticks, rows, stored, plan.segments, plan.dt, reasons, check,
            None if contact is None else contact.array,
        )  # fmt: skip

    def ticks(self, plan: Any, rows: RowSink, place: float | None = None) -> CoupledTicks:
        """Return the ticks of a plan from power-on, which write to ``rows``."""
        coupling = self.coupling(place)
        memory = coupled_ticks.memory_of(self.params_of(plan), self._start, coupling)
        return CoupledTicks(memory, self._bind(memory), coupling, plan.dt, rows)

    def params_of(self, plan: Any) -> cycle.Params:
        """Return the parameters for a plan; by default those of the simulator."""
        return self._params


class CampaignSimulator(Simulator):
    """A campaign's rig in its sea, for plans of some of the campaign's points."""

    def __init__(
        self,
        tick: str,
        law: str,
        plan: Any,
        params: cycle.Params,
        code: PlantCode,
        fields: Sequence[str],
    ) -> None:
        """``params``: of a ``plan`` of all the points to be simulated; others as of `Simulator`.

        The kind's parameters have `setpoints` and `reference` (`controllers.open_loop`).
        """
        rig = params.rig
        reference = rig.reference._replace(table=Column(rig.reference.table))
        params = params._replace(rig=rig._replace(reference=reference))
        super().__init__(tick, law, params, code, fields)
        self._realisations = list_realisations(plan.setpoints.realisation)

    def params_of(self, plan: Any) -> cycle.Params:
        """Return the parameters with the segments and set points of a plan."""
        setpoints = index_realisations(plan.setpoints, self._realisations)
        rig = self._params.rig._replace(setpoints=setpoints)
        return self._params._replace(segments=plan.segments, rig=rig)


class RowBlock:
    """The rows of the last call; a `rig.realtime.tick.RowSink`."""

    def __init__(self, row_type: type) -> None:
        self.numbers = np.empty((_BLOCK_TICKS, len(leaves(row_type))))  # integers as their bits

    def reserve(self, max_rows: int = 1) -> tuple[int, int]:
        """Return the address of the block, and how many rows it takes."""
        return self.numbers.ctypes.data, min(max_rows, _BLOCK_TICKS)

    def publish(self, count: int = 1) -> None:
        """Nothing to do: the rows are read before the next call."""

    put = finish = publish


class RowSimulation:
    """Iterator over the windows of a plan's rows; afterwards ``reason`` is the reason of the end.

    The data of a window are valid until the iterator advances.
    """

    def __init__(
        self,
        ticks: CoupledTicks,
        rows: RowBlock,
        stored: Stored,
        segments: Segments,
        dt: float,
        reasons: ReasonTable,
        check: Callable[[], None],
        contact: Floats | None = None,
    ) -> None:
        """``check`` is called many times per second; its exception ends the simulation.

        ``contact`` is 1 at the remainder of each tick that ended at an end stop; None: the plant
        has no end stops.
        """
        self._ticks, self._rows, self._stored, self._check = ticks, rows, stored, check
        self._reasons, self._dt = reasons, dt
        self._contact = contact
        # The last column is the contact with an end stop.
        self._columns = _take_buffer(len(stored.fields) + 1, _longest_stretch(segments) + 1)
        self._tick = self._block = 0  # the next tick, and the first of the block
        self.reason = Reason.NONE.name  # of the stop

    @property
    def seconds(self) -> float:
        """Simulated time so far, s."""
        return self._tick * self._dt

    def __iter__(self) -> Iterator[Window]:
        rows = self._rows.numbers.view(np.int64)
        phases, reasons = rows[:, self._stored.phase], rows[:, self._stored.reason]
        ticks, filled, linger = self._ticks, 0, 0
        while linger < LINGER_TICKS:
            self._check()
            self._block = self._tick
            executed = ticks.execute(self._tick, NO_REQUEST, _BLOCK_TICKS)
            self._tick += executed
            linger += ticks.mode == STOP_0  # without power each call has one tick
            for begin, end, measured in _stretches(phases[:executed] == MEASURE):
                if measured:
                    self._keep(begin, end, filled)
                    filled += end - begin
                elif filled:
                    yield from self._windows(self._columns[:, :filled], int(reasons[begin]))
                    filled = 0
        reason = ticks.reason
        if filled:
            yield from self._windows(self._columns[:, :filled], reason)
        self.reason = self._reasons.name(reason)
        _SPARE_BUFFERS.append(cast(Floats, self._columns.base))

    def _keep(self, begin: int, end: int, filled: int) -> None:
        """Copy the stored fields of rows of the block to ticks ``filled`` on of the columns."""
        kept = self._rows.numbers[begin:end].take(self._stored.places, axis=1)
        place = slice(filled, filled + end - begin)
        self._columns[:-1, place] = kept.T
        self._columns[-1, place] = 0.0
        if self._contact is not None:
            ticks = np.arange(self._block + begin, self._block + end)
            self._columns[-1, place] = self._contact[ticks % len(self._contact)]

    def _windows(self, columns: Floats, reason: int) -> Iterator[Window]:
        """Yield the windows of a stretch of ticks; ``reason``: of a stop, in the tick after it."""
        stopped = reason not in (Reason.NONE, Reason.PLAN_END)
        rows = _WindowColumns(columns, self._stored)["plan.row"]
        for begin, end, _ in _stretches(rows):
            data = _WindowColumns(columns[:, begin:end], self._stored)
            incomplete_reason = (
                f"run stopped: {self._reasons.name(reason)}" if stopped and end == len(rows) else ""
            )
            row, attempt = (int(data[f"plan.{name}"][0]) for name in ("row", "attempt"))
            share = float(columns[-1, begin:end].mean())
            yield Window(row, attempt, cast(Records, data), incomplete_reason, end_stop=share)


class _WindowColumns:
    """Measured ticks of one row by field, with the interface of a log's records."""

    def __init__(self, columns: Floats, stored: Stored) -> None:
        self._columns, self._stored, self.dtype = columns, stored, stored.dtype

    def __len__(self) -> int:
        return len(self._columns[0])

    def copy(self) -> "_WindowColumns":
        """Return a copy that stays valid when the simulation goes on."""
        return _WindowColumns(self._columns.copy(), self._stored)

    def __getitem__(self, name: str) -> Any:
        return self._columns[self._stored.fields.index(name)].view(self.dtype[name])


def _take_buffer(fields: int, ticks: int) -> Floats:
    """Return a buffer for so many ticks, reusing that of a finished simulation if large enough."""
    size = fields * ticks
    try:
        buffer = _SPARE_BUFFERS.pop()
    except IndexError:
        buffer = np.empty(0)
    if len(buffer) < size:
        buffer = np.empty(size)
    return buffer[:size].reshape(fields, ticks)


def _stretches(values: npt.NDArray[Any]) -> Iterator[tuple[int, int, Any]]:
    """Yield begin, end and value of each stretch of equal values."""
    edges = [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1).tolist(), len(values)]
    yield from ((begin, end, values[begin]) for begin, end in pairwise(edges))


def _longest_stretch(segments: Segments) -> int:
    """Return the ticks of the longest sequence of windows without a gap."""
    longest = map(max, segments.ticks, segments.timeout)  # of a segment that waits
    by_phase = groupby(zip(segments.phase, longest, strict=True), lambda s: s[0])
    return max((sum(n for _, n in run) for phase, run in by_phase if phase == MEASURE), default=0)
