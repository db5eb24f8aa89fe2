"""Sections of Z_c(s): against scipy, against sines through the law, and refused designs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from random_examples import examples
from scipy import signal

from controllers import impedance
from controllers.signals import Estimate, Gains
from rig.design.impedance import BAND, TOLERANCE, design, evaluate, response

DT = 0.001
# The radiation of the WaveBot, five states fitted to BEM, as an absorbing Z_c.
RADIATION = (
    [-4594.69, -75223.29, -668098.5, -543002.2, 0.0],
    [1.0, 18.185, 155.3015, 660.4136, 1316.647, 922.0699],
)
# Near the conjugate of the intrinsic impedance at 0.55 Hz: damping, and a decaying spring.
MATCHED = ([-2650.0, -9000.0, 0.0], [1.0, 0.9, 0.2])
LAG = ([-3000.0], [2.0, 1.0])
NOTCH = ([-1500.0, 0.0, -1500.0 * 9.0], [1.0, 2.0, 9.0])
TRIPLE = ([4e4], [1.0, 9.0, 27.0, 27.0])  # three poles in one place
EXAMPLES = [RADIATION, MATCHED, LAG, NOTCH, TRIPLE]
IDS = ["radiation", "matched", "lag", "notch", "triple"]

Polynomials = tuple[list[float], list[float]]


@pytest.mark.parametrize("zc", EXAMPLES, ids=IDS)
def test_the_response_is_scipys(zc: Polynomials) -> None:
    """`evaluate` against freqs, `response` against freqz_sos: same formulas, other code."""
    f = np.geomspace(0.01, 10.0, 300)
    _, expected = signal.freqs(*zc, worN=2.0 * np.pi * f)
    assert evaluate(*zc, f) == pytest.approx(expected, rel=1e-12)
    sections = design(*zc, DT)
    rows = [(*section[:3], 1.0, *section[3:]) for section in sections]
    _, expected = signal.freqz_sos(rows, worN=f, fs=1.0 / DT)
    assert response(sections, f, DT) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("zc", EXAMPLES, ids=IDS)
def test_the_sections_are_the_bilinear_transform(zc: Polynomials) -> None:
    """H(z) = Z_c(2/T (z-1)/(z+1)) at every frequency: the definition, not scipy's method."""
    f = np.geomspace(0.05, 490.0, 200)
    z = np.exp(2j * np.pi * f * DT)
    s = 2.0 / DT * (z - 1.0) / (z + 1.0)
    expected = np.polyval(zc[0], s) / np.polyval(zc[1], s)
    got = response(design(*zc, DT), f, DT)
    assert np.abs(got - expected).max() <= 1e-7 * np.abs(expected).max()


@pytest.mark.parametrize("zc", EXAMPLES, ids=IDS)
@pytest.mark.parametrize("f_hz", [0.05, 0.2, 0.5, 1.0, 2.0])
def test_a_sine_through_the_law_shows_zc(zc: Polynomials, f_hz: float) -> None:
    """Amplitude and phase of the force per velocity, tick by tick, within the stated tolerance."""
    sections = design(*zc, DT)
    law = impedance.Params(0.0, sections)
    state = impedance.start(law)
    settle, period = 25.0, round(1.0 / f_hz / DT)  # s, of the slowest pole, 0.3 rad/s; ticks
    first = math.ceil(settle / DT / period) * period
    total = 0j
    for tick in range(first + period):
        turn = np.exp(2j * np.pi * tick / period)
        estimate = Estimate(0.0, 0.3 * float(turn.real), 0.0)
        state, demand = impedance.step(law, state, Gains(0.0, 0.0, 0.0), estimate, 0.0, 0.0, DT)
        if tick >= first:
            total += demand.force * np.conj(turn)
    measured = total * 2.0 / period / 0.3
    expected = evaluate(*zc, f_hz)
    floor = 0.01 * np.abs(evaluate(*zc, np.geomspace(*BAND, 400))).max()
    assert abs(measured - expected) <= TOLERANCE * max(abs(expected), floor)


