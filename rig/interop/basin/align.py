"""Alignment of another recorder's clock to the clock of a run, by trigger and by sine.

The module computes three estimates of the offset and compares them, as in the MASK4 test (MASK4
report (Sandia), 3.1; its tweSync script):

- the trigger's edge: one moment, resolved to one sampling step;
- the lag of greatest cross-correlation of the sine: one value for the whole record;
- the fit of offset and drift to the phase of the sine, cycle by cycle. The edge gives the number
  of whole cycles. The alignment uses this fit.

A sine repeats, so an edge error of whole cycles cannot be detected.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import fft

from rig.recording.channel_file import Floats, Recording

UNKNOWN_DRIFT_ERROR = 50e-6  # standard deviation of an unknown drift: tolerance of quartz clocks
MIN_SIGNIFICANCE = 6.0  # standard errors; noise does not reach it at any of 1000 candidates
MIN_SLIP = 2e-3  # s; temperature makes clocks wander by as much
_END_CYCLES = 5  # cycles at either end that are no candidates for a step


class Clock(NamedTuple):
    """A recorder's clock in run time: offset, drift and slip, with errors.

        t = tau + offset + drift (tau - middle) [+ slip where tau >= slip_at]

    tau is the recorder's time, t the run's. The line is referred to the middle of the fitted
    samples, which makes the errors of offset and drift independent.
    """

    offset: float  # s, at ``middle``
    drift: float  # run seconds per recorder second, minus 1; 0 if unknown
    middle: float  # s of the recorder
    offset_error: float  # s, standard error
    drift_error: float  # standard error; `UNKNOWN_DRIFT_ERROR` if the drift is unknown
    slip_at: float = float("inf")  # s of the recorder; inf: no slip
    slip: float = 0.0  # s

    def to_run(self, tau: Any) -> Any:
        """Return run times (s) of recorder times (s)."""
        slipped = np.where(np.asarray(tau) >= self.slip_at, self.slip, 0.0)
        return tau + self.offset + self.drift * (tau - self.middle) + slipped

    def from_run(self, t: Any) -> Any:
        """Return recorder times (s) of run times (s); a time within a slip maps to ``slip_at``."""
        before_slip = self.middle + (t - self.middle - self.offset) / (1.0 + self.drift)
        after_slip = self.middle + (t - self.middle - self.offset - self.slip) / (1.0 + self.drift)
        return np.where(
            before_slip < self.slip_at, before_slip, np.maximum(after_slip, self.slip_at)
        )

    def error(self, tau: Any) -> Any:
        """Return the standard error (s) of `to_run` at recorder times (s)."""
        return np.hypot(self.offset_error, self.drift_error * (np.asarray(tau) - self.middle))


class LagStep(NamedTuple):
    """The step in the lags that reduces the residuals of a straight line most."""

    time: float  # s, midpoint of the two cycles around the step
    size: float  # s
    significance: float  # size divided by its standard error


def fit_clock(time: Floats, lag: Floats) -> tuple[Clock, Floats]:
    """Fit a clock to lags ``t - tau`` (s) at recorder times (s); return it and the residuals.

    A significant step is fitted as a slip. The errors assume white scatter of the lags. The scatter
    is estimated from differences of neighbouring cycles, so neither slip nor drift enters it.
    """
    scatter = float(np.sqrt(0.5 * np.mean(np.diff(lag) ** 2)))
    step = largest_step(time, lag, scatter)
    slipped = (
        step is not None and abs(step.size) > MIN_SLIP and step.significance > MIN_SIGNIFICANCE
    )
    middle = float(time.mean())
    columns = [np.ones_like(time), time - middle]
    if slipped and step is not None:
        columns.append((time >= step.time).astype(np.float64))
    design = np.stack(columns, axis=1)
    coefficients, *_ = np.linalg.lstsq(design, lag, rcond=None)
    errors = scatter * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    residuals = lag - design @ coefficients
    clock = Clock(
        float(coefficients[0]), float(coefficients[1]), middle, float(errors[0]), float(errors[1])
    )
    if slipped and step is not None:
        clock = clock._replace(slip_at=step.time, slip=float(coefficients[2]))
    return clock, residuals


def largest_step(time: Floats, lag: Floats, scatter: float) -> LagStep | None:
    """Return the best single step added to a straight line; None for too few lags.

    Every pair of neighbouring lags is a candidate. ``scatter`` (s) is the white scatter of one lag.
    """
    count = len(time)
    if count < 4 * _END_CYCLES:
        return None
    flat = np.full(count, count**-0.5)
    slope = time - time.mean()
    slope = slope / np.linalg.norm(slope)
    residuals = lag - flat * (flat @ lag) - slope * (slope @ lag)

    def tail_sums(values: Floats) -> Floats:
        """Return the sums from each index to the end."""
        return np.cumsum(values[::-1])[::-1]

    energy = np.arange(count, 0, -1) - tail_sums(flat) ** 2 - tail_sums(slope) ** 2
    tail_residuals = tail_sums(residuals)
    candidates = np.arange(_END_CYCLES, count - _END_CYCLES)
    gain = tail_residuals[candidates] ** 2 / energy[candidates]
    i = int(candidates[np.argmax(gain)])
    size, error = float(tail_residuals[i] / energy[i]), scatter / float(np.sqrt(energy[i]))
    significance = abs(size) / error if error > 0.0 else (np.inf if size else 0.0)
    return LagStep(0.5 * float(time[i - 1] + time[i]), size, float(significance))


def constant_clock(offset: float, error: float, time: float) -> Clock:
    """Return a clock of which one moment is known; its drift is that of any quartz clock."""
    return Clock(offset, 0.0, time, error, UNKNOWN_DRIFT_ERROR)


MIN_SAMPLES = 5  # of a cycle that is fitted with three coefficients
_PEAK_HALF_WIDTH = 0.15  # s, either side of the best lag, of the polynomial through the peak


class Edge(NamedTuple):
    """The first rise of a trigger."""

    time: float  # s, middle of the sampling step in which it rose
    error: float  # s, standard error: the step divided by sqrt(12)
    rises: int  # number of rises in the whole record


class PhaseTrack(NamedTuple):
    """Phase of a sine, cycle by cycle."""

    time: Floats  # s, middle of each cycle, on the clock of its samples
    phase: Floats  # rad, of sin(2 pi f t + phase) on that clock, unwrapped
    frequency: float  # Hz, f
    snr_db: float  # power of the sine over that of the residual; inf for a computed sine


def rising_edge(time: Floats, value: Floats) -> Edge | None:
    """Return the first rise through the middle of a trigger's two levels; None without a rise.

    The levels are the least and the greatest value. A rise goes from the lower 40 % to above 60 %.
    """
    finite = np.isfinite(value)
    time, value = time[finite], value[finite]
    if len(value) < 2 or float(np.ptp(value)) == 0.0:
        return None
    relative = (value - value.min()) / np.ptp(value)
    level = np.where(relative > 0.6, 1, np.where(relative < 0.4, -1, 0))
    decided = np.flatnonzero(level)
    rises = decided[1:][(level[decided[1:]] == 1) & (level[decided[:-1]] == -1)]
    if rises.size == 0:
        return None
    i = int(rises[0])
    step = float(time[i] - time[i - 1])
    return Edge(float(time[i]) - 0.5 * step, step / 12.0**0.5, int(rises.size))


def ideal_sine(frequency: float) -> PhaseTrack:
    """Return the track of sin(2 pi f t), generated from the clock itself: zero phase, no noise."""
    return PhaseTrack(np.zeros(1), np.zeros(1), frequency, float("inf"))


def phase_track(time: Floats, value: Floats, frequency: float) -> PhaseTrack | None:
    """Return the phase of a sine near ``frequency`` (Hz); None for fewer than three cycles.

    Each whole cycle gives one phase by least squares of a cos + b sin + c. Its standard error for
    white noise, a signal-to-noise ratio S (power) and n samples per cycle is 1 / sqrt(n S) radians
    at any amplitude. Non-finite samples and cycles with fewer than five samples are left out.
    """
    finite = np.isfinite(value)
    time, value = time[finite], value[finite]
    if len(time) == 0:
        return None
    cycle = np.floor((time - time[0]) * frequency + 1e-6).astype(np.int64)
    starts = np.flatnonzero(np.diff(cycle, prepend=-1))
    count = np.diff(starts, append=len(time))
    median_count = float(np.median(count))
    complete = (count > 0.9 * median_count) & (count >= MIN_SAMPLES)
    if int(complete.sum()) < 3:
        return None
    angle = 2.0 * np.pi * frequency * time
    basis = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)])
    normal = np.empty((len(starts), 3, 3))
    for i in range(3):
        for j in range(i + 1):
            normal[:, i, j] = normal[:, j, i] = np.add.reduceat(basis[i] * basis[j], starts)
    right = np.stack([np.add.reduceat(row * value, starts) for row in basis], axis=1)
    coefficients = np.linalg.solve(normal[complete], right[complete][..., None])[..., 0]
    a, b = coefficients[:, 0], coefficients[:, 1]
    middle = np.add.reduceat(time, starts)[complete] / count[complete]
    square = np.add.reduceat(value * value, starts)[complete]
    residual = float((square - np.einsum("ki,ki->k", coefficients, right[complete])).sum())
    degrees_of_freedom = float(count[complete].sum() - 3 * complete.sum())
    noise = max(residual, 0.0) / degrees_of_freedom if degrees_of_freedom > 0.0 else float("nan")
    power = float(np.mean(0.5 * (a * a + b * b)))
    with np.errstate(divide="ignore", invalid="ignore"):
        snr = float(10.0 * np.log10(np.float64(power) / noise))
    return PhaseTrack(middle, np.unwrap(np.arctan2(a, b)), frequency, snr)


def correlation_lag(
    time: Floats, value: Floats, reference: Floats, max_lag: float
) -> tuple[float, float]:
    """Return the lag (s) by which ``value`` trails ``reference``, and the correlation there.

    Both signals are sampled at the evenly spaced ``time``. The lag maximises the cross-correlation
    over the whole record, within +-``max_lag`` s.
    """
    step = float(time[-1] - time[0]) / (len(time) - 1)
    reach = min(round(max_lag / step), len(time) // 2 - 1)
    a, b = value - value.mean(), reference - reference.mean()
    inner = slice(reach, len(a) - reach)  # every lag then uses the same number of samples
    inner_reference = np.zeros_like(b)
    inner_reference[inner] = b[inner]
    fft_length = fft.next_fast_len(len(a), real=True)
    correlation = fft.irfft(
        fft.rfft(a, fft_length) * np.conj(fft.rfft(inner_reference, fft_length)), fft_length
    )
    lags: npt.NDArray[np.int64] = np.arange(-reach, reach + 1)
    energy = np.concatenate([[0.0], np.cumsum(a * a)])
    # Energy of a where b overlaps it.
    overlap_energy = energy[len(a) - reach + lags] - energy[reach + lags]
    norm = float(np.linalg.norm(b[inner])) * np.sqrt(np.maximum(overlap_energy, 0.0))
    coefficient = correlation[lags] / np.where(norm > 0.0, norm, np.inf)
    best = int(np.argmax(coefficient))
    lag_times = np.asarray(lags * step, dtype=np.float64)
    return _peak_lag(lag_times, coefficient, best, round(_PEAK_HALF_WIDTH / step)), float(
        coefficient[best]
    )


def _peak_lag(lag: Floats, coefficient: Floats, best: int, reach: int) -> float:
    """Return the lag at the peak of a polynomial through the points around the best sample.

    The fit takes many points, because noise moves the best sample by far more than a step.
    """
    window = slice(max(best - reach, 0), best + reach + 1)
    if len(lag[window]) < 6:
        return float(lag[best])
    middle, half = float(lag[window].mean()), 0.5 * float(np.ptp(lag[window]))
    curve = np.polynomial.Polynomial.fit((lag[window] - middle) / half, coefficient[window], 4)
    stationary = curve.deriv().roots()
    peaks = stationary[np.abs(stationary.imag) < 1e-9].real
    peaks = peaks[np.abs(peaks) <= 1.0]
    if peaks.size == 0:
        return float(lag[best])
    return middle + half * float(peaks[np.argmax(curve(peaks))])


# s, between edge and sine; half a step at 50 Hz on both sides explains 20 ms
MAX_EDGE_DIFFERENCE = 0.025
MAX_LAG_DIFFERENCE = 0.005  # s, between correlation lag and fit at the middle of the record
MAX_DRIFT = 200e-6  # a larger drift means that the stated rate of the file is wrong
MIN_SNR_DB = 10.0  # signal to noise of a usable sine
CORRELATION_RATE = 50.0  # Hz, of the resampled signals that are correlated

BLOCK_LENGTH = 10.0  # s; each block gives one lag of a matched channel
MAX_BLOCK_LAG = 1.0  # s, search range of the lag
MIN_CORRELATION = 0.8  # least correlation coefficient of a block that is used
MIN_BLOCKS = 5


class SyncReference(NamedTuple):
    """Trigger and sine as the run recorded them, on the run's clock."""

    edge: Edge | None
    sine: PhaseTrack | None


