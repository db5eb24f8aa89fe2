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
from rig.design import sampled_loop as sampled
from rig.design.axis import Law, Timing
from rig.design.estimator import design
from rig.design.impedance import design as design_zc
from rig.kinds.wavebot.heave_loop import linear_body
from sim_plant.bem import read_bem
from sim_plant.parameters import Plant
from sim_plant.sea_states import calm
from sim_plant.world import OFF, World

DT = 0.001
PLANT = Plant.model_validate(load_mapping(CONFIGS / "plants" / "wavebot_linear.yaml")[0])
PARAMS = PLANT.build()
BODY = linear_body(PARAMS.body, PARAMS.pto.viscous)
LAG = PARAMS.electrics.drive.time_constant
FILTER = design(2.5e-5, 0.5, 0.5, DT)
ACTIVE = design_zc([90000.0], [1.0, 20.0], DT)  # drives the body with 4500 N*s/m, with a lag


def law_of(kp: float, ki: float, km: float = 0.0, sections: tuple[Biquad, ...] = ()) -> Law:
    return Law(np.array([kp]), np.array([ki]), np.array([km]), sections)


def poles_of(law: Law, delay: int = 1, rate: float = 0.0, dt: float = DT) -> sampled.Poles:
    params = FILTER if dt == DT else design(2.5e-5, 0.5, 0.5, dt)
    return sampled.poles(BODY, Timing(dt, delay, LAG, params), law, np.array([rate]))


def free_motion(law: Law, ticks: int) -> tuple[Any, Any]:
    """Return positions of the simulated rig after a release, and those of the linear matrix."""
    bem = read_bem(CONFIGS / "plants" / PLANT.bem)
    surge = read_bem(CONFIGS / "plants" / PLANT.surge.bem)
    fine_sensors = {
        name: getattr(PLANT.sensors, name).model_copy(update={"value": value})
        for name, value in (("encoder_counts", 100_000_000), ("encoder_offset", 0))
    }
    file = PLANT.model_copy(update={"sensors": PLANT.sensors.model_copy(update=fine_sensors)})
    world = World(file, calm(), bem, surge, dt=DT, seed=1)
    world.release(0.01)
    scale = 2.0 * math.pi / (PLANT.pto.gear_ratio.value * 100_000_000)
    newtons = PARAMS.pto.force_per_current
    gains = Gains(float(law.kp[0]), float(law.ki[0]), float(law.km[0]))
    params = impedance.Params(0.0, law.sections)
    state, estimate = impedance.start(params), Estimate(0.01, 0.0, 0.0)
    timing = Timing(DT, 1, LAG, FILTER)
    ad, plant_input = sampled.discretise(BODY._replace(stiffness=BODY.stiffness + 490.9), timing)
    open_loop, feedback = sampled.closed_loop_matrices(ad, plant_input, timing, law.sections, gains)
    simulated, linear, states = [], [], None
    for k in range(300 + ticks):
        if k == 300:  # the drive is on; gains and share of Z_c have finished their ramp
            hull = world._stepper.state.body
            force = world.truth().motor
            memory = [value for section in state.sections for value in section]
            delayed_position = world.readings().heave_counts * scale
            states = np.array([*hull, force, delayed_position, *estimate, *memory])
        counts = world.readings().heave_counts
        estimate = estimator.step(FILTER, estimate, counts * scale, 1, DT)
        state, output = impedance.step(params, state, gains, estimate, 0.0, 0.0, DT)
        world.actuate(OFF._replace(heave_current=output.force / newtons, heave_enable=1))
        world.advance(DT)
        if states is not None:
            states = (open_loop + feedback) @ states
            simulated.append(world.truth().position)
            linear.append(states[0])
    return np.array(simulated), np.array(linear)


@pytest.mark.parametrize(
    ("gains", "sections", "stable"),
    [
        ((-1500.0, 4000.0, 0.0), (), True),
        ((-300.0, 9000.0, 0.0), (), True),
        ((-100.0, 0.0, 0.0), ACTIVE, False),
        ((-6000.0, 0.0, 100.0), ACTIVE, True),
    ],
)
def test_the_simulated_loop_moves_as_its_poles_predict(
    gains: tuple[float, float, float], sections: tuple[Biquad, ...], stable: bool
) -> None:
    """The simulated motion equals that of the matrix within 0.5 %, and decays or grows likewise.

    The plant steps by the midpoint rule, the matrix is exact.
    """
    law = law_of(*gains, sections)
    poles = poles_of(law, rate=490.9)  # rate at the initial stator position
    assert bool(poles.radius[0] < 1.0) is stable
    simulated, linear = free_motion(law, 4000)
    assert np.abs(simulated - linear).max() < 5e-3 * np.abs(simulated).max()
    early, late = np.abs(simulated[:500]).max(), np.abs(simulated[-1500:]).max()
    assert bool(late < early) is stable


