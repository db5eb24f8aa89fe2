"""Frequency-domain coefficients of the flap, from its own radiation model.

Excitation follows from radiation by the Haskind relation, so both belong to one linear flap:
nu = k |X|²/(8 rho g c_g) for a body whose waves go out as the cosine of the direction, which a
narrow flap's do (Falnes, Ocean Waves and Oscillating Systems). X leads the elevation by a quarter
period, as the acceleration of the water does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim_plant.bem import Bem, Floats
from sim_plant.flap.body import FlapBodyParams
from sim_plant.units import KilogramSquareMetre, Metre
from sim_plant.waves import GRAVITY, HIGHEST

DENSITY = 1000.0  # kg/m3
LOWEST, SPACING = 0.02, 0.002  # Hz, of the table


def radiation(params: FlapBodyParams, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
    """Give nu + i omega (mu - mu_inf), N m s/rad, as seen by e^{+i omega t}."""
    s = 2j * np.pi * np.asarray(frequency_hz, dtype=np.float64)
    return np.asarray(params.r1 * s / (s * s + params.d1 * s + params.d0), dtype=np.complex128)


def impedance(params: FlapBodyParams, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
    """Give the intrinsic impedance, moment over velocity, N m s/rad, e^{+i omega t}.

    Its modulus is the best damping of a PTO without a spring (OSWEC thesis, eq. 2.2, in which the
    velocity printed must be the frequency omega). Quadratic drag is left out.
    """
    s = 2j * np.pi * np.asarray(frequency_hz, dtype=np.float64)
    own = s * params.inertia + params.viscous + params.buoyancy / s
    return np.asarray(own + radiation(params, frequency_hz), dtype=np.complex128)


def wave_number(omega: Floats, depth: Metre) -> Floats:
    """Give k of omega² = g k tanh(k h), 1/m, by Newton's method from the deep or shallow limit."""
    deep = omega * omega / GRAVITY
    k = np.maximum(deep, omega / np.sqrt(GRAVITY * depth))
    for _ in range(20):
        tanh = np.tanh(k * depth)
        slope = tanh + k * depth * (1.0 - tanh * tanh)
        k = k - (k * tanh - deep) / slope
    return np.asarray(k, dtype=np.float64)


def group_velocity(omega: Floats, depth: Metre) -> Floats:
    """Give the speed at which waves carry energy, m/s."""
    k = wave_number(omega, depth)
    twice = 2.0 * k * depth
    return np.asarray(0.5 * omega / k * (1.0 + twice / np.sinh(twice)), dtype=np.float64)


def coefficients(params: FlapBodyParams, added: KilogramSquareMetre, depth: Metre) -> Bem:
    """Give the flap's table over frequency, per radian and metre of wave amplitude.

    `added` is mu_inf, which `params` hold only in the sum. Phases are those of bem.py.
    """
    frequency = np.arange(LOWEST, HIGHEST + 2.0 * SPACING, SPACING)
    omega = 2.0 * np.pi * frequency
    memory = radiation(params, frequency)
    k, speed = wave_number(omega, depth), group_velocity(omega, depth)
    size = np.sqrt(8.0 * DENSITY * GRAVITY * speed * memory.real / k)
    return Bem(
        frequency,
        added + memory.imag / omega,
        memory.real,
        np.asarray(-1j * size, dtype=np.complex128),
        added,
        params.buoyancy,
        depth,
    )