class MatchedChannel(NamedTuple):
    """A channel of the record and the log field of the run that measures the same quantity."""

    channel: str
    time: Floats  # s of the run
    value: Floats


class Lags(NamedTuple):
    """Run time minus recorder time at several moments of a record."""

    source: str  # "sine", or the name of the matched channel
    time: Floats  # s of the recorder
    lag: Floats  # s
    snr_db: float | None = None  # of the sine, the smaller of both sides
    correlation_offset: float | None = None  # s, by one lag for the whole record


class Alignment(NamedTuple):
    """A recorder's clock in run time, its method of alignment, and the measured offsets."""

    method: str  # "edge and sine", "edge", "stated", "stated and sine", "edge and CHANNEL"
    clock: Clock
    edge_time: float | None  # s of the recorder, rise of its trigger
    edge_offset: float | None  # s, offset (run minus recorder) at the edge, by the edge alone
    lags: Lags | None  # of the fit; None where only one moment is known
    residuals: Floats  # s, lags minus fit
    remarks: tuple[str, ...]  # notes for a reader of the result

    @property
    def edge_residual(self) -> float | None:
        """``edge_offset`` minus the clock's offset at the edge, s."""
        if self.edge_offset is None or self.edge_time is None:
            return None
        return self.edge_offset - (float(self.clock.to_run(self.edge_time)) - self.edge_time)

    @property
    def correlation_residual(self) -> float | None:
        """Offset by correlation minus the clock's in the middle of the sine's samples, s."""
        if self.lags is None or self.lags.correlation_offset is None:
            return None
        middle = self.clock.middle
        return self.lags.correlation_offset - (float(self.clock.to_run(middle)) - middle)

    @property
    def alarms(self) -> tuple[str, ...]:
        """A message for each failed consistency check; none without lags."""
        return tuple(_alarms(self, self.lags)) if self.lags is not None else ()


