"""Division of a row's interval into settling, measurement and tail.

For a regular sea the interval is 20 s with 5 s of settling; the measurement is the largest whole
number of wave periods that fits. For irregular and recorded seas it is 10 s of settling and
exactly one repeat period. `mask4` gives the windows of the MASK4 report (Sandia): the same for
regular seas, and for irregular ones rows of 300 s measured from 2 s on, which is 2 s short of the
repeat period. In calm water the measurement is whole repeat periods of an open-loop reference, or
whole cycles of a motion.

Rows that are assessed while they are measured (`rig.realtime.assessment`) have least and longest
times in place of an interval. In an irregular sea, such a row begins with a bin of the repeat
period (`rig.realtime.paired_rows`), and settles as long as its transients last in the model.

A wave calibration has no rows, but one window of whole periods after the lead-in.
"""

import math
from typing import NamedTuple, Protocol

from rig.config.problems import format_number
from rig.config.reference import AnyReference, SineReference
from rig.config.sea import AnySea, CalmSea, RecordedSea, RegularSea
from rig.config.task_file import Timing
from rig.config.yaml_source import KeyPath
from rig.realtime.paired_rows import BINS, LEAST_BATCHES, PER_BATCH

_ROUNDING = 1e-9  # periods; a window that is shorter than whole periods only by rounding fits
LEAST_SETTLE_S = 2.0  # of rows that settle as long as their transients last
LEAST_REPEAT_S = 100.0  # of rows that end before it: their batches are some waves long
SETTLING_PERIODS = 2  # at least, so that there is a change from one to the next
_LONGEST_SETTLE_S, _LONGEST_SETTLE_PERIODS = 20.0, 10
_MOST_PERIODS = 12  # of a row that ends by its power


class CyclicMotion(Protocol):
    """A motion of the body in whole cycles, in calm water."""

    @property
    def cycles(self) -> int:
        """Number of cycles of a row."""

    @property
    def period(self) -> float:
        """Duration of a cycle, s."""


class RowWindows(NamedTuple):
    """The parts of a row's interval, s, and the interval before it if a part of the rig moves."""

    settle: float
    measure: float
    tail: float
    move: float  # minimum length of the extra interval in which a part of the rig moves
    periods: int  # wave or repeat periods in the measurement; 0: not a whole number
    least_settle: float | None = None  # of rows that settle as measured; `settle` is the longest
    least_measure: float | None = None  # of rows that end by their power; `measure` is the longest
    bin: float = 0.0  # s of an irregular sea, with the begin of which such a row begins
    models_settle: bool = False  # a row settles as long as its transients last in the model

    @property
    def interval(self) -> float:
        """Duration of the row, s."""
        return self.settle + self.measure + self.tail


class WindowError(Exception):
    """A window that does not fit; ``key`` is the key of the campaign file that must change."""

    def __init__(self, key: KeyPath, value: object, message: str) -> None:
        super().__init__(message)
        self.key = key
        self.value = value
        self.message = message


def row_windows(
    sea: AnySea,
    timing: Timing,
    reference: AnyReference = None,
    motion: CyclicMotion | None = None,
) -> RowWindows:
    """Return the windows of every row of a campaign; raises `WindowError` if none fits.

    Before a row for which a part of the rig moves, its combination is held for an extra interval,
    as in the MASK4 report. For an irregular sea this would take 300 s, so there the settling time
    is the minimum (the plan waits for the part in any case); `mask4` keeps the whole interval.
    """
    if timing.is_assessed:
        return _assessed_windows(sea, timing, reference, motion)
    if motion is not None:  # whole cycles cover the travel, whatever the position at the start
        settle = _value_or(timing.settle_s, 2.0)
        return RowWindows(settle, motion.cycles * motion.period, 0.0, settle, motion.cycles)
    if isinstance(sea, CalmSea):
        if reference is None:
            return _calm_windows(timing)
        return _reference_windows(reference, timing)
    if isinstance(sea, RegularSea):
        settle = _value_or(timing.settle_s, 5.0)
        interval = _value_or(timing.interval_s, 20.0)
        return _whole_periods(timing, settle, interval, sea.period, "wave period", interval)
    if timing.scheme == "mask4" and timing.periods is None:
        settle = _value_or(timing.settle_s, 2.0)
        interval = _value_or(timing.interval_s, 300.0)
        _check_interval(timing, settle, interval)
        periods = _count_periods(interval - settle, sea.repeat)
        exact = abs(periods * sea.repeat - (interval - settle)) < 1e-6
        return RowWindows(settle, interval - settle, 0.0, interval, periods if exact else 0)
    mask4 = timing.scheme == "mask4"
    settle = _value_or(timing.settle_s, 2.0 if mask4 else 10.0)
    interval = _value_or(timing.interval_s, settle + sea.repeat * (timing.periods or 1))
    move = interval if mask4 else settle
    return _whole_periods(timing, settle, interval, sea.repeat, "repeat period", move)