@given(
    st.lists(st.floats(0.02, 300.0), max_size=3),
    st.lists(st.tuples(st.floats(0.1, 60.0), st.floats(0.05, 1.0)), max_size=2),
    st.lists(st.floats(-100.0, 100.0), max_size=7),
    st.floats(-1e5, 1e5),
)
@settings(max_examples=examples(300))
def test_accepted_designs_are_stable_with_the_right_response(
    real: list[float], pairs: list[tuple[float, float]], zeros: list[float], gain: float
) -> None:
    """Any stable proper Z_c with poles near the wave band: stable sections, right response."""
    assume(abs(gain) > 1e-3)
    poles = [-p + 0j for p in real]
    for omega, zeta in pairs:
        pole = complex(-zeta * omega, omega * math.sqrt(1.0 - zeta * zeta))
        poles += [pole, pole.conjugate()]
    bottom = np.atleast_1d(np.real(np.poly(poles))).tolist()
    top = (gain * np.atleast_1d(np.real(np.poly(zeros[: len(poles)])))).tolist()
    sections = design(top, bottom, DT)
    assert len(sections) == max(1, math.ceil(len(poles) / 2))
    for _, _, _, a1, a2 in sections:
        assert np.abs(np.roots([1.0, a1, a2])).max() < 1.0
    f = np.geomspace(*BAND, 77)
    expected = np.asarray(evaluate(top, bottom, f))
    bound = TOLERANCE * np.maximum(np.abs(expected), 0.01 * np.abs(expected).max())
    assert np.all(np.abs(response(sections, f, DT) - expected) <= 1.1 * bound)


def test_a_zc_of_zero_has_no_sections() -> None:
    assert design([0.0], [1.0, 1.0], DT) == ()
    assert np.array_equal(response((), [0.1, 1.0], DT), [0.0, 0.0])


def test_a_constant_is_damping() -> None:
    (section,) = design([0.0, -4000.0], [2.0], DT)
    assert section == (-2000.0, 0.0, 0.0, 0.0, 0.0)


REFUSED = {
    "no list": (([], [1.0]), DT, "numerator needs a list"),
    "denominator": (([1.0], []), DT, "denominator needs a list"),
    "zero": (([1.0], [0.0, 0.0]), DT, "denominator is zero"),
    "nan": (([math.nan], [1.0]), DT, "numerator has coefficients that are not finite: [nan]"),
    "inf": (([1.0], [1.0, math.inf]), DT, "denominator has coefficients that are not finite"),
    "improper": (([1.0, 2.0, 3.0], [1.0, 2.0]), DT, "order 2, the denominator only 1"),
    "integrator": (([1.0], [1.0, 0.0]), DT, "not stable: poles at 0+0j rad/s"),
    "growing": (([1.0], [1.0, -1.0]), DT, "not stable: poles at 1+0j rad/s"),
    "swinging": (([1.0], [1.0, 0.0, 4.0]), DT, "not stable"),
    "all but an integrator": (
        ([1.0], [1.0, 1e-14]),
        DT,
        "damping of a pole is lost in rounding",
    ),
    "huge": (([1e300], [1e-300, 1.0]), DT, "not finite"),
    "slow ticks": (([1.0], [1.0, 0.1, 40.0]), 0.02, "differs from Z_c(j omega) by 15.3 % at 1.01"),
    "no period": (([1.0], [1.0, 1.0]), 0.0, "the period is 0 s"),
    "long period": (([1.0], [1.0, 1.0]), 0.2, "allowed are more than 0 up to 0.125"),
    "nan period": (([1.0], [1.0, 1.0]), math.nan, "the period is nan s"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_invalid_design_is_refused_with_its_reason(name: str) -> None:
    zc, dt, message = REFUSED[name]
    with pytest.raises(ValueError, match=r"^Z_c: ") as refusal:
        design(*zc, dt)
    assert message in str(refusal.value)


def test_all_problems_are_reported_at_once() -> None:
    with pytest.raises(ValueError, match="Z_c") as refusal:
        design([math.nan], [], -1.0)
    for part in ("period", "numerator", "denominator"):
        assert part in str(refusal.value)


@given(
    st.lists(st.floats(), max_size=6),
    st.lists(st.floats(), max_size=6),
    st.floats(1e-4, 0.01),
)
@settings(max_examples=examples(300))
def test_any_coefficients_are_accepted_or_refused(
    top: list[float], bottom: list[float], dt: float
) -> None:
    """No warning, no other error; accepted sections are finite and stable."""
    try:
        sections = design(top, bottom, dt)
    except ValueError as refusal:
        if not str(refusal).startswith("Z_c: "):
            raise
        return
    for section in sections:
        assert np.all(np.isfinite(section))
        assert abs(section.a2) < 1.0
        assert abs(section.a1) < 1.0 + section.a2
