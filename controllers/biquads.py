"""A rational filter as second-order sections in cascade: y(z) = H_n(z) ... H_1(z) u(z).

One section is H(z) = (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2) in transposed direct
form II (Oppenheim and Schafer, Discrete-Time Signal Processing, section 6.4):

    y = b0 u + s1        s1' = b1 u - a1 y + s2        s2' = b2 u - a2 y

The input has any unit; the gain of the first section gives the output its unit. A value that is
not finite stays in the state until the filter starts afresh.

The functions recurse over the tuple of sections, because the length of a tuple is part of its type
in compiled code.
"""

from cmath import exp
from typing import NamedTuple


class Biquad(NamedTuple):
    """Coefficients of one section, normalised to a0 = 1."""

    b0: float  # output unit per input unit in the first section, 1 in the others; so b1, b2
    b1: float  # as b0
    b2: float  # as b0
    a1: float  # 1
    a2: float  # 1


class SectionState(NamedTuple):
    """Memory of one section, in the unit of its output."""

    s1: float  # contribution to the next output, independent of the next input
    s2: float  # contribution to the output after that


def start(sections: tuple[Biquad, ...]) -> tuple[SectionState, ...]:
    """Return the empty memory: no output until there is an input."""
    if len(sections) == 0:
        return ()
    return (SectionState(0.0, 0.0), *start(sections[1:]))


def step(
    sections: tuple[Biquad, ...], states: tuple[SectionState, ...], u: float
) -> tuple[tuple[SectionState, ...], float]:
    """Return the memory and the output after one tick; an empty cascade passes ``u`` through."""
    if len(sections) == 0:
        return (), u
    b0, b1, b2, a1, a2 = sections[0]
    s1, s2 = states[0]
    y = b0 * u + s1
    after, out = step(sections[1:], states[1:], y)
    return (SectionState(b1 * u - a1 * y + s2, b2 * u - a2 * y), *after), out


def output(sections: tuple[Biquad, ...], states: tuple[SectionState, ...], u: float) -> float:
    """Return the output for an input ``u`` without a step; for 0.0 that of the memory alone."""
    if len(sections) == 0:
        return u
    return output(sections[1:], states[1:], sections[0].b0 * u + states[0].s1)


def scale_states(states: tuple[SectionState, ...], factor: float) -> tuple[SectionState, ...]:
    """Return the memory times ``factor``: this scales the free response by ``factor``."""
    if len(states) == 0:
        return ()
    s1, s2 = states[0]
    return (SectionState(s1 * factor, s2 * factor), *scale_states(states[1:], factor))


def response(sections: tuple[Biquad, ...], angle: float) -> complex:
    """Return H(exp(j angle)), ``angle`` in rad per tick; zero for an empty cascade."""
    if len(sections) == 0:
        return 0j
    delay, product = exp(-1j * angle), 1.0 + 0j
    for b0, b1, b2, a1, a2 in sections:
        numerator = b0 + delay * (b1 + delay * b2)
        product = product * numerator / (1.0 + delay * (a1 + delay * a2))
    return product
