"""What is predicted of one row."""

from __future__ import annotations

from typing import NamedTuple


class RowPredictions(NamedTuple):
    """What is predicted of a row; peaks are either way from zero, over the sea's repeat period."""

    position_peak: float  # m
    position_rms: float  # m
    stroke: float  # m, from lowest to highest
    velocity_peak: float  # m/s
    force_peak: float  # N, commanded
    force_rms: float  # N
    current_peak: float  # A, what the demand takes before it is cut
    current_rms: float  # A
    current_held: float  # A, highest rms as the limiter averages it
    power_mechanical_1: float  # W, absorbed is negative
    power_mechanical_2: float
    power_ac: float
    power_dc: float
    voltage_need: float  # V, highest that the motor asks for
    voltage_given: float | None  # V, what modulation makes of the bus; None: not limited
    voltage_lowest: float  # V, of the DC bus
    voltage_highest: float
    dumped: float | None  # W, mean into the dump resistors; None: there are none
    surge_position_peak: float  # m
    surge_velocity_peak: float  # m/s
    surge_force_peak: float  # N, demanded
    surge_force_rms: float  # N
    surge_current_peak: float  # A
    surge_current_held: float  # A
    stiffness: float  # N/m, at rest
    spectral_radius: float  # of the sampled heave loop; below 1 is stable
    gain_margin: float  # 1, factor on its gains at which its stability ends
    decay: float  # s, of its slowest mode
    surge_spectral_radius: float | None  # None: the surge drive is off
    surge_gain_margin: float | None
    settled: bool  # the motion was found to within 1 % of its rms
