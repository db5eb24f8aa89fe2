"""Predicted values of one row."""

from __future__ import annotations

from typing import NamedTuple

from rig.kinds.wavebot.tick.stations import STATIONS


class RowPredictions(NamedTuple):
    """Predicted values of a row; peaks are magnitudes over the sea's repeat period."""

    position_peak: float  # m
    position_rms: float  # m
    stroke: float  # m, peak to peak
    velocity_peak: float  # m/s
    force_peak: float  # N, commanded
    force_rms: float  # N
    current_peak: float  # A, of the demand before the current limit
    current_rms: float  # A
    current_rms_peak: float  # A, peak of the limiter's moving rms
    power_mechanical_1: float  # W, absorbed is negative
    power_mechanical_2: float
    power_ac: float
    power_dc: float
    voltage_required: float  # V, peak of the motor voltage
    voltage_available: float | None  # V, bus voltage times modulation limit; None: not limited
    voltage_lowest: float  # V, of the DC bus
    voltage_highest: float
    dump_power: float | None  # W, mean into the dump resistors; None: no dump resistors
    surge_position_peak: float  # m
    surge_velocity_peak: float  # m/s
    surge_force_peak: float  # N, demanded
    surge_force_rms: float  # N
    surge_current_peak: float  # A
    surge_current_rms_peak: float  # A
    stiffness: float  # N/m, at rest
    spectral_radius: float  # of the sampled heave loop; stable below 1
    gain_margin: float  # 1, factor on its gains at which it becomes unstable
    decay_time: float  # s, time constant of its slowest mode
    surge_spectral_radius: float | None  # None: the surge drive is off
    surge_gain_margin: float | None
    converged: bool  # the last iteration changed the motion by less than 1 % of its rms


PREDICTED_STATIONS = tuple(s for s in STATIONS if f"power_{s.name}" in RowPredictions._fields)
"""The stations whose power is predicted."""
