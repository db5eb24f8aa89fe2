"""The response session of the flap: angle per metre of elevation, line by line of the sea.

Convention e^{+i omega t}: the elevation of a line is Re(A e^{i (omega t + phase)}), t on the wave
clock, and the response is H = angle / elevation, so a positive phase leads. The fit over frequency
is a resonance under an excitation that grows smoothly with frequency:

    |H| = |e0 + e1 w + e2 w^2| / sqrt((w0^2 - w^2)^2 + (2 d w)^2)
"""

import itertools
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import least_squares

from rig.kinds.oswec_bench.products import figures, periods
from rig.kinds.oswec_bench.products.estimate import (
    Estimate,
    Floats,
    format_number,
    jackknifed,
    mean,
)
from rig.kinds.oswec_bench.products.periods import Complexes
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import Columns, Result, compare, table

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

    @property
    def at_peak(self) -> str:
        """The peak and its period, for people."""
        return f"{self.peak} at {self.period}"


def response_lines(
    angle: Floats, edges: Any, sea: dict[str, Any], start_clock: float, dt: float
) -> list[ResponseLine]:
    """Return the response at every line of a sea that repeats between ``edges`` of ``angle`` (rad).

    ``start_clock`` is the wave clock at the first of these samples.
    """
    lines = []
    pieces = list(itertools.pairwise(edges))
    method = f"{len(pieces)} periods, by their scatter"
    for cycles, amplitude, phase in zip(
        sea["cycles"], sea["amplitude_m"], sea["phase_rad"], strict=True
    ):
        omega = 2.0 * np.pi * cycles / sea["repeat_s"]
        elevation = amplitude * np.exp(1j * phase)
        waves = [np.exp(-1j * omega * (dt * np.arange(a, b) + start_clock)) for a, b in pieces]
        angles = [2.0 * np.mean(angle[a:b] * w) for (a, b), w in zip(pieces, waves, strict=True)]
        responses: Complexes = np.array(angles) / elevation
        response = responses.mean()
        magnitude = mean(np.abs(responses), "rad/m", method)._replace(value=float(abs(response)))
        lines.append(ResponseLine(omega / (2.0 * np.pi), amplitude, complex(response), magnitude))
    return lines


def fitted_magnitude(unknowns: Any, omega: Floats) -> Floats:
    """Return |H| by the fit, rad/m."""
    natural_frequency, damping, *excitation = unknowns
    stiffness = natural_frequency * natural_frequency - omega * omega
    denominator = np.hypot(stiffness, 2.0 * damping * omega)
    magnitude: Floats = np.abs(np.polyval(excitation[::-1], omega)) / denominator
    return magnitude


def fit_resonance(lines: list[ResponseLine]) -> Resonance | None:
    """Return the fit over lines of different frequency; None for fewer than `MIN_LINES`."""
    if len(lines) < MIN_LINES:
        return None
    omega = 2.0 * np.pi * np.array([each.frequency for each in lines])
    magnitude = np.array([each.magnitude.value for each in lines])
    peak_omega = float(omega[np.argmax(magnitude)])
    excitation = 0.3 * peak_omega * peak_omega * float(magnitude.max())
    start = np.array([peak_omega, 0.15 * peak_omega, excitation, 0.0, 0.0])
    unknowns = _fit_unknowns(omega, magnitude, start)
    left_out = [
        _peak(_fit_unknowns(omega[kept], magnitude[kept], unknowns), omega)
        for kept in ~np.eye(len(lines), dtype=bool)
    ]
    method = f"resonance through {len(lines)} lines, jackknife over them"
    period, peak = jackknifed(_peak(unknowns, omega), left_out, ("s", "rad/m"), method)
    deviation = magnitude / fitted_magnitude(unknowns, omega) - 1.0
    return Resonance(unknowns, period, peak, float(np.sqrt(np.mean(deviation**2))))


