"""Frequency-domain oracle of the linear WaveBot, independent of the plant's step.

Phasors here are e^{+i omega t} (impedance convention, as the measured Z_i); BEM excitation is
e^{-i omega t} and therefore conjugated. Force on the body, absorbed power negative.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim_plant.bem import Bem, excitation_at
from sim_plant.wavebot import WaveBotParams

Complexes = NDArray[np.complex128]


class Response(NamedTuple):
    """Mean powers (W) and amplitudes of one row; for a spectrum amplitudes are sqrt(2) sigma."""

    trs: float
    lcb: float
    ac: float
    dc: float
    stroke: float  # m
    velocity: float  # m/s
    current: float  # A


def radiation(params: WaveBotParams, f_hz: ArrayLike, bem: Bem | None = None) -> Complexes:
    """K_r(jw), N s/m: the plant's own five states, or the BEM table if given."""
    s = 2j * np.pi * np.asarray(f_hz, dtype=float)
    body = params.body
    if bem is None:
        num = [body.b4, body.b3, body.b2, body.b1, 0.0]
        den = [1.0, body.a4, body.a3, body.a2, body.a1, body.a0]
        return np.asarray(np.polyval(num, s) / np.polyval(den, s))
    f = np.asarray(f_hz, dtype=float)
    added = np.interp(f, bem.frequency, bem.added_mass) - bem.added_mass_infinite
    return np.asarray(np.interp(f, bem.frequency, bem.damping) + s * added)


def intrinsic_impedance(
    params: WaveBotParams, f_hz: ArrayLike, bem: Bem | None = None, speed: float = 0.0
) -> Complexes:
    """Z_i = F_LCB/v, N s/m; quadratic drag linearised at a velocity amplitude `speed` (m/s)."""
    s = 2j * np.pi * np.asarray(f_hz, dtype=float)
    body = params.body
    drag = body.viscous + body.quadratic * 8.0 / (3.0 * np.pi) * speed
    return s * body.inertia + radiation(params, f_hz, bem) + drag + body.hydrostatic / s


def controller(kp: float, ki: float, delay: float = 0.0) -> Callable[[ArrayLike], Complexes]:
    """C(jw) = (Kp + Ki/jw) exp(-jw delay), force on the body per velocity."""

    def response(f_hz: ArrayLike) -> Complexes:
        s = 2j * np.pi * np.asarray(f_hz, dtype=float)
        return np.asarray((kp + ki / s) * np.exp(-s * delay))

    return response


def heave_response(
    params: WaveBotParams,
    hull: Bem,
    f_hz: ArrayLike,
    amplitude: ArrayLike,
    kp: float,
    ki: float,
    spring_rate: float,
    controller_response: Callable[[ArrayLike], Complexes] | None = None,
    *,
    bem_radiation: bool = False,
) -> Response:
    """Mean power at TRS, LCB, AC and DC and the stroke of one row of the linear plant.

    `f_hz` (Hz) and `amplitude` (m) are one wave or the components of a spectrum; mean |i| is that
    of a sinusoid (2/pi of the peak) or Gaussian (sqrt(2/pi) sigma) accordingly. Coulomb friction
    and quadratic drag are left out: use it with the linear plant. `spring_rate` is N/m, K_s.
    """
    f = np.atleast_1d(np.asarray(f_hz, dtype=float))
    a = np.atleast_1d(np.asarray(amplitude, dtype=float))
    s = 2j * np.pi * f
    control = (controller_response or controller(kp, ki))(f)
    coupling = params.pto.viscous + spring_rate / s
    impedance = intrinsic_impedance(params, f, hull if bem_radiation else None)
    velocity = np.conj(excitation_at(hull, f)) * a / (impedance + coupling - control)
    force = control * velocity
    square_v = np.abs(velocity) ** 2
    trs = float(np.sum(0.5 * control.real * square_v))
    lcb = float(np.sum(0.5 * (control - coupling).real * square_v))
    square_force = float(np.sum(0.5 * np.abs(force) ** 2))
    ac = trs + params.pto.copper * square_force
    sigma = np.sqrt(square_force) / params.pto.force_per_current
    mean_size = sigma * (np.sqrt(8.0) / np.pi if f.size == 1 else np.sqrt(2.0 / np.pi))
    drive = params.electrics.cots
    loss = drive.fixed_loss + drive.linear_loss * mean_size + drive.square_loss * sigma * sigma
    stroke = float(np.sqrt(np.sum(np.abs(velocity / s) ** 2)))
    return Response(
        trs,
        lcb,
        ac,
        ac + float(loss),
        stroke,
        float(np.sqrt(square_v.sum())),
        float(sigma * 2**0.5),
    )
