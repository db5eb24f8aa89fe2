"""A force limit and the memory of Z_c: recovery, and harmlessness of the protection."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from controllers import biquads, impedance
from controllers.biquads import Biquad
from controllers.blocks import clamp
from controllers.signals import Estimate, Gains
from rig.design.impedance import design

DT = 0.001
NONE = Gains(0.0, 0.0, 0.0)
# k / s for k = -4000 N/m by the bilinear transform, which no design accepts: an integrator.
INTEGRATOR = (Biquad(-2.0, -2.0, 0.0, -1.0, 0.0),)
SLOW = design([-4000.0], [1.0, 0.01], DT)  # the same with a time constant of 100 s
RESONANT = design([-3000.0, 0.0], [1.0, 0.2, 16.0], DT)
# The radiation of the WaveBot, five states, as an absorbing Z_c: passive.
RADIATION = design(
    [-4594.69, -75223.29, -668098.5, -543002.2, 0.0],
    [1.0, 18.185, 155.3015, 660.4136, 1316.647, 922.0699],
    DT,
)
SHORTS = st.lists(
    st.tuples(st.sampled_from([0.0, -1.0, 1.0]) | st.floats(-5e3, 5e3), st.integers(1, 400)),
    min_size=1,
    max_size=8,
)


class Loop:
    """The law with a limiter at ``limit`` (N), with or without feedback of the deficit."""

    def __init__(
        self, sections: tuple[Biquad, ...], limit: float, protected: bool, gains: Gains = NONE
    ) -> None:
        self.law = impedance.Params(0.0, sections)
        self.state, self.short = impedance.start(self.law), 0.0
        self.limit, self.protected, self.gains = limit, protected, gains

    def granted(self, motion: Estimate) -> tuple[float, float]:
        """Return the granted and the demanded force (N)."""
        deficit = self.short if self.protected else 0.0
        self.state, demand = impedance.step(
            self.law, self.state, self.gains, motion, 0.0, deficit, DT
        )
        force = clamp(demand.force, -self.limit, self.limit)
        self.short = force - demand.force
        return force, demand.force


def after_reversal(sections: tuple[Biquad, ...], protected: bool) -> tuple[int, float]:
    """Return the ticks to leave the limit after the velocity turns, and the greatest demand."""
    loop = Loop(sections, 1000.0, protected)
    beyond = max(abs(loop.granted(Estimate(0.0, 0.3, 0.0))[1]) for _ in range(10_000))
    for tick in range(20_000):
        if abs(loop.granted(Estimate(0.0, -0.3, 0.0))[0]) < 1000.0:
            return tick, beyond
    return 20_000, beyond


@pytest.mark.parametrize("sections", [INTEGRATOR, SLOW])
def test_a_protected_memory_leaves_the_limit_at_once(
    sections: tuple[Biquad, ...],
) -> None:
    """After 10 s at the limit: one tracking time of excess instead of 9 s.

    The excess settles where back-calculation balances the input, dF/dt TRACKING = 60 N.
    """
    late, beyond = after_reversal(sections, protected=True)
    assert beyond <= 1000.0 + 4000.0 * 0.3 * impedance.TRACKING + 2.5
    assert late <= 1.05 * impedance.TRACKING / DT
    wound, far = after_reversal(sections, protected=False)
    assert far > 10_000.0
    assert wound > 7_000


def recover_from_push(
    sections: tuple[Biquad, ...], protected: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return position and granted force of a body pushed at twice the limit for 2 s, then free."""
    loop = Loop(sections, 1000.0, protected, Gains(-3100.0, 0.0, 0.0))
    x, v, mass = 0.0, 0.0, 600.0
    xs, forces = [], []
    for tick in range(16_000):
        force, _ = loop.granted(Estimate(x, v, 0.0))
        v += DT * (force + (2000.0 if tick < 2000 else 0.0)) / mass
        x += DT * v
        xs.append(x)
        forces.append(force)
    return np.array(xs), np.array(forces)


@pytest.mark.parametrize("sections", [INTEGRATOR, SLOW])
def test_recovery_from_the_limit_has_no_overshoot(sections: tuple[Biquad, ...]) -> None:
    """A critically damped body (zeta = Kp / 2 sqrt(k m) = 1) comes to rest without overshoot.

    Unprotected, the memory has grown with the whole path and drives the body back through the
    limit, where its damping is cut off too.
    """
    x, force = recover_from_push(sections, protected=True)
    back = x[x.argmax() :]
    swing = back.max() - back[-1]
    assert swing > 0.04  # it returns the energy within the limit
    assert back.min() >= back[-1] - 0.02 * swing
    wild, cut = recover_from_push(sections, protected=False)
    back = wild[wild.argmax() :]
    assert back.min() < -0.3  # far beyond its origin
    assert np.sum(np.abs(cut[2000:]) >= 1000.0) > 3 * np.sum(np.abs(force[2000:]) >= 1000.0)


