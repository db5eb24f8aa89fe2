"""Predicted use of each limit by each row."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal, NamedTuple

from rig.config.yaml_source import KeyPath
from rig.kinds.wavebot.config.limits_file import LimitsFile
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.kinds.wavebot.predictions.bus import Bus
from rig.kinds.wavebot.predictions.row_prediction import RowPredictions
from rig.planning.campaign.set_points import RowSetting

Role = Literal["limits", "rig", "plant", "campaign"]
"""The file that defines a limit; "campaign" for the stability of the row's own gains."""

Effect = Literal["stop", "cut", "warn", "unstable"]
"""Effect beyond a limit: the rig trips, it cuts force, it warns, or the motion grows."""

NEAR = 0.9  # share of a stop limit that counts as near: the motion overshoots after a change of row


class Limit(NamedTuple):
    """One limit and the key that defines it."""

    name: str  # as in the table of `rig check`
    role: Role
    key: KeyPath
    effect: Effect
    unit: str
    quantity: str  # predicted quantity
    is_lower_bound: bool = False


class Margin(NamedTuple):
    """A predicted value and its limit."""

    limit: Limit
    predicted: float
    allowed: float
    at_rest: float = 0.0  # value without waves

    @property
    def used(self) -> float:
        """Used share of the limit, counted from the value at rest; above 1 it is exceeded."""
        if self.limit.is_lower_bound and self.at_rest == 0.0:
            return self.allowed / self.predicted if self.predicted > 0.0 else math.inf
        span = self.allowed - self.at_rest
        if (span > 0.0) == self.limit.is_lower_bound or not math.isfinite(self.predicted):
            return math.inf  # limit exceeded at rest, or not a number
        return (self.predicted - self.at_rest) / span

    @property
    def exceeded(self) -> bool:
        """True beyond the limit and for a prediction that is not a number."""
        return not self.used <= 1.0

    @property
    def near(self) -> bool:
        """True within the limit but close to a stop or to instability."""
        matters = self.limit.effect == "stop" or self.limit in (LOOP, SURGE_LOOP)
        return not self.exceeded and matters and self.used >= NEAR


def _limit(
    name: str, key: str, effect: Effect, unit: str, quantity: str, role: Role = "limits",
    *, is_lower_bound: bool = False,
) -> Limit:  # fmt: skip
    return Limit(name, role, tuple(key.split(".")), effect, unit, quantity, is_lower_bound)


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
    is_lower_bound=True,
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
    "rig", is_lower_bound=True,
)  # fmt: skip
LOOP = _limit("loop gain", "", "unstable", "1", "gain margin", "campaign", is_lower_bound=True)
SURGE_LOOP = _limit(
    "surge gain", "", "unstable", "1", "surge gain margin", "campaign", is_lower_bound=True
)

_RELATIVE_TO_REST = (BUS, OVERVOLTAGE, UNDERVOLTAGE)


def compute_margins(
    bounds: LimitsFile,
    rig: RigFile,
    setting: RowSetting,
    predictions: RowPredictions,
    bus: Bus | None,
    bus_at_rest: float,
) -> tuple[Margin, ...]:
    """Return a row's use of each limit.

    ``bus`` is that of the custom drive, ``bus_at_rest`` its voltage before any motion (V).
    """
    heave, surge = bounds.heave, bounds.surge
    x = predictions.position_peak
    rest_voltage = bus_at_rest
    pairs: list[tuple[Limit, float | None, float]] = [
        (POSITION_WARN, x, heave.position_warn_m),
        (POSITION, x, heave.position_stop_m),
        (STROKE, x, rig.spring.stroke(setting.spring_rate)),
        (ROTOR, x, bounds.spring.rotor_travel_stop_m),
        (VELOCITY, predictions.velocity_peak, heave.velocity_stop_m_per_s),
        (CURRENT_PEAK, predictions.current_peak, heave.current_peak_a),
        (CURRENT_RMS, predictions.current_rms_peak, heave.current_rms_a),
        (BUS, predictions.voltage_highest, bounds.bus.voltage_stop_v),
        (SURGE_WARN, predictions.surge_position_peak, surge.position_warn_m),
        (SURGE_POSITION, predictions.surge_position_peak, surge.position_stop_m),
        (SURGE_VELOCITY, predictions.surge_velocity_peak, surge.velocity_stop_m_per_s),
        (SURGE_PEAK, predictions.surge_current_peak, surge.current_peak_a),
        (SURGE_RMS, predictions.surge_current_rms_peak, surge.current_rms_a),
        (STIFFNESS, predictions.stiffness, rig.stability.least_stiffness_n_per_m),
        (LOOP, predictions.gain_margin, 1.0),
        (SURGE_LOOP, predictions.surge_gain_margin, 1.0),
    ]
    if bus is not None and predictions.voltage_available is not None:
        pairs += [
            (OVERVOLTAGE, predictions.voltage_highest, bus.overvoltage),
            (UNDERVOLTAGE, predictions.voltage_lowest, bus.undervoltage),
            (MODULATION, predictions.voltage_required, predictions.voltage_available),
        ]
    return tuple(
        Margin(limit, predicted, allowed, rest_voltage if limit in _RELATIVE_TO_REST else 0.0)
        for limit, predicted, allowed in pairs
        if predicted is not None
    )


def blocking_margins(margins: tuple[Margin, ...]) -> Iterator[Margin]:
    """Yield the exceeded limits that refuse a row: the rig would trip or be unstable."""
    return (m for m in margins if m.exceeded and m.limit.effect in ("stop", "unstable"))


def warning_margins(margins: tuple[Margin, ...]) -> Iterator[Margin]:
    """Yield the limits that give a warning: force is cut, a warning is due or a stop is near."""
    return (m for m in margins if (m.exceeded and m.limit.effect in ("cut", "warn")) or m.near)


def tightest(margins: tuple[Margin, ...]) -> Margin:
    """Return the limit with the highest use, warning limits excluded."""
    return max((m for m in margins if m.limit.effect != "warn"), key=lambda m: m.used)
