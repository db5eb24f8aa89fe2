"""Poles of the sampled loop against the loop itself: estimator, law and plant, tick by tick."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from predicting import CONFIGS

from controllers import estimator, impedance
from controllers.biquads import Biquad
from controllers.signals import Estimate, Gains
from rig.config.yaml_source import load_mapping
from rig.design.estimator import design
from rig.design.impedance import design as design_zc
from rig.design.predictions import plant, sampled
from rig.design.predictions.loop import Law, Timing
from sim_plant.bem import read_bem
from sim_plant.waves import calm
from sim_plant.world import OFF, World

DT = 0.001
GIVEN = plant.given(load_mapping(CONFIGS / "plants" / "wavebot_linear.yaml")[0])
FILTER = design(2.5e-5, 0.5, 0.5, DT)
ACTIVE = design_zc([90000.0], [1.0, 20.0], DT)  # 4500 N*s/m that drives, with a lag


def law_of(kp: float, ki: float, km: float = 0.0, sections: tuple[Biquad, ...] = ()) -> Law:
    return Law(np.array([kp]), np.array([ki]), np.array([km]), sections)


def poles_of(law: Law, delay: int = 1, rate: float = 0.0, dt: float = DT) -> sampled.Poles:
    lag = plant.side(GIVEN, "heave").lag
    body = plant.at_rest(*plant.hull(GIVEN, "heave"))
    found = FILTER if dt == DT else design(2.5e-5, 0.5, 0.5, dt)
    return sampled.poles(body, Timing(dt, delay, lag, found), law, np.array([rate]))


def free_motion(law: Law, ticks: int) -> tuple[Any, Any]:
    """Positions of the simulated rig after a release, and those of the matrix from there on."""
    bem = read_bem(CONFIGS / "plants" / GIVEN.file.bem)
    surge = read_bem(CONFIGS / "plants" / GIVEN.file.surge.bem)
    fine = {
        name: getattr(GIVEN.file.sensors, name).model_copy(update={"value": value})
        for name, value in (("encoder_counts", 100_000_000), ("encoder_offset", 0))
    }
    file = GIVEN.file.model_copy(update={"sensors": GIVEN.file.sensors.model_copy(update=fine)})
    world = World(file, calm(), bem, surge, dt=DT, seed=1)
    world.release(0.01)
    scale = 2.0 * math.pi / (GIVEN.file.pto.gear_ratio.value * 100_000_000)
    newtons = plant.motor(GIVEN).newtons_per_ampere
    gains = Gains(float(law.kp[0]), float(law.ki[0]), float(law.km[0]))
    params = impedance.Params(0.0, law.sections)
    state, seen = impedance.start(law.sections), Estimate(0.01, 0.0, 0.0)
    timing = Timing(DT, 1, plant.side(GIVEN, "heave").lag, FILTER)
    body = plant.at_rest(*plant.hull(GIVEN, "heave"))
    ad, held = sampled.discrete(body._replace(stiffness=body.stiffness + 490.9), timing)
    still, moved = sampled.closed_loop(ad, held, timing, law.sections, gains)
    simulated, told, whole = [], [], None
    for k in range(300 + ticks):
        if k == 300:  # the drive is on, gains and share of Z_c are ramped in
            hull = world._stepper.state.body
            force = world.truth().motor
            memory = [value for section in state.sections for value in section]
            line = world.readings().heave_counts * scale
            whole = np.array([*hull, force, line, *seen, *memory])
        counts = world.readings().heave_counts
        seen = estimator.step(FILTER, seen, counts * scale, 1, DT)
        state, asked = impedance.step(params, state, gains, seen, 0.0, 0.0, DT)
        world.actuate(OFF._replace(heave_current=asked.force / newtons, heave_enable=1))
        world.advance(DT)
        if whole is not None:
            whole = (still + moved) @ whole
            simulated.append(world.truth().position)
            told.append(whole[0])
    return np.array(simulated), np.array(told)


@pytest.mark.parametrize(
    ("gains", "sections", "stable"),
    [
        ((-1500.0, 4000.0, 0.0), (), True),
        ((-300.0, 9000.0, 0.0), (), True),
        ((-100.0, 0.0, 0.0), ACTIVE, False),
        ((-6000.0, 0.0, 100.0), ACTIVE, True),
    ],
)
def test_poles_tell_what_the_loop_does(
    gains: tuple[float, float, float], sections: tuple[Biquad, ...], stable: bool
) -> None:
    """The simulated rig moves as the matrix says, to 0.5 % of the motion, and so dies out or grows.

    The plant steps by the midpoint rule, the matrix is exact.
    """
    law = law_of(*gains, sections)
    found = poles_of(law, rate=490.9)  # where the simulated stator stands
    assert bool(found.radius[0] < 1.0) is stable
    simulated, told = free_motion(law, 4000)
    assert np.abs(simulated - told).max() < 5e-3 * np.abs(simulated).max()
    early, late = np.abs(simulated[:500]).max(), np.abs(simulated[-1500:]).max()
    assert bool(late < early) is stable


@pytest.mark.parametrize("delay", [0, 1, 4])
def test_the_matrix_is_the_loop(delay: int) -> None:
    """Powers of it against the rig's own functions on an exactly discretised plant."""
    law = law_of(-2000.0, 6000.0, 50.0, ACTIVE)
    lag = plant.side(GIVEN, "heave").lag
    body = plant.at_rest(*plant.hull(GIVEN, "heave"))
    ad, held = sampled.discrete(body, Timing(DT, delay, lag, FILTER))
    timing = Timing(DT, delay, lag, FILTER)
    still, moved = sampled.closed_loop(ad, held, timing, law.sections, (-2000.0, 6000.0, 50.0))
    rng = np.random.default_rng(2)
    whole = np.zeros(len(still))
    whole[:8] = rng.standard_normal(8)
    real, line = whole[:8].copy(), [0.0] * delay
    params = impedance.Params(0.0, law.sections)
    state, seen = impedance.start(law.sections), Estimate(0.0, 0.0, 0.0)
    for _ in range(50):
        line.insert(0, float(real[0]))
        seen = estimator.step(FILTER, seen, line.pop(), 1, DT)
        state, asked = impedance.step(
            params, state, Gains(-2000.0, 6000.0, 50.0), seen, 0.0, 0.0, DT
        )
        real = ad @ real + held * asked.force
        if not delay:
            line = []
        whole = (still + moved) @ whole
    # The law ramps the share of Z_c in over one tick, so its first force lacks it.
    np.testing.assert_allclose(whole[:8], real, rtol=2e-2, atol=2e-2 * np.abs(real).max())
    np.testing.assert_allclose(whole[8 + delay : 11 + delay], seen, rtol=2e-2, atol=1e-2)


