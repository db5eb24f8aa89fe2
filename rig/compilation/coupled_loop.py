"""Loop and plant as one compiled function: the functions of a rehearsal, without clock and log.

The cycle is `rig.realtime.cycle.make` of a kind of rig and the plant that of the kind's rehearsals,
lifted (rig/compilation/lifting.py). This module adds the order of operations in a tick and the
selection of the logged fields; a kind adds the three steps of its plant (`LoopSource`).
"""

import importlib
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rig.compilation import lifting, pages
from rig.compilation.cache_folder import code_folder
from rig.compilation.column import Column
from rig.compilation.pages import PAGE_TICKS
from rig.compilation.row_simulation import Progress, RowSimulation, Stored
from rig.compilation.tick_source import Dependencies, PlantCode, dependencies
from rig.realtime import cycle, safety
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.sequence import MEASURE, Segments

_SOURCE = '''"""Generated: ticks of loop and plant together.

Byte code of its functions without a file: {digest}
"""

import importlib

from numba import njit
from numba.extending import register_jitable

from rig.compilation.coupled_loop import CoupledState
from rig.compilation.pages import flush_page
from rig.realtime import cycle
{imports}

find_kind = importlib.import_module("{tick}").find_kind
loop_step = register_jitable(forceinline=True)(cycle.make(find_kind({law!r})))
NO_TIMING = cycle.Timing(0.0, 0.0, 0)


@njit(cache=True, error_model="numpy", nogil=True)
def advance(params, plant, dt, coupled, until, page, columns, filled):
    first = filled
    tick, loop, device, linger = coupled
    while tick < until and linger < {linger}:
        if tick > 0:
            device = {advance}
        sensed = {sense}
        loop, command, row = loop_step(params, loop, sensed, 0, tick, NO_TIMING, 1, dt)
        device, interrupted = {actuate}
        measuring = row.plan.phase == {measure}
        if measuring:
            slot = filled - first
            {keep}
            filled += 1
            if filled - first == {ticks}:
                flush_page(page, columns, {fields}, first, filled)
                first = filled
        if row.safety.mode == {stop_0}:
            linger += 1
        tick += 1
        if interrupted or (filled > 0 and not measuring):
            break
    flush_page(page, columns, {fields}, first, filled)
    return CoupledState(tick, loop, device, linger), filled
'''


class CoupledState(NamedTuple):
    """State of loop and plant before a tick."""

    tick: int
    loop: cycle.State
    device: Any  # of the plant, and of the signals between plant and loop
    linger: int  # ticks since power was removed


class LoopSource(NamedTuple):
    """A kind of rig's part of the compiled loop."""

    tick: str  # package of the kind's tick
    law: str  # for its `find_kind`
    plant: PlantCode
    fields: tuple[str, ...]  # stored of each measured tick

    @property
    def kind(self) -> cycle.Kind:
        """The kind of rig with its law."""
        kind: cycle.Kind = importlib.import_module(self.tick).find_kind(self.law)
        return kind

    def dependencies(self) -> Dependencies:
        """Return all that the code is made of."""
        own = (pages.flush_page, CoupledState, cycle.Timing)
        return dependencies(self.kind, (*self.plant.functions, *own))

    def text(self, digest: str) -> str:
        """Return the source of the compiled loop; ``digest``: of its dependencies."""
        stored = enumerate(self.fields)
        keep = (f"page[{i * PAGE_TICKS} + slot] = row.{name}" for i, name in stored)
        return _SOURCE.format(
            digest=digest,
            imports=self.plant.imports,
            tick=self.tick,
            law=self.law,
            advance=self.plant.advance,
            sense=self.plant.sense,
            actuate=self.plant.actuate,
            keep="\n            ".join(keep),
            fields=len(self.fields),
            ticks=PAGE_TICKS,
            linger=LINGER_TICKS,
            stop_0=safety.STOP_0,
            measure=MEASURE,
        )

    def load(self) -> Any:
        """Return the compiled ``advance``.

        ``advance(params, plant, dt, coupled, until, page, columns, filled)`` simulates up to tick
        ``until``, or until a few ticks after power was removed, the end of a window, or an
        interruption by ``actuate``. It fills ``columns`` (one line per field) from tick ``filled``
        on, through a ``page`` (rig/compilation/pages.py). It returns the new `CoupledState` and the
        number of stored ticks.
        """
        needed = self.dependencies()
        lifting.lift_functions(needed.functions)
        text, folder = self._cached(needed)
        return lifting.load("loop", text, (), folder=folder).advance

    def is_compiled(self) -> bool:
        """Return whether this host has already compiled ``advance``."""
        return lifting.is_compiled(self._cached(self.dependencies())[1])

    def _cached(self, needed: Dependencies) -> tuple[str, Path]:
        text = self.text(needed.digest)
        return text, code_folder(text, (sys.modules[__name__], *needed.modules))


