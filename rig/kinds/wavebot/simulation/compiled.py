"""Loop and plant as one compiled function: the functions of a rehearsal, without clock and log.

The cycle is `rig.realtime.cycle.make` of the WaveBot and the plant is `sim_plant.wavebot.step`: the
functions that a rehearsal runs, lifted (rig/compilation/lifting.py). This module adds the order of
operations in a tick and the selection of the logged fields.
"""

import sys
from functools import lru_cache
from types import ModuleType
from typing import Any

from controllers import (
    biquads,
    blocks,
    drive_gating,
    estimator,
    law,
    magnetic_spring,
    open_loop,
    position_hold,
    signals,
    station_keeping,
)
from rig import stations as station_table
from rig.compilation import column, lifting, pages
from rig.compilation.cache_folder import code_folder
from rig.compilation.pages import PAGE_TICKS
from rig.kinds.wavebot.rehearsal.compiled_plant import LIFTED_MODULES as PLANT
from rig.kinds.wavebot.simulation import noise, plant_coupling
from rig.kinds.wavebot.tick import kind_with_law, tare
from rig.kinds.wavebot.tick import reasons as wavebot_reasons
from rig.kinds.wavebot.tick import signals as wavebot_signals
from rig.laws import Law, helper_modules
from rig.realtime import average, axis, cycle, limits, motor_power, power, reasons, safety, sequence
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.sequence import MEASURE
from sim_plant import signals as plant_signals
from sim_plant import wave_maker

_WAVEBOT = ("check", "cycle", "law_columns", "power_checks", "state", "stations")
_CONTROL: tuple[ModuleType, ...] = (
    biquads, blocks, drive_gating, estimator, magnetic_spring, open_loop, position_hold,
    station_keeping, average, axis, limits, motor_power, safety, sequence, tare,
    *(sys.modules[f"rig.kinds.wavebot.tick.{name}"] for name in _WAVEBOT),
)  # fmt: skip
LIFTED = (*_CONTROL, *PLANT, wave_maker, plant_coupling, pages, noise, cycle)
TYPE_MODULES = (
    signals, law, wavebot_signals, wavebot_reasons, plant_signals, column, power, reasons,
    station_table,
)  # fmt: skip
"""Modules that are not lifted, but whose types or generated functions compiled code contains."""

_SOURCE = '''"""Generated: ticks of loop and plant together."""

from numba import njit
from numba.extending import register_jitable

import {law} as heave_law
from rig.kinds.wavebot.tick import kind_with_law
from rig.realtime import cycle
from rig.compilation import column
from rig.compilation.pages import flush_page
from rig.kinds.wavebot.simulation.noise import prefetch_ahead
from rig.kinds.wavebot.simulation.plant_coupling import (
    CoupledState, actuation, sense, without_hoist,
)
from sim_plant import wave_maker
from sim_plant.wavebot import Excitation, sample, step as plant_step

loop_step = register_jitable(forceinline=True)(cycle.make(kind_with_law(heave_law)))
NO_TIMING = cycle.Timing(0.0, 0.0, 0)


@njit(cache=True, error_model="numpy", nogil=True)
def advance(params, plant, tables, normals, dt, age, coupled, until, page, columns, filled):
    first = filled
    tick, loop, state, sea, in_transit, plant_input, new_input, settings, linger = coupled
    while tick < until and linger < {linger}:
        if tick > 0:
            prefetch_ahead(tables, normals, sea.table_index, tick)
            after = wave_maker.step(tables, sea, dt)
            now, then = Excitation(sea.heave, sea.surge), Excitation(after.heave, after.surge)
            state = plant_step(plant, without_hoist(state), plant_input, new_input, now, then, dt)
            sea, new_input = after, 0
            in_transit = in_transit[1:] + (sample(plant, state, tick, sea.elevation, normals),)
        sensed = sense(in_transit[0], age)
        loop, command, row = loop_step(params, loop, sensed, 0, tick, NO_TIMING, 1, dt)
        next_input = actuation(command)
        if next_input.wave_trigger != plant_input.wave_trigger:
            sea = wave_maker.switch(tables, next_input.wave_trigger, dt)
        plant_input, new_input = next_input, 1
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
        commanded = command.drive.settings
        if commanded != settings and commanded.bus_voltage > 0.0:
            settings = commanded
            break
        if filled > 0 and not measuring:
            break
    flush_page(page, columns, {fields}, first, filled)
    coupled = CoupledState(
        tick, loop, state, sea, in_transit, plant_input, new_input, settings, linger
    )
    return coupled, filled
'''


def load(fields: tuple[str, ...], law: Law) -> Any:
    """Return the compiled ``advance`` for a heave law.

    It stores ``fields`` of each measured tick in order.

    ``advance(params, plant, tables, normals, dt, age, coupled, until, page, columns, filled)``
    simulates up to tick ``until``, or until a few ticks after power was removed, the end of a
    window, or a change of the drive's settings, which the caller must apply. ``age`` (s) is the age
    of the readings. The function fills ``columns`` (one line per field) from tick ``filled`` on,
    through a ``page`` (rig/compilation/pages.py). It returns the new `CoupledState`
    and the number of stored ticks.
    """
    return _load(fields, law)


@lru_cache(8)
def _load(fields: tuple[str, ...], law: Law) -> Any:
    lifting.lift_closures(kind_with_law(law.module).control)
    name = f"batch_{law.module.__name__.rpartition('.')[2]}"
    return lifting.load(name, _source(fields, law), lifted_modules(law), TYPE_MODULES).advance


def lifted_modules(law: Law) -> tuple[ModuleType, ...]:
    """Return all lifted modules of the loop with a heave law, and the plant."""
    from_law = (module for module in helper_modules(law) if module not in TYPE_MODULES)
    return tuple(dict.fromkeys((*LIFTED, *from_law)))


def is_compiled(fields: tuple[str, ...], law: Law) -> bool:
    """Return whether this host has already compiled ``advance`` for these fields and this law."""
    modules = (*lifted_modules(law), *TYPE_MODULES)
    return lifting.is_compiled(code_folder(_source(fields, law), modules))


def _source(fields: tuple[str, ...], law: Law) -> str:
    lines = (f"page[{i * PAGE_TICKS} + slot] = row.{name}" for i, name in enumerate(fields))
    keep = "\n            ".join(lines)
    return _SOURCE.format(
        keep=keep,
        law=law.module.__name__,
        fields=len(fields),
        ticks=PAGE_TICKS,
        linger=LINGER_TICKS,
        stop_0=safety.STOP_0,
        measure=MEASURE,
    )