def test_the_margin_is_where_stability_ends() -> None:
    for law in (
        law_of(-1500.0, 9000.0),
        law_of(-20000.0, 0.0, -400.0),
        law_of(0.0, 0.0, 0.0, ACTIVE),
    ):
        margin = float(poles_of(law, delay=4).gain_margin[0])
        assert 0.0 < margin < sampled.MOST_GAIN
        for factor, stable in ((0.98, True), (1.02, False)):
            at = margin * factor
            scaled = tuple(one._replace(b0=one.b0 * at, b1=one.b1 * at, b2=one.b2 * at)
                           for one in law.sections)  # fmt: skip
            same = law_of(*(float(column[0]) * at for column in law[:3]), scaled)
            assert (float(poles_of(same, delay=4).radius[0]) < 1.0) is stable


def test_too_much_stiffness_taken_is_unstable() -> None:
    """Static and sampled stability agree on Ki: the stiffness at rest is that of the hull."""
    stiffness = GIVEN.built.body.hydrostatic
    assert poles_of(law_of(-2000.0, 0.99 * stiffness)).radius[0] < 1.0
    assert poles_of(law_of(-2000.0, 1.01 * stiffness)).radius[0] > 1.0
    margin = float(poles_of(law_of(-2000.0, 0.5 * stiffness)).gain_margin[0])
    assert margin == pytest.approx(2.0, rel=0.01)


def test_a_slow_loop_with_much_damping_is_unstable() -> None:
    """At 200 Hz a delay of 40 ticks (0.2 s) turns 20 000 N*s/m of damping around."""
    assert poles_of(law_of(-20000.0, 0.0)).radius[0] < 1.0
    assert poles_of(law_of(-20000.0, 0.0), delay=40, dt=0.005).radius[0] > 1.0


def test_no_law_at_all_leaves_the_hull() -> None:
    found: Any = poles_of(law_of(0.0, 0.0))
    assert found.radius[0] < 1.0
    assert found.gain_margin[0] == sampled.MOST_GAIN
    assert 0.5 < found.frequency[0] < 0.8  # Hz, the body's own
