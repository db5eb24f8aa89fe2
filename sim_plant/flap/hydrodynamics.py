"""Frequency-domain coefficients of the flap from its radiation model.

Excitation follows from radiation by the Haskind relation, so both belong to one linear flap: nu = k
|X|²/(8 rho g c_g) for a body whose radiated waves vary as the cosine of the direction, as those of
a narrow flap do (Falnes, Ocean Waves and Oscillating Systems). X leads the elevation by a quarter
period, as the acceleration of the water does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim_plant.bem import Bem, Floats
from sim_plant.flap.body import FlapBodyParams
from sim_plant.sea_states import GRAVITY, MAX_FREQUENCY
from sim_plant.units import KilogramSquareMetre, Metre

DENSITY = 1000.0  # kg/m3
MIN_FREQUENCY, FREQUENCY_STEP = 0.02, 0.002  # Hz, of the table


def radiation(params: FlapBodyParams, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
    """Return nu + i omega (mu - mu_inf), N m s/rad, for e^{+i omega t}."""
    s = 2j * np.pi * np.asarray(frequency_hz, dtype=np.float64)
    return np.asarray(params.r1 * s / (s * s + params.d1 * s + params.d0), dtype=np.complex128)


def impedance(params: FlapBodyParams, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
    """Return the intrinsic impedance, moment over velocity, N m s/rad, e^{+i omega t}.

    Its modulus is the optimal damping of a PTO without a spring (OSWEC thesis, eq. 2.2, in which
    the printed velocity must be the frequency omega). Quadratic drag is neglected.
    """
    s = 2j * np.pi * np.asarray(frequency_hz, dtype=np.float64)
    hydrostatic_part = s * params.inertia + params.viscous + params.buoyancy / s
    return np.asarray(hydrostatic_part + radiation(params, frequency_hz), dtype=np.complex128)


def wave_number(omega: Floats, depth: Metre) -> Floats:
    """Return k of omega² = g k tanh(k h), 1/m, by Newton's method from the deep/shallow limit."""
    deep = omega * omega / GRAVITY
    k = np.maximum(deep, omega / np.sqrt(GRAVITY * depth))
    for _ in range(20):
        tanh = np.tanh(k * depth)
        slope = tanh + k * depth * (1.0 - tanh * tanh)
        k = k - (k * tanh - deep) / slope
    return np.asarray(k, dtype=np.float64)


def group_velocity(omega: Floats, depth: Metre) -> Floats:
    """Return the speed of wave energy, m/s."""
    k = wave_number(omega, depth)
    double_kh = 2.0 * k * depth
    return np.asarray(0.5 * omega / k * (1.0 + double_kh / np.sinh(double_kh)), dtype=np.float64)


def coefficients(params: FlapBodyParams, added_inertia: KilogramSquareMetre, depth: Metre) -> Bem:
    """Return the flap's coefficients over frequency, per radian and per metre of wave amplitude.

    `added_inertia` is mu_inf, which `params` contain only in the sum. Phases are those of bem.py.
    """
    frequency = np.arange(MIN_FREQUENCY, MAX_FREQUENCY + 2.0 * FREQUENCY_STEP, FREQUENCY_STEP)
    omega = 2.0 * np.pi * frequency
    memory = radiation(params, frequency)
    k, speed = wave_number(omega, depth), group_velocity(omega, depth)
    magnitude = np.sqrt(8.0 * DENSITY * GRAVITY * speed * memory.real / k)
    return Bem(
        frequency,
        added_inertia + memory.imag / omega,
        memory.real,
        np.asarray(-1j * magnitude, dtype=np.complex128),
        added_inertia,
        params.buoyancy,
        depth,
    )