def _assessed_windows(
    sea: AnySea, timing: Timing, reference: AnyReference, motion: CyclicMotion | None
) -> RowWindows:
    """Return the windows of rows that settle, or end, as measured."""
    key = ("timing", "settle") if timing.settle == "measured" else ("timing", "end")
    if isinstance(sea, CalmSea) or reference is not None or motion is not None:
        other = "an open-loop reference" if reference is not None else f"a {sea.kind} sea"
        other = other if motion is None else "a hoist"
        raise WindowError(key, None, f"rows with {other} have fixed times; leave the key out")
    if not isinstance(sea, RegularSea):
        return _windows_in_irregular_sea(sea.repeat, timing)
    period, least_settle, least_measure = sea.period, None, None
    longest = _value_or(timing.settle_s, 5.0)
    if timing.settle == "measured":
        least_settle = SETTLING_PERIODS * period
        default = max(_LONGEST_SETTLE_S, _LONGEST_SETTLE_PERIODS * period)
        longest = _value_or(timing.settle_s, default)
        if longest < least_settle:
            raise WindowError(
                ("timing", "settle_s"),
                longest,
                f"{format_number(longest)} s are less than {SETTLING_PERIODS} wave periods of "
                f"{period:.4g} s; allowed from {format_number(least_settle)} s on",
            )
    periods = timing.periods or max(_count_periods(15.0, period), 1)
    if timing.end is not None:
        least = timing.end.least_wave_periods
        periods = timing.periods or max(_MOST_PERIODS, least)
        least_measure = least * period
        if periods < least:
            message = f"{periods} is less than end.least_periods = {least}"
            raise WindowError(("timing", "periods"), periods, message)
        if timing.end.least_s is not None:
            message = "a regular sea has end.least_periods; leave the key out"
            raise WindowError(("timing", "end", "least_s"), timing.end.least_s, message)
    measure, move = periods * period, longest if least_settle is None else least_settle
    return RowWindows(longest, measure, 0.0, move, periods, least_settle, least_measure)


def _windows_in_irregular_sea(repeat: float, timing: Timing) -> RowWindows:
    """Return the windows of rows that settle as the model does, or end by their power.

    ``repeat``: repeat period of the sea, s.
    """
    longest, periods = _value_or(timing.settle_s, 10.0), timing.periods or 1
    models = timing.settle == "measured"
    least_settle = min(LEAST_SETTLE_S, longest) if models else longest
    if timing.end is None:
        measure = periods * repeat
        return RowWindows(longest, measure, 0.0, least_settle, periods, models_settle=models)
    end, bin_s = timing.end, repeat / BINS
    shortest = PER_BATCH * LEAST_BATCHES * bin_s
    least = _value_or(end.least_s, shortest)
    if end.least_periods is not None:
        message = "an irregular sea has end.least_s; leave the key out"
        raise WindowError(("timing", "end", "least_periods"), end.least_periods, message)
    if repeat < LEAST_REPEAT_S:
        message = (
            f"a repeat period of {format_number(repeat)} s is too short for rows that end before "
            f"it; allowed from {format_number(LEAST_REPEAT_S)} s on"
        )
        raise WindowError(("timing", "end"), None, message)
    if periods != 1:
        message = "rows that end by their power have one repeat period at most; allowed 1"
        raise WindowError(("timing", "periods"), periods, message)
    if not shortest * (1.0 - _ROUNDING) <= least <= repeat:
        message = (
            f"{format_number(least)} s are not within the repeat period; allowed "
            f"{format_number(shortest)} .. {format_number(repeat)} s"
        )
        raise WindowError(("timing", "end", "least_s"), least, message)
    batches = math.ceil(least / (PER_BATCH * bin_s) - _ROUNDING)
    return RowWindows(
        longest + bin_s,
        repeat,
        0.0,
        least_settle,
        1,
        least_settle,
        batches * PER_BATCH * bin_s,
        bin_s,
        models,
    )


