"""Recover the waves of a run, line by line of the spectrum, from its measurements.

Two methods, both over whole repeat periods and with amplitudes of e^{+i omega t} on the wave clock:

    from the undisturbed elevation, if logged (a simulated basin logs it): eta itself
    from measured forces:   eta = (L X - D - F) / H,   L(omega): force/X of the bare hull

(MASK4 report (Sandia), eq. 3.3, solved for the wave). F is the measured force of the power take-off
on the body, D that of quadratic drag at the measured velocity, H the excitation per metre of wave.
All rows had the same waves, so each line is the mean of all periods of all rows. The lines are
those of the wave maker's command: content between them is harmonics of the body, not sea. A line
that hardly excites the body is not observable in its forces and keeps its commanded amplitude.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from rig.recording.runs.windows import Window
from rig.spectra.periods import (
    WAVE_CLOCK,
    Complexes,
    Floats,
    angular_frequencies,
    common_period_ticks,
    field_lines,
)

ELEVATION, FORCES = "elevation", "forces"
MIN_EXCITATION_RATIO = 0.02  # of the greatest excitation per metre; weaker lines are not observable


class WaveSensors(NamedTuple):
    """The fields of a log from which waves are recovered."""

    position: str
    position_age: str
    metres: float  # per unit of the position
    force: str  # of the power take-off on the body
    force_age: str
    elevation: str  # undisturbed, m; finite only in a simulated basin
    newtons: float = 1.0  # per unit of the force
    force_lag: float = 0.0  # s, time constant of its amplifier, not in its age

    @property
    def fields(self) -> tuple[str, ...]:
        """All fields."""
        numbers = (self.position, self.position_age, self.force, self.force_age, self.elevation)
        return (WAVE_CLOCK, *numbers)


class WaveDevice(Protocol):
    """The bare hull of a device and its wave excitation; amplitudes of e^{+i omega t}."""

    sensors: WaveSensors
    quadratic: float
    """Coefficient of quadratic drag, N s2/m2."""

    def dynamic_stiffness(self, omega: Floats) -> Complexes:
        """Return the force per position, N/m, at angular frequencies (rad/s)."""

    def excitation(self, frequency: Floats) -> Complexes:
        """Return the force per metre of wave, N/m, at frequencies in Hz."""


class WaveMakerLines(NamedTuple):
    """The spectral lines of the wave maker's command."""

    repeat: float  # s
    cycles: tuple[int, ...]  # per repeat period
    elevation: Complexes  # m, by line

    @property
    def frequency(self) -> Floats:
        """Frequency of each line, Hz."""
        return np.array(self.cycles) / self.repeat


class RecoveredWaves(NamedTuple):
    """The undisturbed sea at the device's position."""

    wave_maker: WaveMakerLines
    elevation: Complexes  # m, by line
    scatter: Floats  # m, standard error of a line's amplitude; NaN for a single period
    rows: int  # number of rows in the mean
    periods: int  # number of periods in the mean
    method: str  # ELEVATION or FORCES
    skipped_rows: tuple[str, ...]  # unusable rows with the reason

    def description(self) -> dict[str, Any]:
        """Return the sea for the simulated wave maker as plain values."""
        return {
            "kind": "components",
            "repeat_s": self.wave_maker.repeat,
            "cycles": list(self.wave_maker.cycles),
            "amplitude_m": np.abs(self.elevation).tolist(),
            "phase_rad": np.angle(self.elevation).tolist(),
        }


def wave_maker_lines(sea: dict[str, Any]) -> WaveMakerLines:
    """Return the lines of a plan's ``requested_sea``; raise ValueError for calm water."""
    cycles = tuple(int(n) for n in sea["cycles"])
    if not cycles:
        raise ValueError("the run had no waves")
    size, phase = np.array(sea["amplitude_m"]), np.array(sea["phase_rad"])
    return WaveMakerLines(float(sea["repeat_s"]), cycles, size * np.exp(1j * phase))


