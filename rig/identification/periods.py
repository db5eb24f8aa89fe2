"""Repeat periods of a record as complex amplitudes, line by line. Pure.

Whole periods go through an FFT, so no line leaks into another one and no window is needed. A record
of even samples x_n at t_n = t_0 + n dt has the amplitudes

    X_k = 2/N sum x_n e^{-i omega_k t_n},    x(t) = Re sum X_k e^{i omega_k t},  omega_k = 2 pi k/T
"""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]
Flags = npt.NDArray[np.bool_]
Ticks = npt.NDArray[np.int64]

MOST_LOST = 0.01  # of a window's ticks: with more missing it is not used
EXCITED = 0.1  # of the greatest amplitude of the reference: a line below is none of its lines
_NEARLY = 1e-6  # ticks


def whole_ticks(periods: list[float], dt: float, most: int) -> int:
    """Ticks after which everything that repeats after ``periods`` (s) repeats together.

    Raises ValueError where that is longer than ``most`` ticks, or no whole number of them: a sine
    may take several of its periods to end on a tick.
    """
    ticks = []
    for period in periods:
        once = period / dt
        for times in range(1, int(most / once + _NEARLY) + 1):
            if abs(times * once - round(times * once)) < _NEARLY * times:
                ticks.append(round(times * once))
                break
        else:
            raise ValueError(f"what repeats after {period:.6g} s repeats on no tick of the window")
    both = math.lcm(*ticks)
    if both > most:
        told = " and ".join(f"{period:.6g} s" for period in periods)
        raise ValueError(f"the window of {most * dt:.6g} s holds no common period of {told}")
    return both


def filled(ticks: Ticks, values: Floats) -> Floats:
    """The values on every tick of their span; those of lost ticks on a line between neighbours.

    Raises ValueError where more than 1 % of the ticks are missing, or a value is not finite.
    """
    if not np.isfinite(values).all():
        raise ValueError("a value that is not finite")
    span = int(ticks[-1] - ticks[0]) + 1
    if span == len(ticks):
        return values
    if span - len(ticks) > MOST_LOST * span:
        raise ValueError(f"{span - len(ticks)} of {span} ticks are missing")
    return np.asarray(np.interp(np.arange(span), ticks - ticks[0], values), dtype=np.float64)


def amplitudes(values: Floats, start: float, dt: float, period: int, lines: int) -> Complexes:
    """Complex amplitude of lines 1 .. ``lines`` in each whole period; periods by lines.

    ``start`` (s) is the time of the first value, ``period`` the ticks of a repeat period; what is
    left of the values after the last whole period is not used.
    """
    count = len(values) // period
    pieces = values[: count * period].reshape(count, period)
    found = np.fft.rfft(pieces, axis=1)[:, 1 : lines + 1] * (2.0 / period)
    omega = angular(period * dt, lines)
    starts = start + dt * period * np.arange(count)
    return np.asarray(found * np.exp(-1j * np.outer(starts, omega)), dtype=np.complex128)


def angular(period: float, lines: int) -> Floats:
    """Angular frequency of lines 1 .. ``lines`` of a repeat period (s), rad/s."""
    return np.asarray(2.0 * np.pi / period * np.arange(1, lines + 1), dtype=np.float64)


def excited(reference: Complexes) -> Flags:
    """Which lines a reference has."""
    size = np.abs(reference)
    return np.asarray(size > EXCITED * size.max(initial=0.0), dtype=np.bool_)


def synthesised(lines: Complexes) -> Floats:
    """One repeat period of a signal from its lines, 64 samples to the highest line's period."""
    samples = 64 * len(lines)
    whole = np.zeros(samples // 2 + 1, dtype=np.complex128)
    whole[1 : len(lines) + 1] = 0.5 * samples * lines
    return np.asarray(np.fft.irfft(whole, samples), dtype=np.float64)


def analysed(samples: Floats, count: int) -> Complexes:
    """The first ``count`` lines of a signal over one repeat period."""
    return np.asarray(np.fft.rfft(samples)[1 : count + 1] * (2.0 / len(samples)), np.complex128)
