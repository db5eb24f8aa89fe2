"""A foreign recorder's clock aligned to a run's, by trigger and by sine, and whether they agree.

Three answers, as in the MASK4 test (MASK4 report (Sandia), 3.1; its tweSync script): the trigger's
edge, good to the sampling step and for one moment; the lag of greatest cross-correlation of the
sine, one for the whole record; and the fit that is used, of offset and drift to the sine's phase,
cycle by cycle, in which the edge tells the whole cycles. A sine repeats, so an edge that is wrong
by whole cycles cannot be found out.
"""

from typing import NamedTuple

import numpy as np

from rig.interop.basin.clock import Clock, constant, fitted
from rig.interop.basin.recording import Floats, Recording
from rig.interop.basin.sync import Edge, Track, correlation_lag, phase_track, rising_edge

DISAGREE = 0.025  # s, between edge and sine: more than half a step of 50 Hz either way explains
LAGS_DISAGREE = 0.005  # s, between the correlation's lag and the fit at the record's middle
FAST = 200e-6  # drift beyond which the rate of the file is not what it says
POOR_DB = 10.0  # signal to noise of a sine below which it is not to be trusted
CORRELATED_AT = 50.0  # Hz

BLOCK = 10.0  # s, of which each gives one lag between twins
WITHIN = 1.0  # s, in which it is looked for
ALIKE = 0.8  # least correlation of a block that counts
LEAST_BLOCKS = 5


class Reference(NamedTuple):
    """What the run itself knows of the common signals, on its own clock."""

    edge: Edge | None
    sine: Track | None


class Twin(NamedTuple):
    """A channel of the record, and the run's own record of the same quantity."""

    channel: str
    time: Floats  # s of the run
    value: Floats


class Lags(NamedTuple):
    """Run time less recorder time, again and again through a record."""

    what: str  # they were taken from
    time: Floats  # s of the recorder
    lag: Floats  # s
    snr_db: float | None = None  # of the sine, the worse of both sides
    by_correlation: float | None = None  # s, one lag for the whole record


class Alignment(NamedTuple):
    """A recorder's clock in run time, how it was found, and what is doubtful about it."""

    method: str  # "edge and sine", "edge", "stated", "stated and sine", "edge and CHANNEL"
    clock: Clock
    edge_at: float | None  # s of the recorder, where its trigger rises
    by_edge: float | None  # s, offset (run less recorder) at the edge, by the edge alone
    edge_less_fit: float | None  # s, edge's offset less the clock's, at the edge
    remarks: tuple[str, ...]  # what a reader should know
    alarms: tuple[str, ...] = ()  # what should not be so
    by_correlation: float | None = None  # s, offset at the middle of the sine's record
    correlation_less_fit: float | None = None  # s, likewise at the middle
    snr_db: float | None = None  # of the sine, the worse of both sides
    cycles: Floats = np.zeros(0)  # s of the recorder, where lags were taken
    residual: Floats = np.zeros(0)  # s, what the fit leaves there

    @property
    def drift_known(self) -> bool:
        """Whether more than one moment of the clock is known."""
        return len(self.cycles) > 0


def align(
    record: Recording,
    reference: Reference,
    ttl: str | None,
    sine: str | None,
    stated: float | None = None,
    twin: Twin | None = None,
) -> Alignment:
    """Align a record by its channels ``ttl`` and ``sine``, as far as it and the run have them.

    ``stated``: offset (run less recorder, s) by a person; it stands in for the edge. ``twin``
    stands in for the sine. ValueError if there is neither an edge on both sides nor a stated
    offset, or if the twins have too little in common.
    """
    remarks: list[str] = []
    edge = rising_edge(record.time, record.channels[ttl]) if ttl else None
    first = _first_guess(edge, reference.edge, stated, ttl, remarks)
    known = "stated" if stated is not None else "edge"
    by_edge = reference.edge.time - edge.time if edge and reference.edge else None
    taken = (
        twin_lags(record, twin, first)
        if twin is not None
        else _sine_lags(record, sine, reference.sine, first, remarks)
    )
    clock, left = (first, None) if taken is None else fitted(taken.time, taken.lag)
    less = None
    if by_edge is not None and edge is not None:
        less = by_edge - (float(clock.to_run(edge.time)) - edge.time)
    made = Alignment(known, clock, edge.time if edge else None, by_edge, less, tuple(remarks))
    if taken is None or left is None:
        return made._replace(remarks=(*remarks, "drift is not known: no sine on both sides"))
    by_lag = taken.by_correlation
    lag_less = None
    if by_lag is not None:
        lag_less = by_lag - (float(clock.to_run(clock.middle)) - clock.middle)
    return made._replace(
        method=f"{known} and {taken.what}",
        alarms=tuple(_doubts(clock, taken.snr_db, less, lag_less)),
        by_correlation=by_lag,
        correlation_less_fit=lag_less,
        snr_db=taken.snr_db,
        cycles=taken.time,
        residual=left,
    )


def _sine_lags(
    record: Recording, sine: str | None, reference: Track | None, first: Clock, remarks: list[str]
) -> Lags | None:
    """Lags by the phase of the sine; None where it is not on both sides."""
    if sine is None or reference is None:
        return None
    track = phase_track(record.time, record.channels[sine], reference.frequency)
    if track is None:
        remarks.append(f"{sine}: less than three cycles of {reference.frequency:g} Hz, not used")
        return None
    lag = lags(track, reference, first)
    snr = min(track.snr_db, reference.snr_db)
    return Lags("sine", track.time, lag, snr, _correlated(record, sine, reference, first))


