"""Laws against closed forms: mean power in a sinusoidal motion, motion of an oscillator.

Powers are means of -F v over whole periods, sampled every millisecond. A mean over N equal samples
of a smooth periodic function has no error that matters here; where the force jumps, one sample of
1000 a period may fall on the wrong side, hence tolerances of some 1e-3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.optimize import fsolve

from controllers import declutching, latching, nonlinear_damping, velocity_table
from controllers.signals import Estimate

DT = 1e-3  # s
PERIOD = 2.0  # s
OMEGA = 2.0 * math.pi / PERIOD
SPEED = 0.5  # m/s, amplitude of the velocity
NO_RAMP = 0.0


def sine(periods: int) -> Iterator[Estimate]:
    """A motion with velocity SPEED sin(OMEGA t), which starts at its lower turning point."""
    for tick in range(round(periods * PERIOD / DT)):
        angle = OMEGA * tick * DT
        yield Estimate(
            -SPEED / OMEGA * math.cos(angle),
            SPEED * math.sin(angle),
            SPEED * OMEGA * math.cos(angle),
        )


def mean_power(law: ModuleType, params: Any, setpoint: Any) -> float:
    """Mean absorbed power (W) over the last two of four periods."""
    state, power = law.start(params), []
    for motion in sine(4):
        state, demand = law.step(params, state, setpoint, motion, 0.0, 0.0, DT)
        power.append(-demand.force * motion.velocity)
    return float(np.mean(power[len(power) // 2 :]))


def table(**columns: tuple[float, ...]) -> velocity_table.Params:
    return velocity_table.params(dict(columns), NO_RAMP, DT)


def test_a_straight_table_is_a_linear_damper() -> None:
    params = table(velocity_m_per_s=(-10.0, 10.0), force_n=(3000.0, -3000.0))
    found = mean_power(velocity_table, params, velocity_table.SetPoint(1.0, 1.0))
    assert found == pytest.approx(0.5 * 300.0 * SPEED**2, rel=1e-9)


@pytest.mark.parametrize("knee", [0.1, 0.3, 0.45])
def test_a_table_that_saturates_has_the_describing_function_of_a_saturation(knee: float) -> None:
    """N(A) = 2 c / pi (asin d + d sqrt(1 - d^2)), d = knee / A (Slotine and Li, section 5.3)."""
    slope = 400.0
    params = table(velocity_m_per_s=(-knee, knee), force_n=(slope * knee, -slope * knee))
    found = mean_power(velocity_table, params, velocity_table.SetPoint(1.0, 1.0))
    share = knee / SPEED
    equivalent = 2.0 * slope / math.pi * (math.asin(share) + share * math.sqrt(1.0 - share**2))
    assert found == pytest.approx(0.5 * equivalent * SPEED**2, rel=1e-4)


def test_scale_and_retract_factor_multiply_the_force() -> None:
    params = table(velocity_m_per_s=(-1.0, 0.0, 1.0), force_n=(200.0, 0.0, -200.0))
    one = mean_power(velocity_table, params, velocity_table.SetPoint(1.0, 1.0))
    assert mean_power(velocity_table, params, velocity_table.SetPoint(2.0, 1.0)) == 2.0 * one
    half = mean_power(velocity_table, params, velocity_table.SetPoint(1.0, 0.0))
    assert half == pytest.approx(0.5 * one, rel=1e-9)


@pytest.mark.parametrize(
    ("velocities", "forces", "why"),
    [
        ((0.0, 1.0, 1.0), (0.0, -1.0, -2.0), "must rise, but 1 follows 1"),
        ((-1.0, 1.0), (-5.0, 5.0), "drive the body"),
        ((0.1, 1.0), (-5.0, -9.0), "-5 at rest"),
        ((-1.0, 1.0), (5.0,), "2 values and force_n 1"),
    ],
)
def test_a_table_that_could_drive_the_body_is_refused(
    velocities: tuple[float, ...], forces: tuple[float, ...], why: str
) -> None:
    with pytest.raises(ValueError, match=why):
        table(velocity_m_per_s=velocities, force_n=forces)


def test_quadratic_damping_absorbs_four_over_three_pi_c_v_cubed() -> None:
    params = nonlinear_damping.params({"smoothing_m_per_s": (0.01,)}, NO_RAMP, DT)
    found = mean_power(nonlinear_damping, params, nonlinear_damping.SetPoint(700.0, 0.0))
    assert found == pytest.approx(4.0 / (3.0 * math.pi) * 700.0 * SPEED**3, rel=1e-6)


@pytest.mark.parametrize("smoothing", [1e-4, 0.1])
def test_coulomb_damping_absorbs_two_over_pi_f_v(smoothing: float) -> None:
    """Smoothed, it is a saturation; its describing function goes to 4 f / (pi V) without."""
    params = nonlinear_damping.params({"smoothing_m_per_s": (smoothing,)}, NO_RAMP, DT)
    found = mean_power(nonlinear_damping, params, nonlinear_damping.SetPoint(0.0, 150.0))
    share = smoothing / SPEED
    slope = 150.0 / smoothing
    equivalent = 2.0 * slope / math.pi * (math.asin(share) + share * math.sqrt(1.0 - share**2))
    assert found == pytest.approx(0.5 * equivalent * SPEED**2, rel=1e-4)
    if smoothing < 0.001:
        assert found == pytest.approx(2.0 / math.pi * 150.0 * SPEED, rel=1e-4)


@pytest.mark.parametrize("time", [0.0, 0.2, 0.5, 0.8])
def test_declutching_absorbs_while_the_damper_is_engaged(time: float) -> None:
    params = declutching.params({"arming_speed_m_per_s": (0.02,)}, NO_RAMP, DT)
    found = mean_power(declutching, params, declutching.SetPoint(-500.0, time))
    engaged = 0.5 - time / PERIOD + math.sin(4.0 * math.pi * time / PERIOD) / (4.0 * math.pi)
    # The damper engages up to a tick late: one of the 1000 ticks of a half period.
    assert found == pytest.approx(500.0 * SPEED**2 * engaged, abs=500.0 * SPEED**2 * 2e-3)


MASS, STIFFNESS = 1000.0, 39478.0  # kg, N/m: natural period 1.0 s
DAMPING = 400.0  # N*s/m, 3 % of critical
FORCE = 300.0  # N, amplitude of the excitation
LATCH = {
    "hold_stiffness_n_per_m": (2e8,),
    "hold_damping_n_s_per_m": (4e5,),
    "arming_speed_m_per_s": (0.01,),
}


def oscillate(latch: float, periods: int) -> float:
    """Stroke amplitude (m) of a latched oscillator in its last five periods; RK4."""
    params = latching.params(LATCH, NO_RAMP, DT)
    state, setpoint = latching.start(params), latching.SetPoint(0.0, latch)
    x, v, seen = 0.0, 0.0, []
    for tick in range(round(periods * PERIOD / DT)):
        state, demand = latching.step(params, state, setpoint, Estimate(x, v, 0.0), 0.0, 0.0, DT)
        x, v = advanced(x, v, tick * DT, demand.force)
        seen.append(x)
    last = np.array(seen[-round(5 * PERIOD / DT) :])
    return float(0.5 * (last.max() - last.min()))


def advanced(x: float, v: float, t: float, force: float) -> tuple[float, float]:
    """Position and velocity one tick later, the force of the law held."""

    def rate(at: float, x: float, v: float) -> tuple[float, float]:
        total_force = FORCE * math.cos(OMEGA * at) + force - STIFFNESS * x - DAMPING * v
        return v, total_force / MASS

    a1, b1 = rate(t, x, v)
    a2, b2 = rate(t + DT / 2, x + a1 * DT / 2, v + b1 * DT / 2)
    a3, b3 = rate(t + DT / 2, x + a2 * DT / 2, v + b2 * DT / 2)
    a4, b4 = rate(t + DT, x + a3 * DT, v + b3 * DT)
    return x + DT / 6 * (a1 + 2 * a2 + 2 * a3 + a4), v + DT / 6 * (b1 + 2 * b2 + 2 * b3 + b4)


def latched_amplitude(latch: float) -> float:
    """Amplitude (m) of the periodic motion with an ideal latch, from the solution piece by piece.

    Free from -X at rest to +X at rest within half a period less the latching time; the excitation
    has the phase p when the latch opens. Two equations for X and p.
    """
    free = 0.5 * PERIOD - latch
    decay = DAMPING / (2.0 * MASS)
    damped = math.sqrt(STIFFNESS / MASS - decay**2)
    response = FORCE / complex(STIFFNESS - MASS * OMEGA**2, OMEGA * DAMPING)

    def missed(unknown: Any) -> list[float]:
        amplitude, phase = unknown
        turned = response * complex(math.cos(phase), math.sin(phase))
        first = -amplitude - turned.real
        second = (OMEGA * turned.imag + decay * first) / damped
        later = turned * complex(math.cos(OMEGA * free), math.sin(OMEGA * free))
        cosine, sine_ = math.cos(damped * free), math.sin(damped * free)
        shrunk = math.exp(-decay * free)
        x = shrunk * (first * cosine + second * sine_) + later.real
        v = (
            shrunk * ((damped * second - decay * first) * cosine)
            - shrunk * ((damped * first + decay * second) * sine_)
            - OMEGA * later.imag
        )
        return [x - amplitude, v / damped]

    # At the best time the velocity is in phase: the excitation turns through zero half way.
    (amplitude, _), _, found, _ = fsolve(missed, [0.05, -0.5 * math.pi * free / 1.0], full_output=1)
    assert found == 1
    return float(amplitude)


@pytest.mark.parametrize("latch", [0.3, 0.4, 0.5])
def test_latching_moves_an_oscillator_as_the_piecewise_solution(latch: float) -> None:
    """1 %: the latch closes up to a tick late, half of one on average."""
    expected = latched_amplitude(latch + 0.5 * DT)
    assert oscillate(latch, periods=100) == pytest.approx(expected, rel=0.01)


def test_the_best_latching_time_is_half_the_difference_of_the_periods() -> None:
    """Budal and Falnes: (T - T_0) / 2 = 0.5 s here, and several times the amplitude without."""
    times = [0.0, 0.3, 0.4, 0.5, 0.6, 0.7]
    found = [oscillate(time, periods=30) for time in times]
    assert times[int(np.argmax(found))] == 0.5
    assert max(found) > 3.0 * found[0]


def test_a_latched_body_stays_where_it_turned() -> None:
    params = latching.params(LATCH, NO_RAMP, DT)
    state, x, v, drift = latching.start(params), 0.0, 0.0, 0.0
    for tick in range(20_000):
        state, demand = latching.step(
            params, state, latching.SetPoint(0.0, 0.5), Estimate(x, v, 0.0), 0.0, 0.0, DT
        )
        x, v = advanced(x, v, tick * DT, demand.force)
        if state.latched == 1:
            drift = max(drift, abs(x - state.position))
    # The largest load on the latch is the spring of the body, 39478 N/m, over its stroke.
    assert drift < 1.05 * (STIFFNESS * 0.15 + FORCE) / 2e8
