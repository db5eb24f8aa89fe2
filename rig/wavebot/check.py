"""What trips a WaveBot: every check of a tick, those that allow no controlled stop first."""

from controllers.blocks import finite
from controllers.signals import DriveFault
from rig import axis
from rig.safety import CATEGORY, FINE, OFF, Reason
from rig.wavebot.state import SURGE_OFF, Params, State
from rig.wavebot.words import Motion, Sense

# An axis says what is wrong with it; whose fault it is, is said here.
_HEAVE = {
    DriveFault.UNDERVOLTAGE.value: Reason.BUS_UNDERVOLTAGE.value,
    DriveFault.OVERVOLTAGE.value: Reason.BUS_OVERVOLTAGE.value,
}
_SURGE = {
    Reason.STALE_ENCODER.value: Reason.SURGE_STALE_ENCODER.value,
    Reason.STALE_DRIVE.value: Reason.SURGE_STALE_DRIVE.value,
    Reason.DRIVE_FAULT.value: Reason.SURGE_DRIVE_FAULT.value,
    Reason.DRIVE_DROPPED.value: Reason.SURGE_DRIVE_DROPPED.value,
    Reason.POSITION.value: Reason.SURGE_POSITION.value,
    Reason.VELOCITY.value: Reason.SURGE_VELOCITY.value,
    Reason.ENCODER_JUMP.value: Reason.SURGE_ENCODER_JUMP.value,
}


def heave_zero(params: Params, state: State, sense: Sense) -> float:
    """The zero of heave in use (m in the encoder's frame), at first where the body is found."""
    if state.tare.seeded == 0:
        return sense.heave.counts * params.heave.metres_per_count
    return state.tare.zeros.position


def surge_zero(params: Params, state: State, sense: Sense) -> float:
    """The zero of surge in use (m in the encoder's frame), at first where the body is found."""
    if state.tare.seeded == 0:
        return sense.surge.counts * params.surge.metres_per_count
    return state.tare.zeros.surge


def check(params: Params, state: State, sense: Sense, motion: Motion, mode: int) -> int:
    """The first reason to trip, those that allow no controlled stop before others, or NONE."""
    heave, surge, load, spring, meter, _, probes, _ = sense
    heave_fault = axis.check(
        params.heave, state.heave, heave, motion.heave, heave_zero(params, state, sense), mode
    )
    if heave_fault != FINE and CATEGORY[heave_fault] == 0:
        if heave_fault == Reason.DRIVE_FAULT.value:
            return _HEAVE.get(heave.fault, heave_fault)
        return heave_fault
    surge_mode = mode if params.surge_use != SURGE_OFF else OFF
    surge_fault = axis.check(
        params.surge, state.surge, surge, motion.surge, surge_zero(params, state, sense), surge_mode
    )
    if surge_fault != FINE and CATEGORY[surge_fault] == 0:
        return _SURGE.get(surge_fault, surge_fault)
    lcb, trs, slew, stator_a, stator_b, string_pot, rotor_angle, load_age = load
    stator, _, stator_age = spring
    ac, dc, bus_voltage, meter_age = meter
    # One sum instead of many tests: it is finite only if every term is.
    total = lcb + trs + slew + stator_a + stator_b + string_pot + rotor_angle + load_age
    total = total + stator + stator_age + ac + dc + bus_voltage + meter_age
    if not finite(total + probes.probe_1 + probes.probe_2 + probes.probe_3 + probes.age):
        return Reason.NOT_FINITE.value
    bounds, tared = params.limits, state.tare
    if bus_voltage > bounds.bus_voltage_stop:
        return Reason.BUS_OVERVOLTAGE.value
    stale = load_age > bounds.load_cell_age_stop
    zero = tared.zeros.string_pot if tared.seeded == 1 else string_pot
    position = motion.heave.position
    gap, most = string_pot - zero - position, bounds.string_pot_difference_stop
    if not (-most <= gap <= most or stale):
        return Reason.POSITION_DISAGREES.value
    if heave_fault != FINE:  # damping trusts the encoder, so the string pot is asked first
        return heave_fault
    if surge_fault != FINE:
        return _SURGE[surge_fault]
    if stale:
        return Reason.STALE_LOAD_CELL.value
    if meter_age > bounds.analyser_age_stop:
        return Reason.STALE_ANALYSER.value
    if stator_age > bounds.stator_age_stop:
        return Reason.STALE_STATOR.value
    travel, most = rotor_angle * bounds.metres_per_radian, bounds.rotor_travel_stop
    if not -most <= travel <= most:
        return Reason.ROTOR_TRAVEL.value
    stroke = state.held.stroke
    if state.held.setpoint >= 0 and not -stroke <= position <= stroke:
        return Reason.SPRING_STROKE.value
    if tared.highest - tared.lowest > bounds.tare_span_stop:
        return Reason.NOT_CALM.value
    return FINE