@pytest.mark.parametrize("delay", [0, 1, 4])
def test_the_matrix_reproduces_the_loop(delay: int) -> None:
    """Powers of the matrix against the rig's own functions on an exactly discretised plant."""
    law = law_of(-2000.0, 6000.0, 50.0, ACTIVE)
    timing = Timing(DT, delay, LAG, FILTER)
    ad, plant_input = sampled.discretise(BODY, timing)
    open_loop, feedback = sampled.closed_loop_matrices(
        ad, plant_input, timing, law.sections, (-2000.0, 6000.0, 50.0)
    )
    rng = np.random.default_rng(2)
    states = np.zeros(len(open_loop))
    states[:8] = rng.standard_normal(8)
    plant_states, delay_line = states[:8].copy(), [0.0] * delay
    params = impedance.Params(0.0, law.sections)
    state, estimate = impedance.start(params), Estimate(0.0, 0.0, 0.0)
    for _ in range(50):
        delay_line.insert(0, float(plant_states[0]))
        estimate = estimator.step(FILTER, estimate, delay_line.pop(), 1, DT)
        state, output = impedance.step(
            params, state, Gains(-2000.0, 6000.0, 50.0), estimate, 0.0, 0.0, DT
        )
        plant_states = ad @ plant_states + plant_input * output.force
        if not delay:
            delay_line = []
        states = (open_loop + feedback) @ states
    # The law ramps the share of Z_c over one tick, so its first force lacks Z_c.
    np.testing.assert_allclose(
        states[:8], plant_states, rtol=2e-2, atol=2e-2 * np.abs(plant_states).max()
    )
    np.testing.assert_allclose(states[8 + delay : 11 + delay], estimate, rtol=2e-2, atol=1e-2)


def test_stability_ends_at_the_margin() -> None:
    for law in (
        law_of(-1500.0, 9000.0),
        law_of(-20000.0, 0.0, -400.0),
        law_of(0.0, 0.0, 0.0, ACTIVE),
    ):
        margin = float(poles_of(law, delay=4).gain_margin[0])
        assert 0.0 < margin < sampled.MAX_GAIN
        for factor, stable in ((0.98, True), (1.02, False)):
            scale = margin * factor
            scaled_sections = tuple(
                section._replace(
                    b0=section.b0 * scale, b1=section.b1 * scale, b2=section.b2 * scale
                )
                for section in law.sections
            )
            scaled_law = law_of(*(float(column[0]) * scale for column in law[:3]), scaled_sections)
            assert (float(poles_of(scaled_law, delay=4).radius[0]) < 1.0) is stable


def test_ki_above_the_hull_stiffness_is_unstable() -> None:
    """Static and sampled stability agree on Ki: the stiffness at rest is that of the hull."""
    stiffness = PARAMS.body.hydrostatic
    assert poles_of(law_of(-2000.0, 0.99 * stiffness)).radius[0] < 1.0
    assert poles_of(law_of(-2000.0, 1.01 * stiffness)).radius[0] > 1.0
    margin = float(poles_of(law_of(-2000.0, 0.5 * stiffness)).gain_margin[0])
    assert margin == pytest.approx(2.0, rel=0.01)


def test_a_slow_loop_with_much_damping_is_unstable() -> None:
    """At 200 Hz a delay of 40 ticks (0.2 s) reverses the sign of 20 000 N*s/m of damping."""
    assert poles_of(law_of(-20000.0, 0.0)).radius[0] < 1.0
    assert poles_of(law_of(-20000.0, 0.0), delay=40, dt=0.005).radius[0] > 1.0


def test_zero_gains_leave_the_hull_poles() -> None:
    poles: Any = poles_of(law_of(0.0, 0.0))
    assert poles.radius[0] < 1.0
    assert poles.gain_margin[0] == sampled.MAX_GAIN
    assert 0.5 < poles.frequency[0] < 0.8  # Hz, natural frequency of the body
