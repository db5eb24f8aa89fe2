"""Travel of waves in a tank: when they reach the device, and when their reflection is back.

Energy travels with the group velocity c_g = (omega / 2k) (1 + 2kh / sinh 2kh), with
omega² = g k tanh(kh) at the local depth h (linear waves on a slowly varying bottom; R. G. Dean and
R. A. Dalrymple, Water Wave Mechanics for Engineers and Scientists, sections 3.4 and 4.8).
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from rig.config.problems import Problem, format_number, number_ranges
from rig.config.sea import AnySea, JonswapSea, MultisineSea, PinkSea, RegularSea
from rig.config.tank import BEFORE_REFLECTION, Tank
from rig.config.yaml_source import SourceMap
from rig.planning.segments import PlanSegment
from rig.planning.windows import WindowError, repeat_period
from rig.realtime.sequence import NO_ROW, Phase, Segments

GRAVITY = 9.80665  # m/s2
_PANELS = 400  # of Simpson's rule over a beach
BAND_EDGE = 0.05  # share of the energy of a JONSWAP sea beyond either end of its band
_ROUNDING = 1.0e-9  # periods

S = TypeVar("S")


class TankTimes(NamedTuple):
    """Times on the wave clock for the waves of a sea, s."""

    first: float  # the first waves reach the device
    full: float  # all waves have their full height there
    reflected: float  # the first reflected waves are back
    longest: float  # period of the fastest waves
    shortest: float


def wave_number(omega: float, depth: float, gravity: float = GRAVITY) -> float:
    """Return k of omega² = g k tanh(k h), 1/m, by Newton's method; `depth` may be infinite."""
    deep = omega * omega / gravity
    if math.isinf(depth):
        return deep
    kh = max(deep * depth, math.sqrt(deep * depth))
    for _ in range(50):
        tanh = math.tanh(kh)
        change = (kh * tanh - deep * depth) / (tanh + kh * (1.0 - tanh * tanh))
        kh -= change
        if abs(change) < 1e-14 * kh:
            break
    return kh / depth


def group_velocity(period: float, depth: float) -> float:
    """Return the velocity of the waves' energy, m/s."""
    k = wave_number(2.0 * math.pi / period, depth)
    kh = k * depth
    # sinh overflows; deep water has no second term.
    shallow = 2.0 * kh / math.sinh(2.0 * kh) if kh < 300.0 else 0.0
    return math.pi / (period * k) * (1.0 + shallow)


def travel_time(tank: Tank, period: float) -> float:
    """Return the time from the wave maker to the device, s.

    ``device_m`` may be above the beach.
    """
    return _time_to(tank, period, tank.device_m)


def reflection_time(tank: Tank, period: float) -> float:
    """Return the time from the device to beach or wall and back, s."""
    return 2.0 * (_time_to(tank, period, tank.shore_m) - _time_to(tank, period, tank.device_m))


def _time_to(tank: Tank, period: float, place: float) -> float:
    flat = place if tank.beach is None else min(place, tank.beach.start_m)
    time = flat / group_velocity(period, tank.depth_m)
    if tank.beach is None or place <= flat:
        return time
    # Over the beach with u² = depth there / depth: the integrand is smooth up to the shore, u = 0.
    least = max(1.0 - (place - flat) * tank.beach.slope / tank.depth_m, 0.0)
    u = np.linspace(math.sqrt(least), 1.0, _PANELS + 1)
    slowness = np.empty_like(u)  # u / c_g
    for at, share in enumerate(u.tolist()):
        if share > 0.0:
            slowness[at] = share / group_velocity(period, tank.depth_m * share * share)
        else:
            slowness[at] = 1.0 / math.sqrt(GRAVITY * tank.depth_m)
    weights = np.ones(_PANELS + 1)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    integral = float(weights @ slowness) * (1.0 - math.sqrt(least)) / (3.0 * _PANELS)
    return time + 2.0 * tank.depth_m / tank.beach.slope * integral


def sea_periods(sea: AnySea) -> tuple[float, float] | None:
    """Return the longest and the shortest period of a sea's waves, s; None for unknown ones.

    Of a JONSWAP sea they bound the band with 90 % of the energy.
    """
    if isinstance(sea, RegularSea):
        return sea.period, sea.period
    if isinstance(sea, JonswapSea):
        low, high = _jonswap_band(sea.gamma)
        return sea.tp_s / low, sea.tp_s / high
    if isinstance(sea, (PinkSea, MultisineSea)):
        return 1.0 / sea.low_hz, 1.0 / sea.high_hz
    return None


def _jonswap_band(gamma: float) -> tuple[float, float]:
    """Return the frequencies, per peak frequency, below and above which `BAND_EDGE` is."""
    ratio = np.linspace(0.3, 12.0, 20_000)
    width = np.where(ratio <= 1.0, 0.07, 0.09)
    peak = gamma ** np.exp(-((ratio - 1.0) ** 2) / (2.0 * width**2))
    energy = np.cumsum(ratio**-5 * np.exp(-1.25 * ratio**-4) * peak)
    low, high = np.interp([BAND_EDGE, 1.0 - BAND_EDGE], energy / energy[-1], ratio)
    return float(low), float(high)


