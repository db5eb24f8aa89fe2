"""Between the heave command and the bus: a drive of either kind and the analyser. Pure."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant import bus, cots_drive, custom_drive, drive
from sim_plant.analyser import AnalyserState, analyser_step
from sim_plant.bus import BusParams, BusState
from sim_plant.cots_drive import CotsParams
from sim_plant.custom_drive import InverterParams
from sim_plant.drive import DriveParams, DriveState
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
    """Constants of both kinds of drive; the words of the kind that is not fitted are unused."""

    loop: DriveParams
    custom: Flag  # 1: custom drive with its own bus, 0: commercial drive
    cots: CotsParams
    inverter: InverterParams
    bus: BusParams
    analyser_window: Second


class ElectricsState(NamedTuple):
    """What drive, bus and analyser remember."""

    drive: DriveState
    gate: Flag  # 1: the power stage may switch
    bus: BusState
    analyser: AnalyserState


def initial(params: ElectricsParams) -> ElectricsState:
    """Give the state with the drive off, the custom drive's bus charged to its set point."""
    standing = params.cots.fixed_loss
    if params.custom == 1:
        standing = params.inverter.fixed_loss
    return ElectricsState(
        drive.at_rest(),
        1,
        bus.charged(params.bus),
        AnalyserState(0.0, 0.0, 0, 0.0, standing, 0.0),
    )


def command(
    params: ElectricsParams,
    state: ElectricsState,
    current: Ampere,
    enable: int,
    conducting: int,
    fresh: int,
    velocity: MetrePerSecond,
    dt: Second,
) -> DriveState:
    """Advance the drive by one step; the motor's current is its mean over the step."""
    if params.custom == 0:
        ceiling = drive.NO_CEILING
        return drive.drive_step(params.loop, state.drive, current, enable, fresh, 1, 0, ceiling, dt)
    ceiling = custom_drive.ceiling(params.inverter, state.bus.voltage, velocity)
    trip = bus.trip(params.bus, state.bus)
    return drive.drive_step(
        params.loop, state.drive, current, enable, fresh, conducting, trip, ceiling, dt
    )


def power(
    params: ElectricsParams,
    state: ElectricsState,
    driven: DriveState,
    conducting: int,
    power_ac: Watt,
    dt: Second,
) -> ElectricsState:
    """Give the state after a step of AC power between motor and drive: DC power, bus, analyser.

    DC power is AC power plus the drive's loss; W, absorbed negative. Supply and dump resistors lie
    beyond the drive's bus terminals and do not enter it.
    """
    held = state.bus
    gate = 1
    if params.custom == 0:
        power_dc = power_ac + cots_drive.loss(params.cots, driven.mean_current)
    else:
        gate = conducting
        on = gate if driven.enabled == 1 else 0
        power_dc = power_ac
        if held.voltage >= params.bus.brownout:
            loss = custom_drive.loss(params.inverter, held.voltage, driven.mean_current, on)
            power_dc = power_ac + loss
        held = bus.bus_step(params.bus, held, power_dc, dt)
    analyser = analyser_step(params.analyser_window, state.analyser, power_ac, power_dc, dt)
    return ElectricsState(driven, gate, held, analyser)


def bus_voltage(params: ElectricsParams, state: ElectricsState) -> Volt:
    """Give the voltage at the drive's bus terminals."""
    if params.custom == 1:
        return state.bus.voltage
    return cots_drive.bus_voltage(params.cots, state.analyser.power_dc)


def dump_mask(params: ElectricsParams, state: ElectricsState) -> Code:
    """Give which dump resistors conduct now; none with the commercial drive."""
    return params.bus.dump_mask if state.bus.dumping == 1 else 0


def conducts(state: ElectricsState) -> Flag:
    """Give 1 while the power stage switches."""
    return state.gate if state.drive.enabled == 1 else 0
