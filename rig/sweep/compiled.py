"""The loop and the plant as one compiled function: the rehearsal's own functions, no clock, no log.

The cycle is `rig.realtime.cycle.make` of the WaveBot, the plant `sim_plant.wavebot.step`: the
functions that a rehearsal runs, lifted (rig/sweep/lifting.py). What stands here beside them is the
order of a tick and which fields of its row are kept.
"""

import sys
from functools import cache
from types import ModuleType
from typing import Any

from controllers import (
    biquads,
    blocks,
    drive_gating,
    estimator,
    impedance,
    magnetic_spring,
    open_loop,
    position_hold,
    signals,
    station_keeping,
)
from rig.execution.rehearsal.compiled_plant import LIFTED_MODULES as PLANT
from rig.kinds.wavebot import signals as wavebot_signals
from rig.kinds.wavebot import tare
from rig.realtime import average, axis, cycle, limits, power, safety, sequence
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.sequence import MEASURE
from rig.sweep import column, lifting, noise, pages, plant_coupling
from rig.sweep.pages import TICKS
from sim_plant import signals as plant_signals
from sim_plant import wave_maker

_CONTROL: tuple[ModuleType, ...] = (
    biquads, blocks, drive_gating, estimator, impedance, magnetic_spring, open_loop, position_hold,
    station_keeping, average, axis, limits, power, safety, sequence, tare,
    *(sys.modules[f"rig.kinds.wavebot.{name}"] for name in ("check", "kind", "state", "stations")),
)  # fmt: skip
LIFTED = (*_CONTROL, *PLANT, wave_maker, plant_coupling, pages, cycle)
BESIDE = (signals, wavebot_signals, plant_signals, column, noise)
"""Not lifted, but compiled code is made of their types."""

_SOURCE = '''"""Generated: ticks of loop and plant together."""

from numba import njit
from numba.extending import register_jitable

from rig.kinds.wavebot import KIND
from rig.realtime import cycle
from rig.sweep import column
from rig.sweep.pages import file_away, look_ahead
from rig.sweep.plant_coupling import Machine, actuation, sense, unhoisted
from sim_plant import wave_maker
from sim_plant.wavebot import Excitation, sample, step as plant_step

tick_of = register_jitable(forceinline=True)(cycle.make(KIND))
NO_TIMING = cycle.Timing(0.0, 0.0, 0)


@njit(cache=True, error_model="numpy", nogil=True)
def advance(params, plant, tables, normals, dt, late, machine, until, page, kept, filled):
    first = filled
    tick, loop, state, sea, line, wire, fresh, settings, linger = machine
    while tick < until and linger < {linger}:
        if tick > 0:
            look_ahead(tables, normals, sea.place, tick)
            after = wave_maker.step(tables, sea, dt)
            now, then = Excitation(sea.heave, sea.surge), Excitation(after.heave, after.surge)
            state = plant_step(plant, unhoisted(state), wire, fresh, now, then, dt)
            sea, fresh = after, 0
            line = line[1:] + (sample(plant, state, tick, sea.elevation, normals),)
        read = sense(line[0], late)
        loop, command, row = tick_of(params, loop, read, 0, tick, NO_TIMING, 1, dt)
        told = actuation(command)
        if told.wave_trigger != wire.wave_trigger:
            sea = wave_maker.switch(tables, told.wave_trigger, dt)
        wire, fresh = told, 1
        measuring = row.plan.phase == {measure}
        if measuring:
            at = filled - first
            {keep}
            filled += 1
            if filled - first == {ticks}:
                file_away(page, kept, {fields}, first, filled)
                first = filled
        if row.safety.mode == {stop_0}:
            linger += 1
        tick += 1
        asked = command.drive.settings
        if asked != settings and asked.bus_voltage > 0.0:
            settings = asked
            break
        if filled > 0 and not measuring:
            break
    file_away(page, kept, {fields}, first, filled)
    return Machine(tick, loop, state, sea, line, wire, fresh, settings, linger), filled
'''


@cache
def load(fields: tuple[str, ...]) -> Any:
    """The compiled ``advance``, which keeps these fields of each measured tick, in this order.

    ``advance(params, plant, tables, normals, dt, late, machine, until, page, kept, filled)`` ticks
    up to tick ``until``, to a few ticks after power was removed, to the end of a window, or to a
    change of the drive's settings, which are the caller's to make. It fills ``kept`` (one line a
    field) from ``filled`` on, by way of a ``page`` (rig/sweep/pages.py), and gives the machine and
    how many ticks are kept by then.
    """
    return lifting.load("batch", _source(fields), LIFTED, BESIDE).advance


def is_compiled(fields: tuple[str, ...]) -> bool:
    """Whether this host has compiled ``advance`` before."""
    return lifting.is_compiled(lifting.cache_folder(_source(fields), (*LIFTED, *BESIDE)))


def _source(fields: tuple[str, ...]) -> str:
    lines = (f"page[{i * TICKS} + at] = row.{name}" for i, name in enumerate(fields))
    keep = "\n            ".join(lines)
    return _SOURCE.format(
        keep=keep,
        fields=len(fields),
        ticks=TICKS,
        linger=LINGER_TICKS,
        stop_0=safety.STOP_0,
        measure=MEASURE,
    )