def _fit_unknowns(omega: Floats, magnitude: Floats, start: Floats) -> Floats:
    low = [0.2 * omega.min(), 1e-3, -np.inf, -np.inf, -np.inf]
    high = [2.0 * omega.max(), omega.max(), np.inf, np.inf, np.inf]
    solved = least_squares(
        lambda x: fitted_magnitude(x, omega) / magnitude - 1.0,
        np.clip(start, low, high),
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


class ResponseCurve(NamedTuple):
    """All lines of one wave amplitude (regular), or of one row (irregular), by frequency."""

    label: str
    suffix: str  # of the names of its constants
    lines: list[ResponseLine]
    resonance: Resonance | None


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run in regular waves, or in an irregular sea."""
    responses = [
        (point, setpoint_response(point))
        for point in session.complete_points
        if point.plan_row.get("sea")
    ]
    if not responses:
        raise ValueError("no set point with waves was measured completely")
    curves = _curves(session, responses)
    constants: dict[str, Estimate] = {}
    comparisons = []
    for label, suffix, _, resonance in curves:
        if resonance is not None:
            constants[f"flap_rao_period{suffix}"] = resonance.period
            constants[f"flap_rao_top{suffix}"] = resonance.peak
            rms_percent = format_number(100.0 * resonance.relative_rms, 2)
            measured = f"{resonance.at_peak}; rms error of points {rms_percent} %"
            comparisons.append(compare(f"peak of the response, waves {label}", measured, "not run"))
    rows = [(each.label, line) for each in curves for line in each.lines]
    return Result(
        (table("flap_rao", "Response amplitude operator", rows, COLUMNS),),
        tuple(comparisons),
        constants,
        (flap_rao(curves),),
        (
            "Waves are those requested from the wave maker, calibrated without the flap; a "
            "positive phase leads the crest at the hinge.",
        ),
    )


def setpoint_response(point: SetpointData) -> list[ResponseLine]:
    """Return the response at the lines of a set point's sea, drift removed."""
    cut = point.whole_periods()
    edges = cut.edges - cut.edges[0]
    start_clock = point.wave_clock - point.encoder_age
    angle = periods.detrend(point.shaft, cut)
    return response_lines(angle, edges, point.plan_row["sea"], start_clock, point.dt)


def _curves(
    session: SessionRun, responses: list[tuple[SetpointData, list[ResponseLine]]]
) -> list[ResponseCurve]:
    groups: dict[tuple[int, float], list[ResponseLine]] = {}
    for point, lines in responses:
        row = point.row if session.irregular else -1
        key = row, point.plan_value("wave_amplitude_m")
        groups.setdefault(key, []).extend(lines)
    curves = []
    for (row, wave), lines in sorted(groups.items()):
        lines.sort(key=lambda each: each.frequency)
        label, suffix = f"{1e3 * wave:g} mm", f"_{round(1e3 * wave)}mm"
        if session.irregular:
            label, suffix = f"irregular, crest {label}", f"_row{row}"
        suffix = "" if len(groups) == 1 else suffix
        curves.append(ResponseCurve(label, suffix, lines, fit_resonance(lines)))
    return curves


COLUMNS: Columns[tuple[str, ResponseLine]] = {
    "waves": lambda r: r[0],
    "frequency [Hz]": lambda r: r[1].frequency,
    "period [s]": lambda r: 1.0 / r[1].frequency,
    "wave amplitude [m]": lambda r: r[1].wave_amplitude,
    "amplitude of the flap [deg]": lambda r: float(
        np.degrees(r[1].wave_amplitude * r[1].magnitude.value)
    ),
    "response [rad/m]": lambda r: r[1].magnitude,
    "phase [deg]": lambda r: float(np.degrees(np.angle(r[1].response))),
}


@figures.figure(
    "Response amplitude operator of the flap",
    "Points with 95 % intervals; lines: the fitted resonance.",
    axes=("frequency, Hz", "response, rad/m", "phase, deg"),
    size=(7.4, 5.8),
    height_ratios=(1.7, 1.0),
)
def flap_rao(panels: list[Axes], curves: list[ResponseCurve]) -> None:
    upper, lower = panels
    single = len(curves) == 1
    for each, shade in figures.shaded(curves):
        colour = figures.BLUE if single else shade
        f = np.array([line.frequency for line in each.lines])
        magnitudes = [line.magnitude for line in each.lines]
        figures.draw_intervals(upper, f, magnitudes, color=colour, label=each.label)
        phase = np.degrees(np.unwrap([np.angle(line.response) for line in each.lines]))
        lower.plot(f, phase - 360.0 * np.round(phase[0] / 360.0), "o-", ms=4, lw=0.8, color=colour)
        if each.resonance is not None:
            grid = np.linspace(f.min(), f.max(), 400)
            fitted = fitted_magnitude(each.resonance.unknowns, 2.0 * np.pi * grid)
            upper.plot(grid, fitted, color=figures.RED if single else colour, lw=1.2)
    peaks = [f"{each.label}: peak {each.resonance.at_peak}" for each in curves if each.resonance]
    figures.annotate_corner(upper, "\n".join(peaks), "upper right")
    upper.set_ylim(0.0, None)
    figures.legend(upper, "lower left", title="waves")
