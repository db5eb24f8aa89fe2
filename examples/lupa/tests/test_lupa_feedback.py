"""The feedback law: LUPA's filter coefficients, its lag, and its force in steady motion."""

import cmath
import math

import pytest
from controllers import biquads
from controllers.signals import Estimate

from wec_lupa import feedback

DT = 0.001
SETTINGS = {"low_pass_hz": (10.0,), "notch_hz": (50.0,), "notch_width_hz": (10.0,)}


def test_low_pass_has_the_coefficients_of_the_simulink_model() -> None:
    found = feedback.low_pass(10.0, DT)
    expected = (0.00094469, 2 * 0.00094469, 0.00094469, -1.91119707, 0.91497583)
    assert tuple(found) == pytest.approx(expected, abs=1e-8)


def test_notch_takes_out_its_frequency_and_nothing_else() -> None:
    section = feedback.notch(50.0, 10.0, DT)

    def gain(frequency: float) -> float:
        return abs(biquads.response((section,), 2.0 * math.pi * frequency * DT))

    assert gain(50.0) < 1e-9
    assert gain(0.5) == pytest.approx(1.0, abs=1e-4)
    width = next(
        f for f in (k / 100 for k in range(5000, 6000)) if gain(f) > math.sqrt(0.5)
    ) - next(f for f in (k / 100 for k in range(5000, 4000, -1)) if gain(f) > math.sqrt(0.5))
    assert width == pytest.approx(10.0, rel=0.02)


@pytest.mark.parametrize(("frequency", "delay"), [(0.25, 23.15), (0.5, 23.15), (1.0, 23.22)])
def test_filters_have_the_published_delay(frequency: float, delay: float) -> None:
    """ms; 4.17 degrees at 0.5 Hz."""
    constants = feedback.params(SETTINGS, 0.0, DT)
    angle = 2.0 * math.pi * frequency * DT
    phase = cmath.phase(biquads.response((constants.notch, constants.low_pass), angle))
    assert -phase / (2.0 * math.pi * frequency) * 1e3 == pytest.approx(delay, abs=0.02)


def test_force_is_the_delayed_spring_and_damper() -> None:
    """In steady motion of 0.5 Hz: -(K + j w C) x, 23.15 ms later and half a tick more for C v."""
    constants = feedback.params(SETTINGS, 0.0, DT)
    state, omega = feedback.start(constants), math.pi
    gains = feedback.SetPoint(-4000.0, 600.0)
    found = 0j
    for tick in range(20_000):
        position = 0.05 * math.sin(omega * tick * DT)
        motion = Estimate(position, 0.05 * omega * math.cos(omega * tick * DT), 0.0)
        state, demand = feedback.step(constants, state, gains, motion, 0.0, 0.0, DT)
        if tick >= 10_000:
            found += demand.force * cmath.exp(-1j * omega * tick * DT) / 5_000
    lag = cmath.exp(-1j * omega * 0.02315)
    half = cmath.exp(-0.5j * omega * DT)
    linear = feedback.linear(constants, gains, omega)
    assert found == pytest.approx(linear * 0.05 * omega, rel=1e-3)
    expected = -(gains.stiffness + 1j * omega * gains.damping * half) * lag * -0.05j
    assert found == pytest.approx(expected, rel=1e-3)


def test_gains_step_without_a_ramp_and_resist_the_motion() -> None:
    constants = feedback.params(SETTINGS, 0.0, DT)
    state = feedback.start(constants)
    for _ in range(2000):
        motion = Estimate(0.1, 0.0, 0.0)
        state, demand = feedback.step(
            constants, state, feedback.SetPoint(1000.0, 0.0), motion, 7.0, 0.0, DT
        )
    assert demand.force == pytest.approx(-100.0 + 7.0)
    assert (demand.kp, demand.ki) == (0.0, -1000.0)


def test_a_filter_too_fast_for_the_tick_is_refused() -> None:
    with pytest.raises(ValueError, match=r"low_pass_hz 150 Hz is too fast; allowed < 100 Hz"):
        feedback.params({**SETTINGS, "low_pass_hz": (150.0,)}, 0.0, 0.004)
