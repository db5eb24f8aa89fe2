"""Complex amplitudes of the repeat periods of a record, line by line.

The functions are pure. The FFT covers whole periods, so there is no leakage and no window is
needed. A record of evenly spaced samples x_n at t_n = t_0 + n dt has the amplitudes

    X_k = 2/N sum x_n e^{-i omega_k t_n},    x(t) = Re sum X_k e^{i omega_k t},  omega_k = 2 pi k/T
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]
Flags = npt.NDArray[np.bool_]
Ticks = npt.NDArray[np.int64]

WAVE_CLOCK = "plan.wave_clock"
MAX_LOST_SHARE = 0.01  # share of missing ticks above which a window is not used
EXCITED_SHARE = 0.1  # of a reference's largest amplitude, above which a line counts as excited
_TICK_TOLERANCE = 1e-6  # ticks


def common_period_ticks(periods: list[float], dt: float, max_ticks: int) -> int:
    """Return the common period of ``periods`` (s), in ticks.

    A sine may need several of its periods to end on a tick. Raises ValueError if the common period
    is longer than ``max_ticks`` or not a whole number of ticks.
    """
    ticks = []
    for period in periods:
        period_ticks = period / dt
        if period_ticks > max_ticks + _TICK_TOLERANCE:
            raise ValueError(
                f"its window of {max_ticks * dt:.6g} s is shorter than the period of {period:.6g} s"
            )
        for repeats in range(1, int(max_ticks / period_ticks + _TICK_TOLERANCE) + 1):
            whole = repeats * period_ticks
            if abs(whole - round(whole)) < _TICK_TOLERANCE * repeats:
                ticks.append(round(whole))
                break
        else:
            raise ValueError(f"a period of {period:.6g} s ends on no tick of the window")
    common = math.lcm(*ticks)
    if common > max_ticks:
        period_list = " and ".join(f"{period:.6g} s" for period in periods)
        raise ValueError(
            f"the window of {max_ticks * dt:.6g} s holds no common period of {period_list}"
        )
    return common


def fill_lost_ticks(ticks: Ticks, values: Floats) -> Floats:
    """Return the values on every tick of their span; lost ticks are interpolated linearly.

    Raises ValueError if more than 1 % of the ticks are missing or a value is not finite.
    """
    if not np.isfinite(values).all():
        raise ValueError("the record has a value that is not finite")
    span = int(ticks[-1] - ticks[0]) + 1
    if span == len(ticks):
        return values
    if span - len(ticks) > MAX_LOST_SHARE * span:
        raise ValueError(f"{span - len(ticks)} of {span} ticks are missing")
    return np.asarray(np.interp(np.arange(span), ticks - ticks[0], values), dtype=np.float64)


def amplitudes(values: Floats, start: float, dt: float, period: int, lines: int) -> Complexes:
    """Return the complex amplitudes of lines 1 .. ``lines`` in each whole period; periods by lines.

    ``start`` (s) is the time of the first value, ``period`` the ticks of a repeat period. Values
    after the last whole period are not used.
    """
    count = len(values) // period
    blocks = values[: count * period].reshape(count, period)
    spectra = np.fft.rfft(blocks, axis=1)[:, 1 : lines + 1] * (2.0 / period)
    omega = angular_frequencies(period * dt, lines)
    starts = start + dt * period * np.arange(count)
    return np.asarray(spectra * np.exp(-1j * np.outer(starts, omega)), dtype=np.complex128)


def field_lines(
    data: Any, field: str, age: str, dt: float, period: int, lines: int, scale: float = 1.0
) -> Complexes:
    """Return the amplitudes of a logged field on the wave clock; periods by lines.

    They are shifted to the sampling time by the mean of the field ``age`` (s; empty: no age).
    """
    values = fill_lost_ticks(data["tick"], data[field].astype(np.float64) * scale)
    found = amplitudes(values, float(data[WAVE_CLOCK][0]), dt, period, lines)
    late = float(data[age].mean()) if age else 0.0
    omega = angular_frequencies(period * dt, lines)
    return np.asarray(found * np.exp(1j * omega * late), dtype=np.complex128)


def angular_frequencies(period: float, lines: int) -> Floats:
    """Return the angular frequency of lines 1 .. ``lines`` of a repeat period (s), rad/s."""
    return np.asarray(2.0 * np.pi / period * np.arange(1, lines + 1), dtype=np.float64)


def excited_lines(reference: Complexes) -> Flags:
    """Return True for each line that a reference excites."""
    magnitude = np.abs(reference)
    return np.asarray(magnitude > EXCITED_SHARE * magnitude.max(initial=0.0), dtype=np.bool_)


def synthesise(lines: Complexes) -> Floats:
    """Return one repeat period of a signal from its lines, 64 samples per highest-line period."""
    samples = 64 * len(lines)
    spectrum = np.zeros(samples // 2 + 1, dtype=np.complex128)
    spectrum[1 : len(lines) + 1] = 0.5 * samples * lines
    return np.asarray(np.fft.irfft(spectrum, samples), dtype=np.float64)


def analyse(samples: Floats, count: int) -> Complexes:
    """Return the first ``count`` lines of a signal over one repeat period."""
    return np.asarray(np.fft.rfft(samples)[1 : count + 1] * (2.0 / len(samples)), np.complex128)
