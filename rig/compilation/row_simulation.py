"""The measured windows of a simulated campaign, row by row, from the compiled loop of a kind."""

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby, pairwise
from typing import Any, NamedTuple, Protocol, cast

import numpy as np
import numpy.typing as npt

from rig.compilation.column import Column
from rig.compilation.pages import PAGE_TICKS
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.reasons import Reason, ReasonTable
from rig.realtime.sequence import MEASURE, Segments
from rig.recording.row_layout import leaves
from rig.recording.runs.mcap_file import Records
from rig.recording.runs.windows import Window

Floats = npt.NDArray[np.float64]

_TICKS_PER_CALL = 200_000  # ticks between two checks for an interrupt: a tenth of a second
_SPARE_BUFFERS: list[Floats] = []  # of finished simulations: allocation costs a tenth of one


class Stored(NamedTuple):
    """The fields of a tick that a simulation stores in its windows."""

    fields: tuple[str, ...]
    dtype: np.dtype[Any]

    @classmethod
    def of_row(cls, row_type: type, names: Sequence[str]) -> "Stored":
        """Return the fields ``names`` of a log row, without repetitions."""
        fields = tuple(dict.fromkeys(names))
        types = {leaf.name: "<f8" if leaf.code == "d" else "<i8" for leaf in leaves(row_type)}
        return cls(fields, np.dtype([(n, kind) for n, kind in types.items() if n in fields]))


class Progress(NamedTuple):
    """The state of a simulation after a call of the compiled loop."""

    tick: int
    linger: int  # ticks since power was removed
    reason: int  # of the stop
    filled: int  # stored ticks


class Advance(Protocol):
    """A kind's compiled loop with its plant."""

    def __call__(self, until: int, page: Any, columns: Any, filled: int, /) -> Progress:
        """Simulate at most up to tick ``until``, storing measured ticks from ``filled`` on."""
        ...


class RowSimulation:
    """Iterator over the windows of a plan's rows; afterwards ``reason`` is the reason of the end.

    The data of a window are valid until the iterator advances.
    """

    def __init__(
        self,
        advance: Advance,
        stored: Stored,
        segments: Segments,
        dt: float,
        reasons: ReasonTable,
        check: Callable[[], None],
    ) -> None:
        """``check`` is called about ten times per second; its exception ends the simulation."""
        self._advance, self._stored, self._check = advance, stored, check
        self._reasons, self._dt = reasons, dt
        self._page = Column(np.empty(len(stored.fields) * PAGE_TICKS))
        self._columns = _take_buffer(len(stored.fields), _longest_stretch(segments) + 1)
        self._flat_columns = Column(self._columns.ravel())
        self._progress = Progress(0, 0, int(Reason.NONE), 0)
        self.reason = Reason.NONE.name  # of the stop

    @property
    def seconds(self) -> float:
        """Simulated time so far, s."""
        return self._progress.tick * self._dt

    def __iter__(self) -> Iterator[Window]:
        tick_column = self._columns[self._stored.fields.index("tick")]
        filled = 0
        while self._progress.linger < LINGER_TICKS:
            self._check()
            filled = self.tick(self._progress.tick + _TICKS_PER_CALL, filled)
            tick, linger, _, _ = self._progress
            if filled and (linger == LINGER_TICKS or tick_column[filled - 1] != tick - 1):
                yield from self._windows(self._columns[:, :filled])
                filled = 0
        self.reason = self._reasons.name(self._progress.reason)
        _SPARE_BUFFERS.append(cast(Floats, self._columns.base))

    def tick(self, until: int, filled: int = 0) -> int:
        """Simulate at most up to tick ``until``; return the number of stored ticks of windows."""
        self._progress = self._advance(until, self._page, self._flat_columns, filled)
        return self._progress.filled

    def _windows(self, columns: Floats) -> Iterator[Window]:
        reason = self._progress.reason
        stopped = reason not in (Reason.NONE, Reason.PLAN_END)
        rows = columns[self._stored.fields.index("plan.row")]
        edges = [0, *(np.flatnonzero(rows[1:] != rows[:-1]) + 1).tolist(), len(rows)]
        for begin, end in pairwise(edges):
            data = _WindowColumns(columns[:, begin:end], self._stored)
            incomplete_reason = (
                f"run stopped: {self._reasons.name(reason)}" if stopped and end == len(rows) else ""
            )
            row, attempt = (int(data[f"plan.{name}"][0]) for name in ("row", "attempt"))
            yield Window(row, attempt, cast(Records, data), incomplete_reason)


class _WindowColumns:
    """Measured ticks of one row by field, with the interface of a log's records."""

    def __init__(self, columns: Floats, stored: Stored) -> None:
        self._columns, self._fields, self.dtype = columns, stored.fields, stored.dtype

    def __len__(self) -> int:
        return len(self._columns[0])

    def copy(self) -> "_WindowColumns":
        """Return a copy that stays valid when the simulation goes on."""
        return _WindowColumns(self._columns.copy(), Stored(self._fields, self.dtype))

    def __getitem__(self, name: str) -> Any:
        column = self._columns[self._fields.index(name)]
        return column if self.dtype[name].kind == "f" else column.astype(np.int64)


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


def _longest_stretch(segments: Segments) -> int:
    """Return the ticks of the longest sequence of windows without a gap."""
    by_phase = groupby(zip(segments.phase, segments.ticks, strict=True), lambda s: s[0])
    return max((sum(n for _, n in run) for phase, run in by_phase if phase == MEASURE), default=0)
