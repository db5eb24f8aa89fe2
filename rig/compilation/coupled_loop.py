"""Loop and plant as one compiled function: the functions of a rehearsal, without clock and log.

The cycle is `rig.realtime.cycle.make` of a kind of rig and the plant that of the kind's rehearsals,
lifted (rig/compilation/lifting.py). This module adds the order of operations in a tick and the
selection of the logged fields; a kind adds the three steps of its plant (`LoopSource`).
"""

import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any, NamedTuple

from controllers import biquads, blocks, estimator, law, open_loop, signals
from rig import stations
from rig.compilation import column, lifting, pages
from rig.compilation.cache_folder import code_folder
from rig.compilation.column import Column
from rig.compilation.pages import PAGE_TICKS
from rig.compilation.row_simulation import Progress, RowSimulation, Stored
from rig.compilation.tick_source import PlantCode
from rig.realtime import axis, cycle, limits, power, reasons, safety, sequence
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.sequence import MEASURE, Segments

LIFTED_MODULES = (
    biquads, blocks, estimator, open_loop, axis, limits, safety, sequence, pages, cycle,
)  # fmt: skip
"""Modules of the loop of every kind."""

TYPE_MODULES = (
    signals, law, column, power, reasons, stations, sys.modules[__name__],
)  # fmt: skip
"""Modules that are not lifted, but whose types or generated functions compiled code contains."""

_SOURCE = '''"""Generated: ticks of loop and plant together."""

from numba import njit
from numba.extending import register_jitable

from rig.compilation import column
from rig.compilation.coupled_loop import CoupledState
from rig.compilation.pages import flush_page
from rig.realtime import cycle
{imports}

loop_step = register_jitable(forceinline=True)(cycle.make({kind}))
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

    name: str  # of the module
    imports: str  # lines, for the names in `kind`
    kind: str  # expression: the kind's `cycle.Kind`
    plant: PlantCode
    fields: tuple[str, ...]  # stored of each measured tick
    lifted: tuple[ModuleType, ...]  # modules besides `LIFTED_MODULES`
    types: tuple[ModuleType, ...]  # modules besides `TYPE_MODULES`

    @property
    def lifted_modules(self) -> tuple[ModuleType, ...]:
        """All lifted modules of loop and plant."""
        every = dict.fromkeys((*LIFTED_MODULES, *self.lifted))
        return tuple(module for module in every if module not in self.type_modules)

    @property
    def type_modules(self) -> tuple[ModuleType, ...]:
        """All modules that are not lifted, but are part of the compiled code."""
        return tuple(dict.fromkeys((*TYPE_MODULES, *self.types)))

    def text(self) -> str:
        """Return the source of the compiled loop."""
        stored = enumerate(self.fields)
        keep = (f"page[{i * PAGE_TICKS} + slot] = row.{name}" for i, name in stored)
        return _SOURCE.format(
            imports=f"{self.imports}\n{self.plant.imports}",
            kind=self.kind,
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

    def load(self, kind: cycle.Kind) -> Any:
        """Return the compiled ``advance`` for a kind, that of the expression `kind`.

        ``advance(params, plant, dt, coupled, until, page, columns, filled)`` simulates up to tick
        ``until``, or until a few ticks after power was removed, the end of a window, or an
        interruption by ``actuate``. It fills ``columns`` (one line per field) from tick ``filled``
        on, through a ``page`` (rig/compilation/pages.py). It returns the new `CoupledState` and the
        number of stored ticks.
        """
        lifting.lift_closures(kind.control)
        modules = (self.lifted_modules, self.type_modules)
        return lifting.load(self.name, self.text(), *modules).advance

    def is_compiled(self) -> bool:
        """Return whether this host has already compiled ``advance``."""
        modules = (*self.lifted_modules, *self.type_modules)
        return lifting.is_compiled(code_folder(self.text(), modules))


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

    def __init__(self, kind: cycle.Kind, source: LoopSource, dt: float) -> None:
        """``source`` has the kind's loop and plant, ``dt`` is the period, s."""
        self.kind, self.dt = kind, dt
        self.advance = source.load(kind)
        self.stored = Stored.of_row(kind.row_type, source.fields)

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
