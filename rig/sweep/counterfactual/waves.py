"""The waves of a run, recovered line by line from what it measured.

Two ways, both of whole repeat periods and with amplitudes of e^{+i omega t} on the wave clock:

    from the undisturbed elevation, where the log has it (a simulated basin does): eta itself
    from measured forces:   eta = (L X - D - F_LCB) / H,   L(omega) = F/X of the bare hull

(MASK4 report (Sandia), eq. 3.3, solved for the wave). F_LCB is the force of the power take-off on
the body, D that of quadratic drag at the measured velocity, H the excitation of a metre of wave.
All rows had the same waves, so each line is the mean of all periods of all rows. Lines are those
that the wave maker was asked for: what is between them is harmonics of the body, not sea. A line
that hardly excites the body cannot be seen in its forces, and is taken as it was asked for.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from rig.analysis.windows import Window
from rig.design.predictions.device import Model
from rig.identification.periods import Complexes, Floats, amplitudes, angular, filled, whole_ticks

ELEVATION, FORCES = "elevation", "forces"
CLOCK, COUNTS, AGE = "plan.wave_clock", "heave.sense.counts", "heave.sense.encoder_age"
LCB, LOAD_AGE, TRUTH = "load.lcb", "load.age", "wave.elevation"
FIELDS = (CLOCK, COUNTS, AGE, LCB, LOAD_AGE, TRUTH)
WEAK = 0.02  # of the greatest excitation of a metre: what excites less is not seen in forces


class WaveMakerLines(NamedTuple):
    """The lines that the wave maker was asked for."""

    repeat: float  # s
    cycles: tuple[int, ...]  # in a repeat period
    elevation: Complexes  # m, by line

    @property
    def frequency(self) -> Floats:
        """Of each line, Hz."""
        return np.array(self.cycles) / self.repeat


class Waves(NamedTuple):
    """The sea as it was at the device's place, without the device."""

    asked: WaveMakerLines
    elevation: Complexes  # m, by line
    scatter: Floats  # m, standard error of a line's amplitude; NaN where there was one period only
    rows: int  # it is the mean of
    periods: int
    by: str  # ELEVATION or FORCES
    left_out: tuple[str, ...]  # rows that could not be used, and why

    def description(self) -> dict[str, Any]:
        """The sea for the simulated wave maker, as plain values."""
        return {
            "kind": "components",
            "repeat_s": self.asked.repeat,
            "cycles": list(self.asked.cycles),
            "amplitude_m": np.abs(self.elevation).tolist(),
            "phase_rad": np.angle(self.elevation).tolist(),
        }


def asked_of(told: dict[str, Any]) -> WaveMakerLines:
    """The lines of a plan's ``asked_sea``; ValueError for a sea without any (calm water)."""
    cycles = tuple(int(n) for n in told["cycles"])
    if not cycles:
        raise ValueError("the run had no waves")
    size, phase = np.array(told["amplitude_m"]), np.array(told["phase_rad"])
    return WaveMakerLines(float(told["repeat_s"]), cycles, size * np.exp(1j * phase))


def recovered(
    windows: Iterable[Window], asked: WaveMakerLines, model: Model, dt: float, by: str | None
) -> Waves:
    """The waves from measured windows with the fields of `FIELDS`.

    ``by``: `ELEVATION` or `FORCES`; None: the elevation where it was logged. Raises ValueError
    where no row tells anything, or the elevation is asked for and was not logged.
    """
    pieces: list[Complexes] = []
    left: list[str] = []
    rows = 0
    for window in windows:
        try:
            by = by or (ELEVATION if _has_elevation(window) else FORCES)
            pieces.append(_of_window(window, asked, model, dt, by))
            rows += 1
        except ValueError as error:
            left.append(f"row {window.row}: {error}")
    if not pieces or by is None:
        raise ValueError("; ".join(["no row of the run tells its waves", *left]))
    periods = np.concatenate(pieces)
    count = len(periods)
    spread = np.abs(periods - periods.mean(axis=0)) ** 2
    scatter = np.sqrt(spread.sum(axis=0) / max(count - 1, 1) / count)
    if count < 2:
        scatter = np.full(len(asked.cycles), np.nan)
    return Waves(asked, periods.mean(axis=0), scatter, rows, count, by, tuple(left))


def _has_elevation(window: Window) -> bool:
    names: Sequence[str] = window.data.dtype.names or ()
    return TRUTH in names and bool(np.isfinite(window.data[TRUTH]).all())


def _of_window(
    window: Window, asked: WaveMakerLines, model: Model, dt: float, by: str
) -> Complexes:
    """Elevation in each whole period of a window, periods by lines."""
    if window.incomplete_reason:
        raise ValueError(window.incomplete_reason)
    if by == ELEVATION and not _has_elevation(window):
        raise ValueError("the undisturbed elevation was not logged")
    period = whole_ticks([asked.repeat], dt, window.span)
    times = round(period * dt / asked.repeat)
    top = times * max(asked.cycles)
    at = times * np.array(asked.cycles) - 1
    data = window.data
    start = float(data[CLOCK][0])
    omega = angular(period * dt, top)

    def lines(field: str, age: str, scale: float = 1.0) -> Complexes:
        values = filled(data["tick"], data[field] * scale)
        late = float(np.mean(data[age]))
        found = amplitudes(values, start, dt, period, top) * np.exp(1j * omega * late)
        return np.asarray(found, dtype=np.complex128)

    if by == ELEVATION:
        return lines(TRUTH, AGE)[:, at]
    position = lines(COUNTS, AGE, model.metres_per_count)
    force = lines(LCB, LOAD_AGE)
    drag = _drag(position, omega, period, model.quadratic)
    excitation = model.hull(omega) * position - drag - force
    per_metre = model.excitation(omega[at] / (2.0 * np.pi))
    strong = np.abs(per_metre) >= WEAK * np.abs(per_metre).max()
    found = np.broadcast_to(asked.elevation, (len(excitation), at.size)).copy()
    found[:, strong] = excitation[:, at[strong]] / per_metre[strong]
    return found


def _drag(position: Complexes, omega: Floats, period: int, quadratic: float) -> Complexes:
    """Lines of the force -c |v| v on the body (N) at the velocity of these lines."""
    spectrum = np.zeros((len(position), period // 2 + 1), dtype=np.complex128)
    spectrum[:, 1 : omega.size + 1] = 1j * omega * position * (0.5 * period)
    v = np.fft.irfft(spectrum, period, axis=1)
    found = np.fft.rfft(-quadratic * np.abs(v) * v, axis=1)[:, 1 : omega.size + 1]
    return np.asarray(found * (2.0 / period), dtype=np.complex128)
