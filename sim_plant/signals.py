"""Signals on the wires between a rig and the simulated WaveBot."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import (
    Ampere,
    Code,
    Count,
    Flag,
    Metre,
    Newton,
    Percent,
    Radian,
    Second,
    Volt,
    Watt,
)


class Actuation(NamedTuple):
    """Commands from the control computer to the rig."""

    heave_current: Ampere  # commanded drive current, F/(Kt N)
    heave_enable: Flag  # 1: drive enable is requested
    stator_target: Percent
    stator_enable: Flag  # 1: actuator follows its target, 0: holds where it is
    wave_trigger: Flag  # 1: wave maker runs; its rising edge is t = 0 of the wave clock
    surge_current: Ampere  # commanded drive current, F/(Kt N)
    surge_enable: Flag
    conducting: Flag  # 0: the custom drive's power stage is gated off (no torque)


class Readings(NamedTuple):
    """Measurements from the rig: values sampled `delay_ticks` ticks ago."""

    heave_counts: Count  # motor encoder, with an arbitrary starting offset
    heave_current: Ampere
    heave_enabled: Flag
    heave_fault: Code  # 0 none, 1 general, 2 undervoltage, 3 overvoltage
    surge_counts: Count
    surge_current: Ampere
    surge_enabled: Flag
    surge_fault: Code
    force_lcb: Newton  # column load cell, force on the body
    force_trs: Newton  # shaft torque sensor as linear force on the body
    force_slew: Newton  # spring torque over its 0.254 m lever, positive if restoring
    force_stator_a: Newton  # axial force of the magnetic spring's stator: A + B
    force_stator_b: Newton
    string_pot: Metre  # second, independent heave position
    rotor_angle: Radian
    stator_position: Percent
    stator_arrived: Flag  # 1: at target and at rest
    power_ac: Watt  # mean over the analyser's own window, absorbed negative
    power_dc: Watt
    bus_voltage: Volt
    analyser_age: Second  # time since the analyser's last value
    drive_saturated: Flag  # 1: the heave drive gives less current than commanded
    drive_dump: Code  # mask of the dump resistors that conduct now
    drive_conducting: Flag  # 1: the heave drive's power stage switches
    elevation: Metre  # undisturbed at the device (truth)
    probe_1: Metre  # basin probes: undisturbed plus radiated wave at their positions
    probe_2: Metre
    probe_3: Metre
    probe_age: Second  # time since the probes' last sample


OFF = Actuation(0.0, 0, 0.0, 0, 0, 0.0, 0, 1)
"""No request: drives off, stator held, wave maker off."""
