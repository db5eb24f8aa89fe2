"""Fits a passive five-state radiation model to a BEM file; no part of the program.

    .venv/bin/python configs/plants/fit_radiation.py configs/plants/wavebot_surge_bem.npz

K(s) = (b4 s4 + b3 s3 + b2 s2 + b1 s) / (s5 + a4 s4 + ... + a0) shall follow K_r = B + i omega
(A - A_inf). For given poles the best numerator is a linear programme: the largest relative error
over 0.2-1 Hz (a quarter of the weight down to 0.05 and up to 1.5 Hz) is least, subject to
Re K(i omega) >= 0 on a dense grid and a4 b4 >= b3 for what lies beyond it. The poles are found by
a simplex search from several starts.
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog, minimize

from sim_plant.bem import Bem, radiation_impedance, read_bem

Floats = NDArray[np.float64]

DIRECTIONS = np.exp(2j * np.pi * np.arange(24) / 24)  # a modulus as a 24-gon: 0.9 % of itself
GRID = 2.0 * np.pi * np.logspace(-3.0, 2.0, 240)  # rad/s, where Re K >= 0 is asked for
STARTS = 12


def denominator(shape: Floats) -> Floats:
    """Give s5 + a4 s4 + ... + a0 from log(real pole), and log(omega), log(zeta) of two pairs."""
    polynomial = np.array([1.0, np.exp(shape[0])])
    for omega, zeta in np.exp(shape[1:]).reshape(2, 2):
        polynomial = np.polymul(polynomial, [1.0, 2.0 * zeta * omega, omega**2])
    return polynomial


def columns(omega: Floats, den: Floats) -> NDArray[np.complex128]:
    """Give what b4, b3, b2, b1 each contribute to K(i omega)."""
    s = 1j * omega
    return np.column_stack([s**4, s**3, s**2, s]) / np.polyval(den, s)[:, None]


def numerator(bem: Bem, den: Floats) -> tuple[float, Floats]:
    """Give the largest weighted relative error and b4, b3, b2, b1 of the best passive numerator."""
    inside = (bem.frequency > 0.04) & (bem.frequency < 1.5)
    frequency, table = bem.frequency[inside], radiation_impedance(bem)[inside]
    weight = np.where((frequency >= 0.19) & (frequency <= 1.01), 1.0, 0.25) / np.abs(table)
    parts = columns(2.0 * np.pi * frequency, den)
    scale = np.abs(parts).max(axis=0)  # of each coefficient, for the solver's sake
    error = (weight[:, None] * parts / scale)[None] * DIRECTIONS[:, None, None]
    bound = ((weight * table)[None] * DIRECTIONS[:, None]).real.ravel()
    rows = [np.column_stack([error.real.reshape(bound.size, 4), -np.ones(bound.size)])]
    rest = columns(GRID, den).real / scale
    size = np.abs(rest).max(axis=1)
    rows.append(np.column_stack([-rest / size[:, None], np.zeros(size.size)]))
    rows.append(np.array([[-den[1] / scale[0], 1.0 / scale[1], 0.0, 0.0, 0.0]]))
    found = linprog(
        [0.0, 0.0, 0.0, 0.0, 1.0],
        A_ub=np.vstack(rows),
        b_ub=np.concatenate([bound, np.zeros(size.size + 1)]),
        bounds=[(None, None)] * 5,
    )
    if found.x is None:
        return 1.0, np.zeros(4)
    return float(found.fun), found.x[:4] / scale


def fit(bem: Bem, seed: int = 1) -> tuple[float, Floats, Floats]:
    """Give error, numerator and denominator of the best of several searches."""
    rng = np.random.default_rng(seed)
    best = (np.inf, np.zeros(4), np.zeros(6))
    for _ in range(STARTS):
        start = np.log([4.0, 3.0, 0.5, 6.0, 0.5]) + 0.4 * rng.standard_normal(5)
        found = minimize(
            lambda shape: numerator(bem, denominator(shape))[0],
            start,
            method="Nelder-Mead",
            options={"maxfev": 600, "xatol": 1e-5, "fatol": 1e-7},
        )
        if found.fun < best[0]:
            den = denominator(found.x)
            best = (float(found.fun), numerator(bem, den)[1], den)
            print(f"{100.0 * best[0]:.3f} %", flush=True)
    return best


if __name__ == "__main__":
    worst, num, den = fit(read_bem(Path(sys.argv[1])))
    # What stands in the file is rounded, so the rounded model is what must hold.
    print("numerator  ", [float(f"{b:.7g}") for b in num])
    print("denominator", [float(f"{a:.7g}") for a in den[1:]])