@pytest.mark.parametrize("sections", [SLOW, RESONANT, RADIATION])
def test_within_limits_the_protection_changes_no_bit(sections: tuple[Biquad, ...]) -> None:
    rng = np.random.default_rng(1)
    motions = [Estimate(x, v, a) for x, v, a in (0.3 * rng.normal(size=(5000, 3))).tolist()]
    protected, unprotected = (
        Loop(sections, 1e9, protected=True),
        Loop(sections, 1e9, protected=False),
    )
    assert [protected.granted(m) for m in motions] == [unprotected.granted(m) for m in motions]
    assert protected.state == unprotected.state
    limit = 0.3 * max(abs(demand) for _, demand in map(unprotected.granted, motions))
    protected, unprotected = (
        Loop(sections, limit, protected=True),
        Loop(sections, limit, protected=False),
    )
    assert [protected.granted(m) for m in motions] != [unprotected.granted(m) for m in motions]


@pytest.mark.parametrize("sections", [SLOW, RESONANT, RADIATION])
@given(SHORTS, st.integers(0, 2**32 - 1))
@settings(max_examples=examples(40))
def test_no_limit_enlarges_the_force_of_zc(
    sections: tuple[Biquad, ...], shorts: list[tuple[float, int]], seed: int
) -> None:
    """|Z_c v| <= sum |h| max |v| for any limits, as for the filter without limits."""
    law = impedance.Params(0.0, sections)
    state = impedance.start(law)
    memory, impulse = biquads.start(sections), 0.0
    for tick in range(3200):
        memory, h = biquads.step(sections, memory, 1.0 if tick == 0 else 0.0)
        impulse += abs(h)
    rng = np.random.default_rng(seed)
    for deficit, ticks in shorts:
        for v in rng.choice([-0.4, 0.4], size=ticks).tolist():
            estimate = Estimate(0.0, v, 0.0)
            state, demand = impedance.step(law, state, NONE, estimate, 0.0, deficit, DT)
            assert abs(demand.force) <= 0.4 * impulse * (1.0 + 1e-9)


@pytest.mark.parametrize("sections", [INTEGRATOR, SLOW, RESONANT, RADIATION])
@given(SHORTS, st.integers(0, 2**32 - 1), st.floats(0.01, 3.0))
@settings(max_examples=examples(40))
def test_a_passive_zc_stays_passive_under_any_limits(
    sections: tuple[Biquad, ...], shorts: list[tuple[float, int]], seed: int, f_hz: float
) -> None:
    """The energy given to the body, sum of F v dt, is never positive, from the first tick on.

    The bilinear transform preserves positive realness; the memory only shrinks.
    """
    law = impedance.Params(0.0, sections)
    state = impedance.start(law)
    rng = np.random.default_rng(seed)
    given_, turnover, tick = 0.0, 0.0, 0
    for deficit, ticks in shorts:
        for noise in rng.normal(size=ticks).tolist():
            v = 0.3 * math.sin(2.0 * math.pi * f_hz * tick * DT) + 0.05 * noise
            estimate = Estimate(0.0, v, 0.0)
            state, demand = impedance.step(law, state, NONE, estimate, 0.0, deficit, DT)
            given_ += demand.force * v * DT
            turnover += abs(demand.force * v) * DT
            tick += 1
            assert given_ <= 1e-9 * turnover


def charged(sections: tuple[Biquad, ...]) -> impedance.State:
    state = impedance.start(impedance.Params(0.0, sections))
    for _ in range(500):
        state, _ = impedance.step(
            impedance.Params(0.0, sections), state, NONE, Estimate(0.0, 0.3, 0.0), 0.0, 0.0, DT
        )
    return state


def test_the_deficit_reduces_the_memory() -> None:
    law, state, still = impedance.Params(0.0, SLOW), charged(SLOW), Estimate(0.0, 0.0, 0.0)
    output = biquads.output(SLOW, state.sections, 0.0)
    assert output == pytest.approx(-4000.0 * 0.3 * 0.5, rel=0.01)
    for deficit in (20.0, 300.0):  # the demand was too low
        after, demand = impedance.step(law, state, NONE, still, 0.0, deficit, DT)
        assert demand.force == pytest.approx(output + DT / impedance.TRACKING * deficit, rel=1e-12)
        assert after.sections[0].s1 == pytest.approx(demand.force, rel=1e-4)  # decays a little
    for deficit in (1e7, math.inf):  # never past zero
        _, demand = impedance.step(law, state, NONE, still, 0.0, deficit, DT)
        assert demand.force == 0.0


@pytest.mark.parametrize("deficit", [-300.0, -math.inf, math.nan, 0.0, 5e-324])
def test_a_memory_of_the_other_sign_is_left_alone(deficit: float) -> None:
    """The demand was too high although the memory pulls down; or the deficit is unknown."""
    law, state, still = impedance.Params(0.0, SLOW), charged(SLOW), Estimate(0.0, 0.0, 0.0)
    _, demand = impedance.step(law, state, NONE, still, 0.0, deficit, DT)
    assert demand.force == biquads.output(SLOW, state.sections, 0.0)


def test_a_slew_limit_hardly_affects_the_memory() -> None:
    """20 ticks with deficits of up to 1000 N reduce the memory by no more than its share."""
    law, state, still = impedance.Params(0.0, SLOW), charged(SLOW), Estimate(0.0, 0.0, 0.0)
    before = biquads.output(SLOW, state.sections, 0.0)
    for tick in range(20):
        state, _ = impedance.step(law, state, NONE, still, 0.0, 1000.0 - 50.0 * tick, DT)
    lost = biquads.output(SLOW, state.sections, 0.0) - before
    assert lost == pytest.approx(DT / impedance.TRACKING * 10_500.0, rel=0.01)