def align(
    record: Recording,
    reference: SyncReference,
    ttl: str | None,
    sine: str | None,
    stated_offset: float | None = None,
    match: MatchedChannel | None = None,
) -> Alignment:
    """Align a record by its channels ``ttl`` and ``sine``, where record and run both have them.

    ``stated_offset`` (run minus recorder, s) comes from a person and replaces the edge. ``match``
    replaces the sine. Raises ValueError if neither an edge on both sides nor a stated offset is
    available, or if the matched channel and the log field correlate in too few blocks.
    """
    remarks: list[str] = []
    edge = rising_edge(record.time, record.channels[ttl]) if ttl else None
    clock = initial = _initial_clock(edge, reference.edge, stated_offset, ttl, remarks)
    method = "stated" if stated_offset is not None else "edge"
    lags = (
        match_lags(record, match, initial)
        if match is not None
        else _sine_lags(record, sine, reference.sine, initial, remarks)
    )
    residuals = np.zeros(0)
    if lags is not None:
        clock, residuals = fit_clock(lags.time, lags.lag)
        method = f"{method} and {lags.source}"
    else:
        remarks.append("drift is not known: the sine is not on both sides")
    return Alignment(
        method,
        clock,
        edge.time if edge else None,
        reference.edge.time - edge.time if edge and reference.edge else None,
        lags,
        residuals,
        tuple(remarks),
    )


