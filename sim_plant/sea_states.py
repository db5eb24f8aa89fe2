"""Periodic seas and their elevation and excitation tables over exactly one repeat period.

Elevation is Re(sum a_k e^{-i omega_k t}) at the device, undisturbed, t on the wave clock; the phase
convention is that of bem.py. Every component is at a multiple of 1/repeat, so the table repeats
bit for bit.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim_plant.bem import Bem, Complexes, Floats, excitation_at
from sim_plant.units import Hertz, Metre, Second

Integers = NDArray[np.int64]

MIN_FREQUENCY = 0.05  # Hz, of a generated spectrum
MAX_FREQUENCY = 2.0  # Hz: no excitation above it
MAX_REPEAT = 3600  # s
GRAVITY = 9.81  # m/s2, of the BEM files


class Sea(NamedTuple):
    """A periodic sea: component k has frequency cycles[k]/repeat."""

    repeat: Second
    cycles: Integers  # whole periods of each component in one repeat
    amplitude: Complexes  # m, elevation is Re(a e^{-i omega t})
    description: dict[str, float | str]  # kind, hm0_m, hm0_raw_m (before normalisation), ...


class WaveTables(NamedTuple):
    """Elevation (m) and excitation force (N) at every tick of one repeat period."""

    elevation: Floats
    excitation: Floats


def frequencies(sea: Sea) -> Floats:
    """Return the component frequencies, Hz."""
    frequency: Floats = sea.cycles / sea.repeat
    return frequency


def hm0(sea: Sea) -> Metre:
    """Return the significant wave height 4 sqrt(m0) of a sea, m."""
    return float(4.0 * np.sqrt(0.5 * np.sum(np.abs(sea.amplitude) ** 2)))


def calm() -> Sea:
    """Return still water (repeat 1 s)."""
    return _make_sea(
        1.0, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.complex128), kind="calm"
    )


def regular(amplitude_m: Metre, frequency_hz: Hertz) -> Sea:
    """Return one cosine of an amplitude (m, not a height) and frequency (Hz), crest at t = 0.

    The repeat period is the denominator of the frequency's rational, in seconds: 0.3 Hz gives
    10 s, 1/3.45 Hz gives 69 s. Raises ValueError if no repeat period up to 3600 s exists.
    """
    _require(math.isfinite(amplitude_m) and amplitude_m >= 0.0, "amplitude must be >= 0 m")
    _require(0.0 < frequency_hz <= MAX_FREQUENCY, f"frequency must be in (0, {MAX_FREQUENCY}] Hz")
    fraction = Fraction(frequency_hz).limit_denominator(MAX_REPEAT)
    if abs(float(fraction) - frequency_hz) > 1.0e-12 * frequency_hz:
        raise ValueError(
            f"a regular sea of {frequency_hz!r} Hz repeats on no whole second up to "
            f"{MAX_REPEAT} s; the nearest that does is {fraction} = {float(fraction)!r} Hz"
        )
    return _make_sea(
        float(fraction.denominator),
        np.array([fraction.numerator], dtype=np.int64),
        np.array([amplitude_m], dtype=np.complex128),
        kind="regular",
        amplitude_m=amplitude_m,
        frequency_hz=frequency_hz,
    )


def jonswap_density(frequency: Floats, hs_m: Metre, tp_s: Second, gamma: float) -> Floats:
    """Return the JONSWAP density, m²/Hz, at frequencies > 0 (Hz).

    Source: IEC TS 62600-2, annex C (normalising factor 1 - 0.287 ln gamma).
    """
    peak = 1.0 / tp_s
    ratio = peak / frequency
    width = np.where(frequency <= peak, 0.07, 0.09)
    enhanced = gamma ** np.exp(-((frequency / peak - 1.0) ** 2) / (2.0 * width**2))
    moskowitz = 0.3125 * hs_m**2 * ratio**4 / frequency * np.exp(-1.25 * ratio**4)
    density: Floats = (1.0 - 0.287 * math.log(gamma)) * moskowitz * enhanced
    return density


def jonswap(hs_m: Metre, tp_s: Second, gamma: float, repeat_s: Second, seed: int) -> Sea:
    """Return a JONSWAP sea of random phases at k/repeat, 0.05-2 Hz, normalised so that Hm0 = Hs.

    The description contains `hm0_raw_m`, the height before normalisation. Raises ValueError for
    values outside hs >= 0, tp 0.5-20 s, gamma 1-10, repeat 10-3600 s.
    """
    _require(math.isfinite(hs_m) and hs_m >= 0.0, "hs must be >= 0 m")
    _require(0.5 <= tp_s <= 20.0, "tp must be 0.5-20 s")
    _require(1.0 <= gamma <= 10.0, "gamma must be 1-10")
    _require(10.0 <= repeat_s <= MAX_REPEAT, f"repeat must be 10-{MAX_REPEAT} s")
    first_cycle = math.ceil(MIN_FREQUENCY * repeat_s - 1.0e-9)
    last_cycle = math.floor(MAX_FREQUENCY * repeat_s + 1.0e-9)
    cycles = np.arange(first_cycle, last_cycle + 1, dtype=np.int64)
    density = jonswap_density(cycles / repeat_s, hs_m, tp_s, gamma)
    amplitude = np.sqrt(2.0 * density / repeat_s)
    raw_hm0 = float(4.0 * np.sqrt(0.5 * np.sum(amplitude**2)))
    if raw_hm0 > 0.0:
        amplitude = amplitude * (hs_m / raw_hm0)
    phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, cycles.size)
    return _make_sea(
        repeat_s,
        cycles,
        np.asarray(amplitude * np.exp(1j * phase), dtype=np.complex128),
        kind="jonswap",
        hm0_raw=raw_hm0,
        hs_m=hs_m,
        tp_s=tp_s,
        gamma=gamma,
        seed=float(seed),
    )


def components(
    repeat_s: Second, cycles: ArrayLike, amplitude_m: ArrayLike, phase_rad: ArrayLike
) -> Sea:
    """Return the sea sum amplitude cos(2 pi cycles t / repeat + phase) of the listed components.

    ``cycles`` are whole numbers >= 1, rising; amplitudes in m >= 0, phases in rad. Raises
    ValueError for lists of different lengths or invalid values, a component above 2 Hz (which would
    not excite the device), or a repeat outside (0, 3600] s.
    """
    count = np.asarray(cycles, dtype=np.float64)
    amplitude = np.asarray(amplitude_m, dtype=np.float64)
    phase = np.asarray(phase_rad, dtype=np.float64)
    equal_lengths = count.ndim == 1 and count.shape == amplitude.shape == phase.shape
    _require(
        equal_lengths and count.size > 0,
        "components are three lists of one length, at least 1 long",
    )
    _require(0.0 < repeat_s <= MAX_REPEAT, f"repeat must be in (0, {MAX_REPEAT}] s")
    is_whole = np.isfinite(count) & (count >= 1.0) & (count == np.floor(count))
    rising = bool(np.all(np.diff(count) > 0.0))
    _require(bool(is_whole.all()) and rising, "cycles must be whole numbers >= 1 that rise")
    _require(
        float(count[-1]) <= MAX_FREQUENCY * repeat_s * (1.0 + 1.0e-12),
        f"a component of {count[-1] / repeat_s:g} Hz; allowed up to {MAX_FREQUENCY:g} Hz",
    )
    finite = bool(np.all(np.isfinite(amplitude)) and np.all(np.isfinite(phase)))
    _require(finite and bool(np.all(amplitude >= 0.0)), "amplitudes must be >= 0 m, phases finite")
    return _make_sea(
        float(repeat_s),
        count.astype(np.int64),
        np.asarray(amplitude * np.exp(-1j * phase), dtype=np.complex128),  # the sea is e^{-i}
        kind="components",
    )


def recorded(elevation: ArrayLike, rate_hz: Hertz) -> Sea:
    """Return the sea that repeats a measured elevation window (m) sampled at a rate (Hz).

    The window is treated as exactly one period and its mean is removed. Raises ValueError if it is
    shorter than 4 samples, not finite, or longer than 3600 s.
    """
    record = np.asarray(elevation, dtype=np.float64)
    _require(record.ndim == 1 and record.size >= 4, "a record is one row of at least 4 samples")
    _require(bool(np.all(np.isfinite(record))), "a record must be finite")
    repeat = record.size / rate_hz
    _require(repeat <= MAX_REPEAT, f"a record may last {MAX_REPEAT} s")
    # The bin at half the rate has no defined phase between samples and is left out.
    bins = np.fft.rfft(record - record.mean())[1 : (record.size + 1) // 2]
    cycles = np.arange(1, bins.size + 1, dtype=np.int64)
    amplitude = np.asarray(np.conj(bins) * (2.0 / record.size), dtype=np.complex128)
    return _make_sea(repeat, cycles, amplitude, kind="recorded", rate_hz=rate_hz)


def tables(sea: Sea, bem: Bem, dt: Second) -> WaveTables:
    """Return elevation and excitation force over one repeat period, one value per dt.

    Raises ValueError if the repeat period is no whole number of dt, or a component is at or above
    half the tick rate. Components above 2 Hz contribute to the elevation but not to the excitation.
    """
    return WaveTables(elevation_at(sea, 0.0, dt), excitation(sea, bem, dt))


def elevation_at(sea: Sea, x: Metre, dt: Second) -> Floats:
    """Return the undisturbed elevation over one repeat period at a position x along the waves (m).

    Deep water: a component arrives with the phase k x, k = omega²/g. Raises as `tables`.
    """
    omega = 2.0 * np.pi * frequencies(sea)
    phase_shift = np.exp(1j * omega**2 / GRAVITY * x)
    return _synthesise(sea.cycles, sea.amplitude * phase_shift, _count_ticks(sea, dt))


def excitation(sea: Sea, bem: Bem, dt: Second) -> Floats:
    """Return the excitation force over one repeat period in the bem's degree of freedom, N.

    Raises as `tables`.
    """
    frequency = frequencies(sea)
    excites = frequency <= MAX_FREQUENCY * (1.0 + 1.0e-12)
    force = np.where(excites, excitation_at(bem, frequency) * sea.amplitude, 0.0)
    return _synthesise(sea.cycles, force, _count_ticks(sea, dt))


def _count_ticks(sea: Sea, dt: Second) -> int:
    length = round(sea.repeat / dt)
    if length < 1 or abs(length * dt - sea.repeat) > 1.0e-9 * sea.repeat:
        raise ValueError(f"the sea repeats in {sea.repeat} s, no whole number of {dt} s")
    if sea.cycles.size and 2 * int(sea.cycles.max()) >= length:
        raise ValueError(f"the sea has components at or above half the tick rate of {dt} s")
    return length


def _synthesise(cycles: Integers, amplitude: Complexes, length: int) -> Floats:
    bins = np.zeros(length // 2 + 1, dtype=np.complex128)
    bins[cycles] = np.conj(amplitude) * (0.5 * length)  # irfft is e^{+i}, the sea is e^{-i}
    return np.fft.irfft(bins, length)


def _make_sea(
    repeat: Second,
    cycles: Integers,
    amplitude: Complexes,
    *,
    kind: str,
    hm0_raw: float | None = None,
    **details: float,
) -> Sea:
    height = float(4.0 * np.sqrt(0.5 * np.sum(np.abs(amplitude) ** 2)))
    raw_hm0 = height if hm0_raw is None else hm0_raw
    description: dict[str, float | str] = {"kind": kind, "repeat_s": repeat, "hm0_m": height}
    return Sea(repeat, cycles, amplitude, {**description, "hm0_raw_m": raw_hm0, **details})


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise ValueError(message)
