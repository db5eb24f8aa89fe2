"""The compiled step of the bench gives the interpreted one's bits, whatever is done to it."""

from __future__ import annotations

import math

import pytest
from bench_files import DT, bench

from rig.rehearsal.compiled_bench import CompiledStepper
from sim_plant.bench.stepper import Stepper
from sim_plant.bench.world import Actuation, BenchWorld, Reading

TICKS = 6000


def wires(k: int) -> Actuation:
    """Both loops, the brake up and down, a clamp, no numbers, absurd numbers, drive off and on."""
    volts = 2.0 * math.sin(0.004 * k)
    amps = 6.0 * math.sin(0.011 * k)
    if k == 4000:
        volts = math.nan
    if k == 4700:
        amps = math.inf
    held = 0.6 + 0.6 * math.sin(0.007 * k)
    return Actuation(
        0 if 4010 <= k < 4050 or 4710 <= k < 4750 else 1,
        1 if k >= 2000 else 0,
        volts,
        amps,
        math.nan if k == 3500 else held,
        1 if 3000 <= k < 3400 else 0,
    )


def step(rig: BenchWorld, k: int) -> Reading:
    if not 5000 <= k < 5300:  # silence
        rig.actuate(wires(k))
    rig.press_e_stop(1500 <= k < 1600)
    rig.advance(DT)
    return rig.sense()


@pytest.mark.parametrize("name", ["oswec_bench", "oswec_bench_unbraked"])
def test_interpreted_and_compiled_read_the_same(name: str) -> None:
    one, other = (bench(name, stepper=kind) for kind in (Stepper, CompiledStepper))
    for k in range(TICKS):
        # by repr: equal to the last bit, types too, and NaN is itself
        assert repr(step(one, k)) == repr(step(other, k)), k
        assert repr(one.truth()) == repr(other.truth())
