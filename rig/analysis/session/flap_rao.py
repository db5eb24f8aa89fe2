"""The flap's response to waves: angle per metre of elevation, line by line of the sea.

e^{+i omega t}: the elevation of a line is Re(A e^{i (omega t + phase)}), t on the wave clock, and
the response H = angle / elevation, so a positive phase leads. The fit over frequency is a resonance
under an excitation that grows smoothly with frequency:

    |H| = |e0 + e1 w + e2 w^2| / sqrt((w0^2 - w^2)^2 + (2 d w)^2)
"""

import itertools
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from rig.analysis.session.estimate import Estimate, Floats, jackknife, mean
from rig.analysis.session.periods import Complexes

LEAST = 7
"""Lines, for a fit of five unknowns."""


class Line(NamedTuple):
    """The response at one line of a sea."""

    frequency: float  # Hz
    wave: float  # m, amplitude of the elevation without the flap
    response: complex  # rad/m
    size: Estimate  # rad/m, by scatter of the periods


class Resonance(NamedTuple):
    """The fit, and where its top is."""

    unknowns: Floats  # w0, d, e0, e1, e2
    period: Estimate  # s, of the top
    top: Estimate  # rad/m
    off: float  # root mean square of measured over fitted size, less 1


def lines(angle: Floats, edges: Any, sea: dict[str, Any], clock: float, dt: float) -> list[Line]:
    """The response at every line of a sea that repeats between ``edges`` of ``angle`` (rad).

    ``clock``: of the waves, when the first of these samples was taken.
    """
    found = []
    parts = list(itertools.pairwise(edges))
    for cycles, amplitude, phase in zip(
        sea["cycles"], sea["amplitude_m"], sea["phase_rad"], strict=True
    ):
        omega = 2.0 * np.pi * cycles / sea["repeat_s"]
        each: Complexes = np.array([
            2.0 * np.mean(angle[a:b] * np.exp(-1j * omega * (dt * np.arange(a, b) + clock)))
            for a, b in parts
        ]) / (amplitude * np.exp(1j * phase))  # fmt: skip
        size = mean(np.abs(each), "rad/m", f"{len(parts)} periods, by their scatter")
        size = size._replace(value=float(abs(each.mean())))
        found.append(Line(omega / (2.0 * np.pi), amplitude, complex(each.mean()), size))
    return found


def fitted_size(unknowns: Any, omega: Floats) -> Floats:
    """|H| by the fit, rad/m."""
    own, rate, *push = unknowns
    under = np.hypot(own * own - omega * omega, 2.0 * rate * omega)
    out: Floats = np.abs(np.polyval(push[::-1], omega)) / under
    return out


def resonance(found: list[Line]) -> Resonance | None:
    """The fit over lines of different frequency; None for fewer than `LEAST` of them."""
    if len(found) < LEAST:
        return None
    omega = 2.0 * np.pi * np.array([each.frequency for each in found])
    size = np.array([each.size.value for each in found])
    unknowns = _fit(omega, size, _start(omega, size))
    whole = _top(unknowns, omega)
    everyone = np.arange(len(found))
    fewer = np.array([
        _top(_fit(omega[everyone != i], size[everyone != i], unknowns), omega) for i in everyone
    ])  # fmt: skip
    half = jackknife(whole, fewer)
    how = f"resonance through {len(found)} lines, jackknife over them"
    off = float(np.sqrt(np.mean((size / fitted_size(unknowns, omega) - 1.0) ** 2)))
    return Resonance(
        unknowns,
        Estimate(float(whole[0]), float(half[0]), "s", how),
        Estimate(float(whole[1]), float(half[1]), "rad/m", how),
        off,
    )


def _start(omega: Floats, size: Floats) -> Floats:
    own = float(omega[np.argmax(size)])
    return np.array([own, 0.15 * own, 0.3 * own * own * float(size.max()), 0.0, 0.0])


def _fit(omega: Floats, size: Floats, start: Floats) -> Floats:
    low = [0.2 * omega.min(), 1e-3, -np.inf, -np.inf, -np.inf]
    high = [2.0 * omega.max(), omega.max(), np.inf, np.inf, np.inf]
    begin = np.clip(start, low, high)
    solved = least_squares(
        lambda x: fitted_size(x, omega) / size - 1.0, begin, bounds=(low, high), x_scale="jac"
    )
    out: Floats = solved.x
    return out


def _top(unknowns: Floats, omega: Floats) -> Floats:
    """Period (s) and size (rad/m) of the fit's top within the measured frequencies."""
    fine = np.linspace(omega.min(), omega.max(), 4000)
    size = fitted_size(unknowns, fine)
    at = int(np.argmax(size))
    return np.array([2.0 * np.pi / fine[at], size[at]])
