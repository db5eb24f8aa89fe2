"""How a row's interval is cut into settling, measurement and rest.

Regular sea: 20 s, of which 5 s settle; the window is the largest whole number of wave periods
that fits. Irregular and recorded: 10 s settle and exactly one repeat period. `mask4` gives the
windows of the MASK4 report (Sandia): the same for regular seas, and for irregular ones rows of
300 s measured from 2 s on, which is 2 s short of the repeat period. In calm water an open-loop
reference takes the place of the sea: whole repeat periods of it; with a hoist its whole cycles.

A wave calibration has no rows: one window of whole periods after the lead-in.
"""

import math
from typing import NamedTuple

from rig.config.campaign_file import Timing
from rig.config.hoist import Hoist
from rig.config.problems import number_text
from rig.config.reference import AnyReference, SineReference
from rig.config.sea import AnySea, CalmSea, RecordedSea, RegularSea
from rig.config.yaml_source import KeyPath

_NEARLY = 1e-9  # a window that misses a whole period by rounding alone still holds it


class Windows(NamedTuple):
    """One row's interval, s, and what is held before it when the spring has to move."""

    settle: float
    measure: float
    tail: float
    move: float  # least length of the extra interval in which the stator moves
    periods: int  # whole wave or repeat periods in the measurement; 0: not a whole number of them

    @property
    def interval(self) -> float:
        """The whole row, s."""
        return self.settle + self.measure + self.tail


class WindowError(Exception):
    """No window can be cut; ``key`` is the key of the campaign file that should change."""

    def __init__(self, key: KeyPath, value: object, message: str) -> None:
        super().__init__(message)
        self.key = key
        self.value = value
        self.message = message


def windows(
    sea: AnySea, timing: Timing, reference: AnyReference = None, hoist: Hoist | None = None
) -> Windows:
    """Windows of every row of a campaign; raises `WindowError` if nothing fits.

    Before a row with another spring rate its combination is held for one more interval while the
    stator moves, as the MASK4 report does. An irregular sea would cost 300 s that way, so there
    the settling time is the least length (the plan waits for the stator anyway); `mask4` keeps
    the whole interval.
    """
    if hoist is not None:  # wherever it stands when the row begins: whole cycles see all of it
        settle = _given(timing.settle_s, 2.0)
        return Windows(settle, hoist.cycles * hoist.period, 0.0, settle, hoist.cycles)
    if isinstance(sea, CalmSea):
        return _calm(timing) if reference is None else _pushed(reference, timing)
    if isinstance(sea, RegularSea):
        settle = _given(timing.settle_s, 5.0)
        interval = _given(timing.interval_s, 20.0)
        return _whole_periods(timing, settle, interval, sea.period, "wave period", interval)
    if timing.scheme == "mask4" and timing.periods is None:
        settle = _given(timing.settle_s, 2.0)
        interval = _given(timing.interval_s, 300.0)
        _room(timing, settle, interval)
        periods = _fitting(interval - settle, sea.repeat)
        exact = abs(periods * sea.repeat - (interval - settle)) < 1e-6
        return Windows(settle, interval - settle, 0.0, interval, periods if exact else 0)
    mask4 = timing.scheme == "mask4"
    settle = _given(timing.settle_s, 2.0 if mask4 else 10.0)
    interval = _given(timing.interval_s, settle + sea.repeat * (timing.periods or 1))
    move = interval if mask4 else settle
    return _whole_periods(timing, settle, interval, sea.repeat, "repeat period", move)


def calibration(sea: AnySea, timing: Timing) -> Windows:
    """The one window of a wave calibration, whole repeat periods; raises `WindowError`.

    Four periods of an irregular sea unless the file says otherwise (four are also in the basin's
    own calibration record in the public fbWecCntrl repository), as many of a regular one as fit
    into 60 s.
    """
    if isinstance(sea, CalmSea):
        raise WindowError(("sea",), "calm", "calm water has no waves to calibrate")
    regular = isinstance(sea, RegularSea)
    period = sea.period if isinstance(sea, RegularSea) else sea.repeat
    periods = timing.periods or (_fitting(60.0, period) if regular else 4)
    if (
        isinstance(sea, RecordedSea)
        and _fitting(length := sea.end_s - sea.start_s, period) * period < length - 1e-6
    ):
        raise WindowError(
            ("sea",),
            length,
            f"the record's window of {number_text(length)} s is no whole number of its repeat "
            f"period of {number_text(period)} s, so it does not repeat",
        )
    interval = _given(timing.interval_s, periods * period)
    what = "wave period" if regular else "repeat period"
    cut = _whole_periods(timing, 0.0, interval, period, what, 0.0)
    return Windows(0.0, cut.measure, 0.0, 0.0, cut.periods)


def repeat_period(sea: AnySea) -> float | None:
    """Seconds after which a sea repeats; None in calm water."""
    if isinstance(sea, RegularSea):
        return sea.period
    repeat: float | None = getattr(sea, "repeat", None)
    return repeat


def _calm(timing: Timing) -> Windows:
    if timing.periods is not None:
        message = f"{timing.periods} periods of a calm sea; leave the key out"
        raise WindowError(("timing", "periods"), timing.periods, message)
    settle = _given(timing.settle_s, 5.0)
    interval = _given(timing.interval_s, 20.0)
    _room(timing, settle, interval)
    return Windows(settle, interval - settle, 0.0, interval, 0)


def _pushed(reference: AnyReference, timing: Timing) -> Windows:
    """Whole repeat periods of an open-loop force in calm water; a sine as a regular sea."""
    assert reference is not None
    if isinstance(reference, SineReference):
        settle = _given(timing.settle_s, 5.0)
        interval = _given(timing.interval_s, 20.0)
        period = reference.period
        return _whole_periods(timing, settle, interval, period, "period of the reference", interval)
    settle = _given(timing.settle_s, 10.0)
    interval = _given(timing.interval_s, settle + reference.period * (timing.periods or 1))
    what = "repeat period of the reference"
    return _whole_periods(timing, settle, interval, reference.period, what, settle)


def _whole_periods(
    timing: Timing, settle: float, interval: float, period: float, what: str, move: float
) -> Windows:
    fitting = _fitting(interval - settle, period)
    wanted = timing.periods or max(fitting, 1)
    if wanted > fitting:
        least = math.ceil((settle + wanted * period) * 1000.0 - _NEARLY) / 1000.0
        many = f"{wanted} {what}s" if wanted > 1 else f"one {what}"
        key = ("timing", "interval_s") if timing.interval_s is not None else ("timing",)
        settling = f" after {number_text(settle)} s of settling" if settle else ""
        raise WindowError(
            key,
            interval,
            f"{many} of {period:.4g} s{settling} does not fit into "
            f"an interval of {number_text(interval)} s; allowed interval_s at least "
            f"{number_text(least)} s",
        )
    measure = wanted * period
    tail = interval - settle - measure
    return Windows(settle, measure, tail if tail > 1e-6 else 0.0, move, wanted)


def _fitting(room: float, period: float) -> int:
    return math.floor(room / period + _NEARLY)


def _room(timing: Timing, settle: float, interval: float) -> None:
    if interval <= settle:
        key = "interval_s" if timing.interval_s is not None else "settle_s"
        raise WindowError(
            ("timing", key),
            interval if key == "interval_s" else settle,
            f"an interval of {number_text(interval)} s leaves nothing to measure after "
            f"{number_text(settle)} s of settling",
        )


def _given(value: float | None, default: float) -> float:
    return default if value is None else value
