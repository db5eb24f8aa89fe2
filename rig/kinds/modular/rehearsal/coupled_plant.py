"""The simulated modular rig for ticks compiled together with it (`rig.realtime.coupled_ticks`)."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.compilation.column import Column
from rig.compilation.tick_source import PlantCode
from rig.kinds.modular.rehearsal import plant_coupling
from rig.kinds.modular.rehearsal.plant_coupling import CONTACT_TICKS, Device, Plant
from sim_plant.modes.world import World


def plant_code(coupling: Any) -> PlantCode:
    """Return the plant's part of compiled ticks; ``coupling`` is the module of `couple`."""
    own = plant_coupling
    return PlantCode(
        (coupling.latch, coupling.sense, own.advance_plant, own.actuate),
        sense="sense(plant.in_transit, device.oldest, plant.age, plant.scales, plant.offsets)",
        actuate="actuate(plant, device, latch(command, plant.drives), dt)",
    )


def couple_world(
    world: World, sensors: tuple[Sequence[float], Sequence[float]], normals: Column
) -> tuple[Plant, Device]:
    """Return constants and state of a world.

    ``sensors``: of `devices.sensor_scales`; ``normals``: the noise table of the world's conditions.

    The columns of the plant are its own: ticks change the state, but not the world.
    """
    now = world.conditions()
    sequences = now.params._asdict().items()
    columns: dict[str, Any] = {n: Column(v) for n, v in sequences if not isinstance(v, int)}
    scales, offsets = sensors
    plant = Plant(
        now.params._replace(**columns),
        Column(np.array(now.state)),
        Column(now.table.ravel()),
        now.onset,
        now.onset_ticks,
        Column(np.array(now.waves)),
        Column(np.zeros(now.table.shape[1])),
        normals,
        Column(np.array(now.actuation.drives)),
        Column(np.array(now.delay_line[-1])),
        Column(np.ravel(now.delay_line)),
        world.delay,
        Column(np.array(scales, np.float64)),
        Column(np.array(offsets, np.float64)),
        Column(np.zeros(CONTACT_TICKS)),
    )
    line = now.wave_tick % now.table.shape[0] if now.wave_tick >= 0 else 0
    return plant, Device(now.wave_tick, line, 0, now.actuation.wave_trigger, now.fresh)
