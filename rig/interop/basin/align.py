"""Alignment of another recorder's clock to the clock of a run, by trigger and by sine.

The module computes three estimates of the offset and compares them, as in the MASK4 test (MASK4
report (Sandia), 3.1; its tweSync script):

- the trigger's edge: one moment, resolved to one sampling step;
- the lag of greatest cross-correlation of the sine: one value for the whole record;
- the fit of offset and drift to the phase of the sine, cycle by cycle. The edge gives the number
  of whole cycles. The alignment uses this fit.

A sine repeats, so an edge error of whole cycles cannot be detected.
"""

from typing import NamedTuple

import numpy as np

from rig.interop.basin.clock import Clock, constant_clock, fit_clock
from rig.interop.basin.sync import Edge, PhaseTrack, correlation_lag, phase_track, rising_edge
from rig.recording.channel_file import Floats, Recording

MAX_EDGE_DIFFERENCE = (
    0.025  # s, between edge and sine; half a step at 50 Hz on both sides explains 20 ms
)
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