def recover_waves(
    windows: Iterable[Window],
    wave_maker: WaveMakerLines,
    device: WaveDevice,
    dt: float,
    method: str | None,
) -> RecoveredWaves:
    """Recover the waves from measured windows with the fields of the device's sensors.

    ``method`` is `ELEVATION` or `FORCES`; None selects the elevation if logged. Raises ValueError
    if no row is usable, or if ``method`` is `ELEVATION` and the elevation was not logged.
    """
    elevations: list[Complexes] = []
    skipped_rows: list[str] = []
    rows = 0
    for window in windows:
        try:
            method = method or (
                ELEVATION if _has_elevation(window, device.sensors.elevation) else FORCES
            )
            elevations.append(_window_elevation(window, wave_maker, device, dt, method))
            rows += 1
        except ValueError as error:
            skipped_rows.append(f"row {window.row}: {error}")
    if not elevations or method is None:
        raise ValueError(
            "; ".join(["no row of the run is usable to recover its waves", *skipped_rows])
        )
    periods = np.concatenate(elevations)
    count = len(periods)
    spread = np.abs(periods - periods.mean(axis=0)) ** 2
    scatter = np.sqrt(spread.sum(axis=0) / max(count - 1, 1) / count)
    if count < 2:
        scatter = np.full(len(wave_maker.cycles), np.nan)
    return RecoveredWaves(
        wave_maker, periods.mean(axis=0), scatter, rows, count, method, tuple(skipped_rows)
    )


def _has_elevation(window: Window, field: str) -> bool:
    names: Sequence[str] = window.data.dtype.names or ()
    return field in names and bool(np.isfinite(window.data[field]).all())


def _window_elevation(
    window: Window, wave_maker: WaveMakerLines, device: WaveDevice, dt: float, method: str
) -> Complexes:
    """Return the elevation in each whole period of a window, periods by lines."""
    if window.incomplete_reason:
        raise ValueError(window.incomplete_reason)
    if method == ELEVATION and not _has_elevation(window, device.sensors.elevation):
        raise ValueError("the undisturbed elevation was not logged")
    period = common_period_ticks([wave_maker.repeat], dt, window.span)
    times = round(period * dt / wave_maker.repeat)
    top = times * max(wave_maker.cycles)
    indices = times * np.array(wave_maker.cycles) - 1
    data, sensors = window.data, device.sensors
    omega = angular_frequencies(period * dt, top)

    def lines(field: str, age: str, scale: float = 1.0) -> Complexes:
        return field_lines(data, field, age, dt, period, top, scale)

    if method == ELEVATION:
        return lines(sensors.elevation, sensors.position_age)[:, indices]
    position = lines(sensors.position, sensors.position_age, sensors.metres)
    force = lines(sensors.force, sensors.force_age, sensors.newtons)
    force *= 1.0 + 1j * omega * sensors.force_lag
    drag = _drag(position, omega, period, device.quadratic)
    excitation = device.dynamic_stiffness(omega) * position - drag - force
    per_metre = device.excitation(omega[indices] / (2.0 * np.pi))
    strong = np.abs(per_metre) >= MIN_EXCITATION_RATIO * np.abs(per_metre).max()
    elevation = np.broadcast_to(wave_maker.elevation, (len(excitation), indices.size)).copy()
    elevation[:, strong] = excitation[:, indices[strong]] / per_metre[strong]
    return elevation


def _drag(position: Complexes, omega: Floats, period: int, quadratic: float) -> Complexes:
    """Return the lines of the force -c |v| v on the body (N) at the velocity of ``position``."""
    spectrum = np.zeros((len(position), period // 2 + 1), dtype=np.complex128)
    spectrum[:, 1 : omega.size + 1] = 1j * omega * position * (0.5 * period)
    v = np.fft.irfft(spectrum, period, axis=1)
    found = np.fft.rfft(-quadratic * np.abs(v) * v, axis=1)[:, 1 : omega.size + 1]
    return np.asarray(found * (2.0 / period), dtype=np.complex128)
