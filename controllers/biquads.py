"""A rational filter as second-order sections in cascade: y(z) = H_n(z) ... H_1(z) u(z).

One section is H(z) = (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2) in transposed direct
form II (Oppenheim and Schafer, Discrete-Time Signal Processing, section 6.4):

    y = b0 u + s1        s1' = b1 u - a1 y + s2        s2' = b2 u - a2 y

The input's unit is whatever feeds it and the output's whatever the first section's gain makes of
it. A value that is not finite stays in the state until the filter starts afresh.

The functions walk the tuple of sections by recursion, because a tuple's length is part of its type
once the law is compiled.
"""

from typing import NamedTuple


class Biquad(NamedTuple):
    """Coefficients of one section, normalised to a0 = 1."""

    b0: float  # output's unit per input's unit, in the first section; 1 in the others; so b1, b2
    b1: float  # as b0
    b2: float  # as b0
    a1: float  # 1
    a2: float  # 1


class SectionState(NamedTuple):
    """Memory of one section, in the unit of its output."""

    s1: float  # what the next output holds already, whatever the next input
    s2: float  # what the one after it holds


def start(sections: tuple[Biquad, ...]) -> tuple[SectionState, ...]:
    """Empty memory: no output until there is an input."""
    if len(sections) == 0:
        return ()
    return (SectionState(0.0, 0.0), *start(sections[1:]))


def step(
    sections: tuple[Biquad, ...], states: tuple[SectionState, ...], u: float
) -> tuple[tuple[SectionState, ...], float]:
    """One tick of the whole cascade; no section at all passes ``u`` through."""
    if len(sections) == 0:
        return (), u
    b0, b1, b2, a1, a2 = sections[0]
    s1, s2 = states[0]
    y = b0 * u + s1
    after, out = step(sections[1:], states[1:], y)
    return (SectionState(b1 * u - a1 * y + s2, b2 * u - a2 * y), *after), out


def held(sections: tuple[Biquad, ...], states: tuple[SectionState, ...], u: float) -> float:
    """The output for an input ``u``, nothing stepped: with 0.0 what the states alone give."""
    if len(sections) == 0:
        return u
    return held(sections[1:], states[1:], sections[0].b0 * u + states[0].s1)


def scaled(states: tuple[SectionState, ...], factor: float) -> tuple[SectionState, ...]:
    """All memory times ``factor``: the filter's free response is scaled by just that."""
    if len(states) == 0:
        return ()
    s1, s2 = states[0]
    return (SectionState(s1 * factor, s2 * factor), *scaled(states[1:], factor))
