"""Signal generator: a force that people set while the loop runs.

    sine    F = A sin(2 pi phase),  d phase / dt = f
    step    F = A
    chirp   as sine; f runs from f_1 to f_2 at a constant rate in a time T, then starts over

A is ramped, so the force never jumps: a change of A takes the ramp's duration. Another kind of
signal first ramps A to zero. A change of frequency keeps the phase.

Bad input: an amplitude or a frequency that is not finite gives a force that is not finite, which
the limits turn into a stop.
"""

from math import floor, pi, sin
from typing import NamedTuple

from controllers.blocks import Ramp, finite, ramp_start, ramp_step
from controllers.signals import Newton, Second

NONE, SINE, STEP, CHIRP = range(4)
KINDS = ("none", "sine", "step", "chirp")
"""Names of the kinds of signals, in the order of their numbers."""


class Params(NamedTuple):
    """Constants of the generator."""

    ramp: Second  # duration of a change of the amplitude


class SetPoint(NamedTuple):
    """A signal; for a rotating axis read N m for N."""

    kind: float  # number of `KINDS`
    amplitude: float  # N
    frequency: float  # Hz, of a sine; the first one of a chirp
    end_frequency: float  # Hz, of a chirp
    sweep: float  # s, duration of a chirp


NO_SIGNAL = SetPoint(0.0, 0.0, 0.0, 0.0, 0.0)


class State(NamedTuple):
    """Memory from tick to tick."""

    amplitude: Ramp
    kind: float  # of the signal that acts
    phase: float  # 0 .. 1, of a period
    elapsed: float  # s since the chirp began


def start() -> State:
    """Return the state at rest."""
    return State(ramp_start(0.0), 0.0, 0.0, 0.0)


def at_rest(state: State, signal: SetPoint) -> bool:
    """Return whether the force is zero and remains so."""
    return state.amplitude.value == 0.0 and signal.amplitude == 0.0


def step(params: Params, state: State, signal: SetPoint, dt: float) -> tuple[State, Newton]:
    """Return the force (N)."""
    amplitude, kind, phase, elapsed = state
    if kind != signal.kind and amplitude.value == 0.0:
        kind, phase, elapsed = signal.kind, 0.0, 0.0
    target = signal.amplitude if kind == signal.kind and kind != NONE else 0.0
    amplitude = ramp_step(amplitude, target, params.ramp, dt)
    if kind == STEP:
        return State(amplitude, kind, 0.0, 0.0), amplitude.value
    force = amplitude.value * sin(2.0 * pi * phase) if finite(phase) else phase
    frequency = signal.frequency
    if kind == CHIRP and signal.sweep > 0.0:
        share = (elapsed + 0.5 * dt) / signal.sweep  # in the middle of the tick: its mean
        frequency = frequency + (signal.end_frequency - frequency) * share
        elapsed = elapsed + dt
        if elapsed >= signal.sweep:
            elapsed = 0.0
    phase = phase + frequency * dt
    if finite(phase):
        phase = phase - floor(phase)
    return State(amplitude, kind, phase, elapsed), force


def columns(count: int) -> tuple[tuple[float, ...], ...]:
    """Return the columns of ``count`` set points without a signal."""
    kind, amplitude, frequency, end_frequency, sweep = NO_SIGNAL
    return (
        (kind,) * count,
        (amplitude,) * count,
        (frequency,) * count,
        (end_frequency,) * count,
        (sweep,) * count,
    )
