"""Electrical chain of heave: a drive of either kind, its bus and the power analyser. Pure."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant import cots_drive, custom_drive
from sim_plant.analyser import AnalyserState, analyser_step
from sim_plant.cots_drive import CotsParams
from sim_plant.custom_drive import InverterParams
from sim_plant.parts import bus, drive
from sim_plant.parts.bus import BusParams, BusState
from sim_plant.parts.drive import DriveParams, DriveState
from sim_plant.units import (
    Ampere,
    Code,
    Flag,
    MetrePerSecond,
    Second,
    Volt,
    Watt,
)


class ElectricsParams(NamedTuple):
    """Parameters of both kinds of drive; those of the kind that is not fitted are unused."""

    drive: DriveParams
    custom: Flag  # 1: custom drive with its own bus, 0: commercial drive
    cots: CotsParams
    inverter: InverterParams
    bus: BusParams
    analyser_window: Second


class ElectricsState(NamedTuple):
    """State of drive, bus and analyser."""

    drive: DriveState
    gate: Flag  # 1: the power stage may switch
    bus: BusState
    analyser: AnalyserState


def initial(params: ElectricsParams) -> ElectricsState:
    """Return the state with the drive off and the custom drive's bus charged to its set point."""
    idle_power = params.cots.fixed_loss
    if params.custom == 1:
        idle_power = params.inverter.fixed_loss
    return ElectricsState(
        drive.initial(),
        1,
        bus.initial(params.bus),
        AnalyserState(0.0, 0.0, 0, 0.0, idle_power, 0.0),
    )


def command_step(
    params: ElectricsParams,
    state: ElectricsState,
    current: Ampere,
    enable: int,
    conducting: int,
    fresh: int,
    velocity: MetrePerSecond,
    dt: Second,
) -> DriveState:
    """Advance the drive by one step; the current of the motor is the mean over the step."""
    if params.custom == 0:
        max_current = drive.UNLIMITED_CURRENT
        return drive.drive_step(
            params.drive, state.drive, current, enable, fresh, 1, 0, max_current, dt
        )
    max_current = custom_drive.max_current(params.inverter, state.bus.voltage, velocity)
    trip = bus.voltage_trip(params.bus, state.bus)
    return drive.drive_step(
        params.drive, state.drive, current, enable, fresh, conducting, trip, max_current, dt
    )


def power_step(
    params: ElectricsParams,
    state: ElectricsState,
    drive_state: DriveState,
    conducting: int,
    power_ac: Watt,
    dt: Second,
) -> ElectricsState:
    """Return the state after one step of AC power between motor and drive: DC power, bus, analyser.

    DC power is AC power plus the drive's loss; W, absorbed negative. Supply and dump resistors lie
    beyond the drive's bus terminals and are not part of it.
    """
    bus_state = state.bus
    gate = 1
    if params.custom == 0:
        power_dc = power_ac + cots_drive.loss(params.cots, drive_state.mean_current)
    else:
        gate = conducting
        on = gate if drive_state.enabled == 1 else 0
        power_dc = power_ac
        if bus_state.voltage >= params.bus.brownout:
            loss = custom_drive.loss(
                params.inverter, bus_state.voltage, drive_state.mean_current, on
            )
            power_dc = power_ac + loss
        bus_state = bus.bus_step(params.bus, bus_state, power_dc, dt)
    analyser = analyser_step(params.analyser_window, state.analyser, power_ac, power_dc, dt)
    return ElectricsState(drive_state, gate, bus_state, analyser)


def bus_voltage(params: ElectricsParams, state: ElectricsState) -> Volt:
    """Return the voltage at the drive's bus terminals."""
    if params.custom == 1:
        return state.bus.voltage
    return cots_drive.bus_voltage(params.cots, state.analyser.power_dc)


def dump_mask(params: ElectricsParams, state: ElectricsState) -> Code:
    """Return the mask of the dump resistors that conduct now; 0 with the commercial drive."""
    return params.bus.dump_mask if state.bus.dumping == 1 else 0


def is_conducting(state: ElectricsState) -> Flag:
    """Return 1 while the power stage switches, else 0."""
    return state.gate if state.drive.enabled == 1 else 0
