"""The compiled step of each WaveBot plant gives the interpreted one's bits for any input."""

from __future__ import annotations

import math

import pytest
from plant_files import DT, command, world

from rig.kinds.wavebot.rehearsal.compiled_plant import CompiledStepper
from sim_plant import sea_states
from sim_plant.world import Actuation, DriveSettings, Readings, Stepper, World

TICKS = 9000


def actuation_at(k: int, velocity: float) -> Actuation:
    """Return all kinds of commands: surge, a moving stator, gating, NaN."""
    return command(
        math.nan if k == 8500 else -25.0 * velocity,
        heave_enable=0 if 6000 <= k < 6050 else 1,
        wave_trigger=1 if k > 100 else 0,
        stator_enable=1,
        stator_target=27.0 if k > 2000 else -13.0,
        surge_enable=1 if k > 3000 else 0,
        surge_current=4.0 * math.sin(0.01 * k),
        conducting=0 if k % 3000 < 200 else 1,
    )


def step(rig: World, k: int) -> Readings:
    readings = rig.readings()
    if not 4000 <= k < 4300:  # no commands in between
        rig.actuate(actuation_at(k, rig.motion()[1]))
    if k == 1000:
        rig.configure(DriveSettings(3, 80.0, 1.0e-4, 0.4, 3))
    if k == 5000:
        rig.prescribe(lambda t: (0.1 * math.sin(t), 0.1 * math.cos(t)))
    if k == 7000:
        rig.release()
    if k == 8000:
        rig.release(0.05)
    rig.advance(DT)
    return readings


@pytest.mark.parametrize(
    "name", ["wavebot", "wavebot_linear", "wavebot_as_measured", "wavebot_custom_islanded"]
)
def test_interpreted_and_compiled_read_the_same(name: str) -> None:
    sea = sea_states.jonswap(0.254, 2.5, 3.3, 30.0, seed=1)
    interpreted, compiled = (world(sea, name, stepper=kind) for kind in (Stepper, CompiledStepper))
    for k in range(TICKS):
        # by repr: equal to the last bit, types too, and NaN is itself
        assert repr(step(interpreted, k)) == repr(step(compiled, k)), k
    assert repr(interpreted.truth()) == repr(compiled.truth())
