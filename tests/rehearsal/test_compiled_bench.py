"""The compiled steps of bench and flap give the interpreted ones' bits for any input."""

from __future__ import annotations

import math

import pytest
from bench_files import DT, bench
from flap_files import flap

from rig.kinds.oswec_bench.rehearsal.compiled_plant import (
    CompiledFlapStepper,
    CompiledStepper,
)
from sim_plant import sea_states
from sim_plant.bench.stepper import Stepper
from sim_plant.bench.wires import PlantInterface
from sim_plant.bench.world import Actuation, BenchReading
from sim_plant.flap import stepper as flap_stepper

TICKS = 6000


def actuation_at(k: int) -> Actuation:
    """Return both control loops, brake up and down, a clamp, NaN, infinity, drive off and on."""
    volts = 2.0 * math.sin(0.004 * k)
    amps = 6.0 * math.sin(0.011 * k)
    if k == 4000:
        volts = math.nan
    if k == 4700:
        amps = math.inf
    brake_current = 0.6 + 0.6 * math.sin(0.007 * k)
    return Actuation(
        0 if 4010 <= k < 4050 or 4710 <= k < 4750 else 1,
        1 if k >= 2000 else 0,
        volts,
        amps,
        math.nan if k == 3500 else brake_current,
        1 if 3000 <= k < 3400 else 0,
    )


def step(rig: PlantInterface, k: int) -> BenchReading:
    if not 5000 <= k < 5300:  # no commands in between
        rig.actuate(actuation_at(k))
    rig.press_e_stop(1500 <= k < 1600)
    rig.advance(DT)
    return rig.sense()


@pytest.mark.parametrize("name", ["oswec_bench", "oswec_bench_unbraked"])
def test_interpreted_and_compiled_read_the_same(name: str) -> None:
    interpreted, compiled = (bench(name, stepper=kind) for kind in (Stepper, CompiledStepper))
    for k in range(TICKS):
        # by repr: equal to the last bit, types too, and NaN is itself
        assert repr(step(interpreted, k)) == repr(step(compiled, k)), k
        assert repr(interpreted.truth()) == repr(compiled.truth())


@pytest.mark.parametrize("name", ["oswec_flap", "oswec_flap_free"])
def test_the_flap_reads_the_same(name: str) -> None:
    sea = sea_states.jonswap(0.15, 1.5, 3.3, 20.0, seed=3)
    kinds = (flap_stepper.Stepper, CompiledFlapStepper)
    interpreted, compiled = (flap(sea, name, stepper=kind) for kind in kinds)
    for k in range(TICKS):
        for rig in (interpreted, compiled):
            rig.make_waves(1 if k > 200 else 0)
            if k == 5500:
                rig.release(0.3)
        assert repr(step(interpreted, k)) == repr(step(compiled, k)), k
        assert repr(interpreted.truth()) == repr(compiled.truth())