class CoupledLoop:
    """The compiled loop in the course of one simulation."""

    def __init__(
        self, advance: Any, params: cycle.Params, plant: Any, dt: float, start: CoupledState
    ) -> None:
        """``advance`` is that of `LoopSource.load`."""
        self._advance, self._params, self._dt = advance, params, dt
        self.plant, self.coupled = plant, start

    def __call__(self, until: int, page: Column, columns: Column, filled: int) -> Progress:
        """Simulate at most up to tick ``until``, storing measured ticks from ``filled`` on."""
        self.coupled, filled = self._advance(
            self._params, self.plant, self._dt, self.coupled, until, page, columns, filled
        )
        tick, loop, _, linger = self.coupled
        return Progress(tick, linger, loop.safety.reason, int(filled))


class LoopSimulator(ABC):
    """A campaign's rig in its sea; each simulation starts anew. Threads may share a simulator."""

    def __init__(self, source: LoopSource, dt: float) -> None:
        """``source`` has the kind's loop and plant, ``dt`` is the period, s."""
        self.kind, self.dt = source.kind, dt
        self.advance = source.load()
        self.stored = Stored.of_row(self.kind.row_type, source.fields)

    @abstractmethod
    def loop(self, plan: Any, place: float | None) -> CoupledLoop:
        """Return the loop at power-on, with the set points of a plan.

        ``place`` is the position of the part that moves between rows; default is the plant's own.
        """

    def simulate(
        self,
        plan: Any,
        check: Callable[[], None] = lambda: None,
        place: float | None = None,
    ) -> RowSimulation:
        """Return the simulation of a plan from power-on to its end or a trip.

        ``place`` is that of `loop`. The simulation calls ``check`` about ten times per second; an
        exception of it ends the simulation.
        """
        segments: Segments = plan.segments
        loop, reasons_of_kind = self.loop(plan, place), self.kind.reason_table
        return RowSimulation(loop, self.stored, segments, self.dt, reasons_of_kind, check)

    def prepare(self, plan: Any) -> None:
        """Compile the loop for the types of this simulator, or read it from the cache."""
        self.simulate(plan).tick(0)


def as_columns(table: Any) -> Any:
    """Return a table of the loop with each of its columns as `Column`, also those of a group."""
    return type(table)(*map(_as_column, table))


def _as_column(numbers: Sequence[Any]) -> Any:
    if numbers and isinstance(numbers[0], tuple):
        return tuple(map(_as_column, numbers))
    return Column(numbers)


def with_columns(params: cycle.Params, segments: Segments, setpoints: Any) -> cycle.Params:
    """Return the loop's parameters for a plan, with its tables as `Column`.

    The kind's parameters have `setpoints` and `reference` (`controllers.open_loop`).
    """
    rig = params.rig
    return params._replace(
        segments=as_columns(segments),
        rig=rig._replace(
            setpoints=as_columns(setpoints),
            reference=rig.reference._replace(table=Column(rig.reference.table)),
        ),
    )
