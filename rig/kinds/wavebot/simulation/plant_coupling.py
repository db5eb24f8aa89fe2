"""Conversion between the signals of loop and plant in one compiled tick.

The functions are equivalent to `rig.kinds.wavebot.rehearsal.devices`.
"""

from typing import NamedTuple

from controllers.signals import (
    AxisSense,
    DriveSense,
    DriveSettings,
    PanelSense,
    ProbeSense,
    SpringSense,
)
from rig.kinds.wavebot.tick import Command, LoadSense, PowerSense, Sense, WaveSense
from rig.realtime import cycle
from sim_plant.signals import Actuation, Readings
from sim_plant.wave_maker import WaveMakerState
from sim_plant.wavebot import NO_HOIST, WaveBotState


class CoupledState(NamedTuple):
    """State of loop, plant and the delayed signals between them."""

    tick: int
    loop: cycle.State
    plant: WaveBotState
    sea: WaveMakerState
    in_transit: tuple[Readings, ...]  # delayed readings for the loop, oldest first
    plant_input: Actuation  # last command
    new_input: int  # 1: ``plant_input`` arrived after the plant's last step
    settings: DriveSettings  # last settings of the custom drive
    linger: int  # ticks since power was removed


def without_hoist(state: WaveBotState) -> WaveBotState:
    """Return the same state with a constant hoist; the compiler then removes the hoist's code."""
    body, electric, stator, surge, passive, _, probes = state
    return WaveBotState(body, electric, stator, surge, passive, NO_HOIST, probes)


def sense(readings: Readings, age: float) -> Sense:
    """Return the loop's input for readings of the plant; ``age`` is their age, s."""
    (
        counts, current, enabled, fault,
        surge_counts, surge_current, surge_enabled, surge_fault,
        lcb, trs, slew, stator_a, stator_b, string_pot, rotor_angle,
        stator, arrived, ac, dc, bus_voltage, analyser_age,
        saturated, dump, conducting, elevation, probe_1, probe_2, probe_3, probe_age,
    ) = readings  # fmt: skip
    return Sense(
        AxisSense(counts, age, current, enabled, fault, age),
        AxisSense(surge_counts, age, surge_current, surge_enabled, surge_fault, age),
        LoadSense(lcb, trs, slew, stator_a, stator_b, string_pot, rotor_angle, age),
        SpringSense(stator, arrived, age),
        PowerSense(ac, dc, bus_voltage, analyser_age),
        DriveSense(conducting, saturated, dump),
        ProbeSense(probe_1, probe_2, probe_3, probe_age),
        WaveSense(elevation),
        PanelSense(0, 0, 0.0),
    )


def actuation(command: Command) -> Actuation:
    """Return the plant's input for a command of the loop."""
    heave, surge, spring, drive, waves = command
    return Actuation(
        heave.current,
        heave.enable,
        spring.target,
        spring.enable,
        waves,
        surge.current,
        surge.enable,
        drive.conducting,
    )
