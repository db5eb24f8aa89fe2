"""Between loop and plant in one compiled tick, as functions.

They do what `rig.execution.rehearsal.devices` does.
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
from rig.kinds.wavebot import Command, LoadSense, PowerSense, Sense, WaveSense
from rig.realtime import cycle
from sim_plant.signals import Actuation, Readings
from sim_plant.wave_maker import Sea
from sim_plant.wavebot import FREE, WaveBotState


class Machine(NamedTuple):
    """All that changes from tick to tick, on both sides of the wire."""

    tick: int
    loop: cycle.State
    plant: WaveBotState
    sea: Sea
    line: tuple[Readings, ...]  # on their way to the loop, oldest first
    wire: Actuation  # as last told
    fresh: int  # 1: told since the plant's last step
    settings: DriveSettings  # of the custom drive, as last set
    linger: int  # ticks since power was removed


def unhoisted(state: WaveBotState) -> WaveBotState:
    """The plant as it is, for there is no hoist here: compiled code then looks for none."""
    body, electric, stator, surge, passive, _, probes = state
    return WaveBotState(body, electric, stator, surge, passive, FREE, probes)


def sense(readings: Readings, late: float) -> Sense:
    """What the loop reads; ``late`` (s) is how old it is."""
    (
        counts, current, enabled, fault,
        surge_counts, surge_current, surge_enabled, surge_fault,
        lcb, trs, slew, stator_a, stator_b, string_pot, rotor_angle,
        stator, arrived, ac, dc, bus_voltage, analyser_age,
        saturated, dump, conducting, elevation, probe_1, probe_2, probe_3, probe_age,
    ) = readings  # fmt: skip
    return Sense(
        AxisSense(counts, late, current, enabled, fault, late),
        AxisSense(surge_counts, late, surge_current, surge_enabled, surge_fault, late),
        LoadSense(lcb, trs, slew, stator_a, stator_b, string_pot, rotor_angle, late),
        SpringSense(stator, arrived, late),
        PowerSense(ac, dc, bus_voltage, analyser_age),
        DriveSense(conducting, saturated, dump),
        ProbeSense(probe_1, probe_2, probe_3, probe_age),
        WaveSense(elevation),
        PanelSense(0, 0, 0.0),
    )


def actuation(command: Command) -> Actuation:
    """What the plant is told."""
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