def calibration_window(sea: AnySea, timing: Timing) -> RowWindows:
    """Return the window of a wave calibration, whole repeat periods; raises `WindowError`.

    The default is four periods of an irregular sea (as in the basin's own calibration record in
    the public fbWecCntrl repository), or the periods of a regular sea that fit into 60 s.
    """
    if isinstance(sea, CalmSea):
        raise WindowError(("sea",), "calm", "calm water has no waves to calibrate")
    regular = isinstance(sea, RegularSea)
    period = sea.period if isinstance(sea, RegularSea) else sea.repeat
    periods = timing.periods or (_count_periods(60.0, period) if regular else 4)
    if (
        isinstance(sea, RecordedSea)
        and _count_periods(length := sea.end_s - sea.start_s, period) * period < length - 1e-6
    ):
        raise WindowError(
            ("sea",),
            length,
            f"the record's window of {format_number(length)} s is not a whole number of its repeat "
            f"periods of {format_number(period)} s, so it does not repeat",
        )
    interval = _value_or(timing.interval_s, periods * period)
    period_name = "wave period" if regular else "repeat period"
    window = _whole_periods(timing, 0.0, interval, period, period_name, 0.0)
    return RowWindows(0.0, window.measure, 0.0, 0.0, window.periods)


def repeat_period(sea: AnySea) -> float | None:
    """Return the repeat period of a sea, s; None in calm water."""
    if isinstance(sea, RegularSea):
        return sea.period
    return getattr(sea, "repeat", None)


def _calm_windows(timing: Timing) -> RowWindows:
    if timing.periods is not None:
        message = f"{timing.periods} periods, but a calm sea has none; leave the key out"
        raise WindowError(("timing", "periods"), timing.periods, message)
    settle = _value_or(timing.settle_s, 5.0)
    interval = _value_or(timing.interval_s, 20.0)
    _check_interval(timing, settle, interval)
    return RowWindows(settle, interval - settle, 0.0, interval, 0)


def _reference_windows(reference: AnyReference, timing: Timing) -> RowWindows:
    """Return windows of whole repeat periods of an open-loop force; a sine as a regular sea."""
    assert reference is not None
    if isinstance(reference, SineReference):
        settle = _value_or(timing.settle_s, 5.0)
        interval = _value_or(timing.interval_s, 20.0)
        period = reference.period
        return _whole_periods(timing, settle, interval, period, "period of the reference", interval)
    settle = _value_or(timing.settle_s, 10.0)
    interval = _value_or(timing.interval_s, settle + reference.period * (timing.periods or 1))
    period_name = "repeat period of the reference"
    return _whole_periods(timing, settle, interval, reference.period, period_name, settle)


def _whole_periods(
    timing: Timing, settle: float, interval: float, period: float, period_name: str, move: float
) -> RowWindows:
    """Return windows with the given number of periods, or with the most that fit.

    Raises `WindowError` if the periods do not fit; ``period_name`` is the text in its message.
    """
    max_periods = _count_periods(interval - settle, period)
    periods = timing.periods or max(max_periods, 1)
    if periods > max_periods:
        min_interval = math.ceil((settle + periods * period) * 1000.0 - _ROUNDING) / 1000.0
        count = f"{periods} {period_name}s" if periods > 1 else f"one {period_name}"
        fit = "do not fit" if periods > 1 else "does not fit"
        key = ("timing", "interval_s") if timing.interval_s is not None else ("timing",)
        settling = f" after {format_number(settle)} s of settling" if settle else ""
        raise WindowError(
            key,
            interval,
            f"{count} of {period:.4g} s{settling} {fit} into "
            f"an interval of {format_number(interval)} s; allowed interval_s at least "
            f"{format_number(min_interval)} s",
        )
    measure = periods * period
    tail = interval - settle - measure
    return RowWindows(settle, measure, tail if tail > 1e-6 else 0.0, move, periods)


def _count_periods(duration: float, period: float) -> int:
    """Return the number of whole periods in a duration."""
    return math.floor(duration / period + _ROUNDING)


def _check_interval(timing: Timing, settle: float, interval: float) -> None:
    """Raise `WindowError` unless the interval is longer than the settling time."""
    if interval <= settle:
        key = "interval_s" if timing.interval_s is not None else "settle_s"
        raise WindowError(
            ("timing", key),
            interval if key == "interval_s" else settle,
            f"an interval of {format_number(interval)} s leaves nothing to measure after "
            f"{format_number(settle)} s of settling",
        )


def _value_or(value: float | None, default: float) -> float:
    return default if value is None else value
