"""Conversion between the signals of loop and plant in one compiled tick.

The functions are equivalent to `rig.kinds.wavebot.rehearsal.devices`.
"""

from typing import Any, NamedTuple

from controllers.signals import (
    AxisSense,
    DriveSense,
    DriveSettings,
    PanelSense,
    ProbeSense,
    SpringSense,
)
from rig.kinds.wavebot.rehearsal.noise import prefetch_ahead
from rig.kinds.wavebot.tick import Command, LoadSense, PowerSense, Sense, WaveSense
from sim_plant import wave_maker
from sim_plant.signals import Actuation, Readings
from sim_plant.wave_maker import WaveMakerState, WaveMakerTables
from sim_plant.wavebot import NO_HOIST, Excitation, WaveBotParams, WaveBotState, sample
from sim_plant.wavebot import step as plant_step


class Plant(NamedTuple):
    """Constants of the plant in its sea."""

    constants: WaveBotParams
    tables: WaveMakerTables
    normals: Any  # interleaved noise, see noise.py
    age: float  # s, of the readings


class Device(NamedTuple):
    """State of the plant, and the signals between plant and loop."""

    state: WaveBotState
    sea: WaveMakerState
    in_transit: tuple[Readings, ...]  # delayed readings for the loop, oldest first
    plant_input: Actuation  # last command
    new_input: int  # 1: ``plant_input`` arrived after the plant's last step
    settings: DriveSettings  # last settings of the custom drive
    sampled_tick: int  # of the sea when the plant was sampled, before a switch in the same tick
    sampled_onset: float


def advance_plant(plant: Plant, device: Device, tick: int, dt: float) -> Device:
    """Return the device one tick later, with its readings of ``tick`` in transit."""
    state, sea, in_transit, plant_input, settings = (
        device.state,
        device.sea,
        device.in_transit,
        device.plant_input,
        device.settings,
    )
    prefetch_ahead(plant.tables, plant.normals, sea.table_index, tick)
    after = wave_maker.step(plant.tables, sea, dt)
    now, then = Excitation(sea.heave, sea.surge), Excitation(after.heave, after.surge)
    state = plant_step(
        plant.constants, without_hoist(state), plant_input, device.new_input, now, then, dt
    )
    readings = sample(plant.constants, state, tick, after.elevation, plant.normals)
    line = in_transit[1:] + (readings,)  # noqa: RUF005 - what numba compiles
    return Device(state, after, line, plant_input, 0, settings, after.tick, after.onset_factor)


def actuate(plant: Plant, device: Device, command: Command, dt: float) -> tuple[Device, bool]:
    """Return the device with a command, and whether it has other settings of the custom drive.

    The caller must apply these before the next tick.
    """
    sea, settings = device.sea, command.drive.settings
    plant_input = actuation(command)
    if plant_input.wave_trigger != device.plant_input.wave_trigger:
        sea = wave_maker.switch(plant.tables, plant_input.wave_trigger, dt)
    changed = settings != device.settings and settings.bus_voltage > 0.0
    if not changed:
        settings = device.settings
    after = Device(
        device.state,
        sea,
        device.in_transit,
        plant_input,
        1,
        settings,
        device.sampled_tick,
        device.sampled_onset,
    )
    return after, changed


def without_hoist(state: WaveBotState) -> WaveBotState:
    """Return the same state with a constant hoist; the compiler then removes the hoist's code."""
    return WaveBotState(
        state.body,
        state.electrics,
        state.stator,
        state.surge,
        state.passive_force,
        NO_HOIST,
        state.probes,
        state.forces,
    )


def sense(readings: Readings, age: float) -> Sense:
    """Return the loop's input for readings of the plant; ``age`` is their age, s."""
    return Sense(
        AxisSense(
            readings.heave_counts,
            age,
            readings.heave_current,
            readings.heave_enabled,
            readings.heave_fault,
            age,
        ),
        AxisSense(
            readings.surge_counts,
            age,
            readings.surge_current,
            readings.surge_enabled,
            readings.surge_fault,
            age,
        ),
        LoadSense(
            readings.force_lcb,
            readings.force_trs,
            readings.force_slew,
            readings.force_stator_a,
            readings.force_stator_b,
            readings.string_pot,
            readings.rotor_angle,
            age,
        ),
        SpringSense(readings.stator_position, readings.stator_arrived, age),
        PowerSense(
            readings.power_ac, readings.power_dc, readings.bus_voltage, readings.analyser_age
        ),
        DriveSense(readings.drive_conducting, readings.drive_saturated, readings.drive_dump),
        ProbeSense(readings.probe_1, readings.probe_2, readings.probe_3, readings.probe_age),
        WaveSense(readings.elevation),
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