def _sine_lags(
    record: Recording,
    sine: str | None,
    reference: PhaseTrack | None,
    initial: Clock,
    remarks: list[str],
) -> Lags | None:
    """Return lags by the phase of the sine; None if record or run has no sine."""
    if sine is None or reference is None:
        return None
    track = phase_track(record.time, record.channels[sine], reference.frequency)
    if track is None:
        remarks.append(f"{sine}: fewer than three cycles of {reference.frequency:g} Hz, not used")
        return None
    lag = phase_lags(track, reference, initial)
    snr = min(track.snr_db, reference.snr_db)
    return Lags("sine", track.time, lag, snr, _correlation_offset(record, sine, reference, initial))


def match_lags(record: Recording, match: MatchedChannel, initial: Clock) -> Lags:
    """Return the lag of greatest correlation between a channel and its log field, block by block.

    The error of ``initial`` must be below one second, and below half a period of a periodic
    signal. Raises ValueError if fewer than `MIN_BLOCKS` blocks correlate.
    """
    finite, run_finite = np.isfinite(record.channels[match.channel]), np.isfinite(match.value)
    record_time = initial.to_run(record.time[finite])
    start, end = max(record_time[0], match.time[0]), min(record_time[-1], match.time[-1])
    blocks = int((end - start) / BLOCK_LENGTH)
    size = round(BLOCK_LENGTH * CORRELATION_RATE)
    time = start + np.arange(max(blocks, 0) * size) / CORRELATION_RATE
    record_values = np.interp(time, record_time, record.channels[match.channel][finite])
    run_values = np.interp(time, match.time[run_finite], match.value[run_finite])
    middles, block_lags = [], []
    for k in range(blocks):
        block = slice(k * size, (k + 1) * size)
        lag, correlation = correlation_lag(
            time[block], record_values[block], run_values[block], MAX_BLOCK_LAG
        )
        if correlation > MIN_CORRELATION:
            middles.append(float(initial.from_run(time[block].mean())))
            block_lags.append(lag)
    if len(block_lags) < MIN_BLOCKS:
        raise ValueError(
            f"{match.channel} and its log field correlate in {len(block_lags)} of {blocks} blocks "
            f"of {BLOCK_LENGTH:g} s; needed {MIN_BLOCKS}"
        )
    middle = np.array(middles)
    return Lags(
        match.channel, middle, np.asarray(initial.to_run(middle) - middle - np.array(block_lags))
    )