def twin_lags(record: Recording, twin: Twin, first: Clock) -> Lags:
    """Lags of greatest correlation of a channel with its twin in the run, block by block.

    ``first`` must be right within a second, and within half a period of what is periodic.
    """
    good, own = np.isfinite(record.channels[twin.channel]), np.isfinite(twin.value)
    there = first.to_run(record.time[good])
    start, end = max(there[0], twin.time[0]), min(there[-1], twin.time[-1])
    blocks = int((end - start) / BLOCK)
    size = round(BLOCK * CORRELATED_AT)
    time = start + np.arange(max(blocks, 0) * size) / CORRELATED_AT
    theirs = np.interp(time, there, record.channels[twin.channel][good])
    ours = np.interp(time, twin.time[own], twin.value[own])
    middles, found = [], []
    for k in range(blocks):
        block = slice(k * size, (k + 1) * size)
        lag, alike = correlation_lag(time[block], theirs[block], ours[block], WITHIN)
        if alike > ALIKE:
            middles.append(float(first.from_run(time[block].mean())))
            found.append(lag)
    if len(found) < LEAST_BLOCKS:
        raise ValueError(
            f"{twin.channel} and its twin in the run are alike in {len(found)} of {blocks} blocks "
            f"of {BLOCK:g} s; needed {LEAST_BLOCKS}"
        )
    middle = np.array(middles)
    return Lags(twin.channel, middle, np.asarray(first.to_run(middle) - middle - np.array(found)))


def in_words(one: Alignment) -> str:
    """An alignment in a line: offset and drift with standard errors, what the trigger says."""
    clock = one.clock
    said = [f"offset {clock.offset:+.4f}"]
    if np.isfinite(clock.offset_error):
        said[0] += f" ± {clock.offset_error:.4f}"
    said[0] += f" s at {clock.middle:.1f} s of the record"
    if one.drift_known:
        said.append(f"drift {1e6 * clock.drift:+.2f} ± {1e6 * clock.drift_error:.2f} ppm")
    if one.edge_less_fit is not None and one.drift_known:
        said.append(f"trigger {1e3 * one.edge_less_fit:+.1f} ms from it")
    return f"{one.method}: {', '.join(said)}"


def _first_guess(
    edge: Edge | None,
    of_run: Edge | None,
    stated: float | None,
    ttl: str | None,
    remarks: list[str],
) -> Clock:
    """The clock by edge or statement alone."""
    for where, one in (("the record", edge), ("the run", of_run)):
        if one is not None and one.rises > 1:
            times = f"{one.rises} times; its first rise is used"
            remarks.append(f"the trigger of {where} rises {times}")
    if stated is not None:
        return constant(stated, float("nan"), 0.0)
    if edge is None:
        said = "has no trigger channel" if ttl is None else f"{ttl} does not rise"
        raise ValueError(f"{said}; name its trigger, or state the offset")
    if of_run is None:
        raise ValueError("the run has no trigger that rises; state the offset")
    error = float(np.hypot(edge.error, of_run.error))
    return constant(of_run.time - edge.time, error, edge.time)


def lags(track: Track, reference: Track, first: Clock) -> Floats:
    """Run time less recorder time (s) at each cycle: phases compared, whole cycles by ``first``."""
    there = first.to_run(track.time)
    phase = np.unwrap(track.phase - np.interp(there, reference.time, reference.phase))
    found = phase / (2.0 * np.pi * reference.frequency)
    guess = there - track.time
    near = int(np.argmin(np.abs(track.time - first.middle)))  # where the edge speaks for the clock
    whole: Floats = np.round((guess[near] - found[near]) * reference.frequency)
    return np.asarray(found + whole / reference.frequency, dtype=np.float64)


def _correlated(record: Recording, sine: str, reference: Track, first: Clock) -> float:
    """Offset (s) by the one lag at which the sines correlate best, as tweSync takes it."""
    good = np.isfinite(record.channels[sine])
    tau, value = first.to_run(record.time[good]), record.channels[sine][good]
    count = int((tau[-1] - tau[0]) * CORRELATED_AT)
    time = tau[0] + np.arange(count) / CORRELATED_AT
    phase = np.interp(time, reference.time, reference.phase)
    wanted = np.sin(2.0 * np.pi * reference.frequency * time + phase)
    half = 0.5 / reference.frequency
    lag, _ = correlation_lag(time, np.interp(time, tau, value), wanted, half)
    return first.offset - lag


def _doubts(
    clock: Clock, snr: float | None, edge_less: float | None, lag_less: float | None
) -> list[str]:
    """Everything that should not be so, a sentence each."""
    said = []
    if edge_less is not None and abs(edge_less) > DISAGREE:
        said.append(
            f"trigger and sine disagree by {1e3 * edge_less:+.1f} ms, more than "
            f"{1e3 * DISAGREE:g} ms: one of them is not what it seems"
        )
    if clock.slip:
        said.append(
            f"the recorder's clock slips by {1e3 * clock.slip:+.1f} ms at "
            f"{clock.slip_at:.1f} s of its record; it is followed across the slip"
        )
    elif lag_less is not None and abs(lag_less) > LAGS_DISAGREE:
        said.append(
            f"correlation of the sine and its phase disagree by {1e3 * lag_less:+.1f} ms, more "
            f"than {1e3 * LAGS_DISAGREE:g} ms"
        )
    if abs(clock.drift) > FAST:
        said.append(
            f"a drift of {1e6 * clock.drift:+.0f} ppm is more than clocks have: "
            "the rate of the file is not its true rate"
        )
    if snr is not None and not snr > POOR_DB:
        said.append(f"the sine stands only {snr:.1f} dB above what is beside it")
    return said
