"""How much of each limit a row is predicted to use."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal, NamedTuple

from rig.config.limits_file import LimitsFile
from rig.config.rig_file import RigFile
from rig.config.yaml_source import KeyPath
from rig.design.predictions.bus import Bus
from rig.design.predictions.row_prediction import RowPredictions
from rig.planning.campaign.set_points import RowSetting

Role = Literal["limits", "rig", "plant", "campaign"]
"""The file a limit stands in; the campaign for what is no limit but the row itself."""

Effect = Literal["stop", "cut", "warn", "unstable"]
"""What happens beyond a limit: the rig trips, force is cut, it is told, or the motion grows."""

NEAR = 0.9  # of a stop: waves change rows, and the motion overshoots for a while


class Limit(NamedTuple):
    """One limit and where it stands."""

    name: str  # as in the table
    role: Role
    key: KeyPath
    effect: Effect
    unit: str
    words: str  # what is predicted
    least: bool = False  # True: a bound from below


class Margin(NamedTuple):
    """A prediction against a limit."""

    limit: Limit
    predicted: float
    allowed: float
    rest: float = 0.0  # what it is without waves

    @property
    def used(self) -> float:
        """Share of the limit that is used up, from what there is at rest; above 1 it is broken."""
        if self.limit.least and self.rest == 0.0:
            return self.allowed / self.predicted if self.predicted > 0.0 else math.inf
        room = self.allowed - self.rest
        if (room > 0.0) == self.limit.least or not math.isfinite(self.predicted):
            return math.inf  # beyond what is allowed already at rest, or no number
        return (self.predicted - self.rest) / room

    @property
    def broken(self) -> bool:
        """True beyond the limit, and for a prediction that is no number."""
        return not self.used <= 1.0

    @property
    def near(self) -> bool:
        """True close to a limit that stops the rig or makes it unstable, short of breaking it."""
        grave = self.limit.effect == "stop" or self.limit in (LOOP, SURGE_LOOP)
        return not self.broken and grave and self.used >= NEAR


def _limit(
    name: str, key: str, effect: Effect, unit: str, words: str, role: Role = "limits",
    *, least: bool = False,
) -> Limit:  # fmt: skip
    return Limit(name, role, tuple(key.split(".")), effect, unit, words, least)


POSITION_WARN = _limit("position warn", "heave.position_warn_m", "warn", "m", "position peak")
POSITION = _limit("position", "heave.position_stop_m", "stop", "m", "position peak")
STROKE = _limit("spring stroke", "spring.map", "stop", "m", "position peak", "rig")
ROTOR = _limit("rotor travel", "spring.rotor_travel_stop_m", "stop", "m", "rotor travel")
VELOCITY = _limit("velocity", "heave.velocity_stop_m_per_s", "stop", "m/s", "velocity peak")
CURRENT_PEAK = _limit("current peak", "heave.current_peak_a", "cut", "A", "current peak")
CURRENT_RMS = _limit("current rms", "heave.current_rms_a", "cut", "A", "current rms")
BUS = _limit("bus voltage", "bus.voltage_stop_v", "stop", "V", "bus voltage")
OVERVOLTAGE = _limit(
    "bus overvoltage", "drive.overvoltage_trip.value", "stop", "V", "bus voltage", "plant"
)
UNDERVOLTAGE = _limit(
    "bus undervoltage", "drive.undervoltage_share.value", "stop", "V", "bus voltage", "plant",
    least=True,
)  # fmt: skip
MODULATION = _limit(
    "modulation", "drive.scheme_modulation.value", "cut", "V", "voltage need", "plant"
)
SURGE_WARN = _limit(
    "surge position warn", "surge.position_warn_m", "warn", "m", "surge position peak"
)
SURGE_POSITION = _limit(
    "surge position", "surge.position_stop_m", "stop", "m", "surge position peak"
)
SURGE_VELOCITY = _limit(
    "surge velocity", "surge.velocity_stop_m_per_s", "stop", "m/s", "surge velocity peak"
)
SURGE_PEAK = _limit("surge current peak", "surge.current_peak_a", "cut", "A", "surge current peak")
SURGE_RMS = _limit("surge current rms", "surge.current_rms_a", "cut", "A", "surge current rms")
STIFFNESS = _limit(
    "stiffness", "stability.least_stiffness_n_per_m", "unstable", "N/m", "stiffness at rest",
    "rig", least=True,
)  # fmt: skip
LOOP = _limit("loop gain", "", "unstable", "1", "gain margin", "campaign", least=True)
SURGE_LOOP = _limit("surge gain", "", "unstable", "1", "surge gain margin", "campaign", least=True)

_FROM_REST = (BUS, OVERVOLTAGE, UNDERVOLTAGE)


def margins(
    bounds: LimitsFile,
    rig: RigFile,
    setting: RowSetting,
    found: RowPredictions,
    bus: Bus | None,
    bus_at_rest: float,
) -> tuple[Margin, ...]:
    """What a row uses of each limit; ``bus`` is the custom drive's, ``bus_at_rest`` in volts."""
    heave, surge = bounds.heave, bounds.surge
    x = found.position_peak
    volts = bus_at_rest
    pairs: list[tuple[Limit, float | None, float]] = [
        (POSITION_WARN, x, heave.position_warn_m),
        (POSITION, x, heave.position_stop_m),
        (STROKE, x, rig.spring.stroke(setting.spring_rate)),
        (ROTOR, x, bounds.spring.rotor_travel_stop_m),
        (VELOCITY, found.velocity_peak, heave.velocity_stop_m_per_s),
        (CURRENT_PEAK, found.current_peak, heave.current_peak_a),
        (CURRENT_RMS, found.current_held, heave.current_rms_a),
        (BUS, found.voltage_highest, bounds.bus.voltage_stop_v),
        (SURGE_WARN, found.surge_position_peak, surge.position_warn_m),
        (SURGE_POSITION, found.surge_position_peak, surge.position_stop_m),
        (SURGE_VELOCITY, found.surge_velocity_peak, surge.velocity_stop_m_per_s),
        (SURGE_PEAK, found.surge_current_peak, surge.current_peak_a),
        (SURGE_RMS, found.surge_current_held, surge.current_rms_a),
        (STIFFNESS, found.stiffness, rig.stability.least_stiffness_n_per_m),
        (LOOP, found.gain_margin, 1.0),
        (SURGE_LOOP, found.surge_gain_margin, 1.0),
    ]
    if bus is not None and found.voltage_given is not None:
        pairs += [
            (OVERVOLTAGE, found.voltage_highest, bus.overvoltage),
            (UNDERVOLTAGE, found.voltage_lowest, bus.undervoltage),
            (MODULATION, found.voltage_need, found.voltage_given),
        ]
    return tuple(
        Margin(limit, predicted, allowed, volts if limit in _FROM_REST else 0.0)
        for limit, predicted, allowed in pairs
        if predicted is not None
    )


def broken(margins: tuple[Margin, ...]) -> Iterator[Margin]:
    """Limits that refuse a row: beyond them it trips or grows."""
    return (m for m in margins if m.broken and m.limit.effect in ("stop", "unstable"))


def warned(margins: tuple[Margin, ...]) -> Iterator[Margin]:
    """Limits that are told: force is cut, a warning is due, or a stop is near."""
    return (m for m in margins if (m.broken and m.limit.effect in ("cut", "warn")) or m.near)


def tightest(margins: tuple[Margin, ...]) -> Margin:
    """The limit of which most is used, warnings left aside."""
    return max((m for m in margins if m.limit.effect != "warn"), key=lambda m: m.used)