@lru_cache(maxsize=16)  # plan and report need them several times
def tank_times(tank: Tank, sea: AnySea) -> TankTimes | None:
    """Return when the waves of a sea arrive and return; None for a sea without known periods."""
    periods = sea_periods(sea)
    if periods is None:
        return None
    longest, shortest = periods
    first = tank.still_s + travel_time(tank, longest)
    return TankTimes(
        first,
        tank.still_s + tank.ramp_s + travel_time(tank, shortest),
        first + reflection_time(tank, longest),
        longest,
        shortest,
    )


def end_before_reflection(
    tank: Tank, sea: AnySea, plan_segments: Sequence[PlanSegment[S]]
) -> list[PlanSegment[S]]:
    """Return a plan whose windows end before the first reflected waves, if ``tank`` asks for it.

    Windows keep whole wave or repeat periods as far as one fits; the rest of the row is its tail.
    Of an irregular sea a part of its repeat period may be left. Raises `WindowError` if a row has
    nothing left, or if the sea's periods are unknown.
    """
    period = repeat_period(sea)
    if tank.windows != BEFORE_REFLECTION or period is None:
        return list(plan_segments)
    if (times := tank_times(tank, sea)) is None:
        message = "the periods of a recorded sea are unknown, and with them the reflection"
        raise WindowError(("tank", "windows"), tank.windows, message)
    ended: list[PlanSegment[S]] = []
    clock, cut = 0.0, 0.0
    for segment in plan_segments:
        begin, seconds = clock, segment.seconds
        clock += seconds if segment.waves else 0.0
        if segment.phase is Phase.MEASURE and clock > times.reflected:
            left = times.reflected - begin
            whole = math.floor(left / period + _ROUNDING) * period
            kept = left if whole <= 0.0 and not isinstance(sea, RegularSea) else whole
            if kept <= 0.0:
                raise _nothing_left(tank, segment.row, begin, times.reflected, period)
            seconds, cut = kept, seconds - kept
        elif segment.phase is Phase.TAIL:
            seconds, cut = seconds + cut, 0.0
        ended.append(segment._replace(seconds=seconds))
    return ended


def _nothing_left(
    tank: Tank, row: int, begin: float, reflected: float, period: float
) -> WindowError:
    where = "the window" if row == NO_ROW else f"the window of row {row}"
    message = (
        f"{where} begins {begin:.1f} s after the start of the waves, the first reflected ones are "
        f"back after {reflected:.1f} s: nothing of its periods of {format_number(period)} s "
        "is left; run fewer rows, or shorten lead-in and settling"
    )
    return WindowError(("tank", "windows"), tank.windows, message)


def tank_line(times: TankTimes) -> str:
    """Return when waves arrive and return, for people."""
    waves = f"{times.longest:.4g}"
    if times.shortest != times.longest:
        waves += f" .. {times.shortest:.4g}"
    return (
        f"waves of {waves} s: at the device after {times.first:.1f} s, full height after "
        f"{times.full:.1f} s, reflected ones after {times.reflected:.1f} s"
    )


def tank_warnings(
    times: TankTimes, stages: Iterable[Segments], dt: float, locate: SourceMap
) -> Iterator[Problem]:
    """Yield a warning about rows measured before the full waves, and about those with reflections.

    ``stages``: segments of the plan of each sea; ``dt``: of their ticks, s; ``locate``: of the
    campaign file.
    """
    windows = [window for segments in stages for window in _measured(segments, dt)]
    early = [row for row, start, _ in windows if start < times.full - dt]
    late = [row for row, _, end in windows if end > times.reflected + dt]
    if early:
        first = min(start for row, start, _ in windows if row == early[0])
        message = (
            f"{_rows(early)} measured from {first:.1f} s on, before the waves have their full "
            f"height at the device ({times.full:.1f} s); {math.ceil(times.full - first)} s more of "
            "lead-in are enough"
        )
        yield locate.problem(("tank",), None, message)
    if late:
        message = (
            f"{_rows(late)} measured after the first reflected waves are back at the device "
            f"({times.reflected:.1f} s)"
        )
        yield locate.problem(("tank",), None, message)


def _measured(segments: Segments, dt: float) -> Iterator[tuple[int, float, float]]:
    """Yield row, start and end of each measured window on the wave clock, s."""
    clock = 0
    for row, phase, ticks, waves in zip(
        segments.row, segments.phase, segments.ticks, segments.waves, strict=True
    ):
        if phase == Phase.MEASURE and row != NO_ROW:
            yield row, clock * dt, (clock + ticks) * dt
        clock += ticks if waves else 0


def _rows(rows: list[int]) -> str:
    if len(rows) == 1:
        return f"row {rows[0]} is"
    return f"rows {', '.join(number_ranges(rows))} ({len(rows)}) are"