def format_alignment(alignment: Alignment) -> str:
    """Return an alignment as one line: method, offset and drift with errors, edge residual."""
    clock = alignment.clock
    parts = [f"offset {clock.offset:+.4f}"]
    if np.isfinite(clock.offset_error):
        parts[0] += f" ± {clock.offset_error:.4f}"
    parts[0] += f" s at {clock.middle:.1f} s of the record"
    if alignment.lags is not None:
        parts.append(f"drift {1e6 * clock.drift:+.2f} ± {1e6 * clock.drift_error:.2f} ppm")
    if alignment.edge_residual is not None and alignment.lags is not None:
        parts.append(f"trigger {1e3 * alignment.edge_residual:+.1f} ms from it")
    return f"{alignment.method}: {', '.join(parts)}"


def _initial_clock(
    edge: Edge | None,
    run_edge: Edge | None,
    stated_offset: float | None,
    ttl: str | None,
    remarks: list[str],
) -> Clock:
    """Return the clock by the stated offset or, without one, by the edge alone."""
    for place, candidate in (("the record", edge), ("the run", run_edge)):
        if candidate is not None and candidate.rises > 1:
            times = f"{candidate.rises} times; its first rise is used"
            remarks.append(f"the trigger of {place} rises {times}")
    if stated_offset is not None:
        return constant_clock(stated_offset, float("nan"), 0.0)
    if edge is None:
        problem = "the record has no trigger channel" if ttl is None else f"{ttl} does not rise"
        raise ValueError(f"{problem}; name its trigger, or state the offset")
    if run_edge is None:
        raise ValueError("the run has no trigger that rises; state the offset")
    error = float(np.hypot(edge.error, run_edge.error))
    return constant_clock(run_edge.time - edge.time, error, edge.time)


