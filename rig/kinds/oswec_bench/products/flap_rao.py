"""Response of the flap to waves: angle per metre of elevation, line by line of the sea.

Convention e^{+i omega t}: the elevation of a line is Re(A e^{i (omega t + phase)}), t on the wave
clock, and the response is H = angle / elevation, so a positive phase leads. The fit over frequency
is a resonance under an excitation that grows smoothly with frequency:

    |H| = |e0 + e1 w + e2 w^2| / sqrt((w0^2 - w^2)^2 + (2 d w)^2)
"""

import itertools
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, jackknife, mean
from rig.kinds.oswec_bench.products.periods import Complexes

MIN_LINES = 7
"""Minimum number of lines for a fit of five unknowns."""


class ResponseLine(NamedTuple):
    """The response at one line of a sea."""

    frequency: float  # Hz
    wave_amplitude: float  # m, amplitude of the elevation without the flap
    response: complex  # rad/m
    magnitude: Estimate  # rad/m, interval by scatter of the periods


class Resonance(NamedTuple):
    """The fitted resonance, and its peak."""

    unknowns: Floats  # w0, d, e0, e1, e2
    period: Estimate  # s, of the peak
    peak: Estimate  # rad/m
    relative_rms: float  # rms of measured over fitted magnitude, less 1


def response_lines(
    angle: Floats, edges: Any, sea: dict[str, Any], start_clock: float, dt: float
) -> list[ResponseLine]:
    """Return the response at every line of a sea that repeats between ``edges`` of ``angle`` (rad).

    ``start_clock`` is the wave clock at the first of these samples.
    """
    lines = []
    periods = list(itertools.pairwise(edges))
    for cycles, amplitude, phase in zip(
        sea["cycles"], sea["amplitude_m"], sea["phase_rad"], strict=True
    ):
        omega = 2.0 * np.pi * cycles / sea["repeat_s"]
        responses: Complexes = np.array([
            2.0 * np.mean(angle[a:b] * np.exp(-1j * omega * (dt * np.arange(a, b) + start_clock)))
            for a, b in periods
        ]) / (amplitude * np.exp(1j * phase))  # fmt: skip
        magnitude = mean(np.abs(responses), "rad/m", f"{len(periods)} periods, by their scatter")
        magnitude = magnitude._replace(value=float(abs(responses.mean())))
        lines.append(
            ResponseLine(omega / (2.0 * np.pi), amplitude, complex(responses.mean()), magnitude)
        )
    return lines


def fitted_magnitude(unknowns: Any, omega: Floats) -> Floats:
    """Return |H| by the fit, rad/m."""
    natural_frequency, damping, *excitation = unknowns
    denominator = np.hypot(
        natural_frequency * natural_frequency - omega * omega, 2.0 * damping * omega
    )
    magnitude: Floats = np.abs(np.polyval(excitation[::-1], omega)) / denominator
    return magnitude


def fit_resonance(lines: list[ResponseLine]) -> Resonance | None:
    """Return the fit over lines of different frequency; None for fewer than `MIN_LINES`."""
    if len(lines) < MIN_LINES:
        return None
    omega = 2.0 * np.pi * np.array([each.frequency for each in lines])
    magnitude = np.array([each.magnitude.value for each in lines])
    unknowns = _fit_unknowns(omega, magnitude, _start_unknowns(omega, magnitude))
    values = _peak(unknowns, omega)
    indices = np.arange(len(lines))
    leave_one_out = np.array(
        [
            _peak(_fit_unknowns(omega[indices != i], magnitude[indices != i], unknowns), omega)
            for i in indices
        ]
    )
    half_widths = jackknife(values, leave_one_out)
    method = f"resonance through {len(lines)} lines, jackknife over them"
    relative_rms = float(
        np.sqrt(np.mean((magnitude / fitted_magnitude(unknowns, omega) - 1.0) ** 2))
    )
    return Resonance(
        unknowns,
        Estimate(float(values[0]), float(half_widths[0]), "s", method),
        Estimate(float(values[1]), float(half_widths[1]), "rad/m", method),
        relative_rms,
    )


def _start_unknowns(omega: Floats, magnitude: Floats) -> Floats:
    peak_frequency = float(omega[np.argmax(magnitude)])
    return np.array(
        [
            peak_frequency,
            0.15 * peak_frequency,
            0.3 * peak_frequency * peak_frequency * float(magnitude.max()),
            0.0,
            0.0,
        ]
    )


def _fit_unknowns(omega: Floats, magnitude: Floats, start: Floats) -> Floats:
    low = [0.2 * omega.min(), 1e-3, -np.inf, -np.inf, -np.inf]
    high = [2.0 * omega.max(), omega.max(), np.inf, np.inf, np.inf]
    bounded_start = np.clip(start, low, high)
    solved = least_squares(
        lambda x: fitted_magnitude(x, omega) / magnitude - 1.0,
        bounded_start,
        bounds=(low, high),
        x_scale="jac",
    )
    unknowns: Floats = solved.x
    return unknowns


def _peak(unknowns: Floats, omega: Floats) -> Floats:
    """Return period (s) and magnitude (rad/m) of the fit's peak within the measured frequencies."""
    frequencies = np.linspace(omega.min(), omega.max(), 4000)
    magnitude = fitted_magnitude(unknowns, frequencies)
    largest = int(np.argmax(magnitude))
    return np.array([2.0 * np.pi / frequencies[largest], magnitude[largest]])