def phase_lags(track: PhaseTrack, reference: PhaseTrack, initial: Clock) -> Floats:
    """Return run time minus recorder time (s) at each cycle, by the difference of the phases.

    ``initial`` gives the number of whole cycles.
    """
    run_time = initial.to_run(track.time)
    phase = np.unwrap(track.phase - np.interp(run_time, reference.time, reference.phase))
    lag = phase / (2.0 * np.pi * reference.frequency)
    expected = run_time - track.time
    nearest = int(np.argmin(np.abs(track.time - initial.middle)))  # nearest to the edge
    cycles: Floats = np.round((expected[nearest] - lag[nearest]) * reference.frequency)
    return np.asarray(lag + cycles / reference.frequency, dtype=np.float64)


def _correlation_offset(
    record: Recording, sine: str, reference: PhaseTrack, initial: Clock
) -> float:
    """Return the offset (s) by the one lag at which the sines correlate best, as in tweSync."""
    finite = np.isfinite(record.channels[sine])
    tau, value = initial.to_run(record.time[finite]), record.channels[sine][finite]
    count = int((tau[-1] - tau[0]) * CORRELATION_RATE)
    time = tau[0] + np.arange(count) / CORRELATION_RATE
    phase = np.interp(time, reference.time, reference.phase)
    expected = np.sin(2.0 * np.pi * reference.frequency * time + phase)
    half = 0.5 / reference.frequency
    lag, _ = correlation_lag(time, np.interp(time, tau, value), expected, half)
    return initial.offset - lag


def _alarms(alignment: Alignment, lags: Lags) -> list[str]:
    clock, edge_residual = alignment.clock, alignment.edge_residual
    correlation_residual, snr = alignment.correlation_residual, lags.snr_db
    alarms = []
    if edge_residual is not None and abs(edge_residual) > MAX_EDGE_DIFFERENCE:
        alarms.append(
            f"trigger and sine disagree by {1e3 * edge_residual:+.1f} ms, more than "
            f"{1e3 * MAX_EDGE_DIFFERENCE:g} ms: one of the two channels is wrong"
        )
    if clock.slip:
        alarms.append(
            f"the recorder's clock slips by {1e3 * clock.slip:+.1f} ms at "
            f"{clock.slip_at:.1f} s of its record; the alignment includes the slip"
        )
    elif correlation_residual is not None and abs(correlation_residual) > MAX_LAG_DIFFERENCE:
        alarms.append(
            "correlation of the sine and its phase disagree by "
            f"{1e3 * correlation_residual:+.1f} ms, more than {1e3 * MAX_LAG_DIFFERENCE:g} ms"
        )
    if abs(clock.drift) > MAX_DRIFT:
        alarms.append(
            f"the drift of {1e6 * clock.drift:+.0f} ppm exceeds {1e6 * MAX_DRIFT:g} ppm: "
            "the rate of the file is not its true rate"
        )
    if snr is not None and not snr > MIN_SNR_DB:
        alarms.append(f"the sine is only {snr:.1f} dB above the noise; needed {MIN_SNR_DB:g} dB")
    return alarms
