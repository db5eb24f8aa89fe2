"""What trips a WaveBot: every check of a tick, those that allow no controlled stop first."""

from controllers.blocks import finite
from rig.kinds.wavebot.signals import Motion, Sense
from rig.kinds.wavebot.state import SURGE_OFF, Params, State, zeros
from rig.realtime import axis
from rig.realtime.safety import CATEGORY, NO_REASON, OFF, Reason

# An axis says what is wrong with it; whose fault it is, is said here. By number, so that compiled
# code can look it up, too.
_HEAVE_FAULT = (
    Reason.DRIVE_FAULT.value,  # NONE, never asked for
    Reason.DRIVE_FAULT.value,
    Reason.BUS_UNDERVOLTAGE.value,
    Reason.BUS_OVERVOLTAGE.value,
)
_OF_SURGE = {
    Reason.STALE_ENCODER: Reason.SURGE_STALE_ENCODER,
    Reason.STALE_DRIVE: Reason.SURGE_STALE_DRIVE,
    Reason.DRIVE_FAULT: Reason.SURGE_DRIVE_FAULT,
    Reason.DRIVE_DROPPED: Reason.SURGE_DRIVE_DROPPED,
    Reason.POSITION: Reason.SURGE_POSITION,
    Reason.VELOCITY: Reason.SURGE_VELOCITY,
    Reason.ENCODER_JUMP: Reason.SURGE_ENCODER_JUMP,
    Reason.CURRENT_DISAGREES: Reason.SURGE_CURRENT_DISAGREES,
}
_SURGE = tuple(_OF_SURGE.get(reason, reason).value for reason in Reason)


def _heave_drive(fault: int) -> int:
    """The reason to stop for a fault of the heave drive; one that is not known is a fault."""
    if 0 <= fault < len(_HEAVE_FAULT):
        return _HEAVE_FAULT[fault]
    return Reason.DRIVE_FAULT.value


def check(params: Params, state: State, sense: Sense, motion: Motion, mode: int) -> int:
    """The first reason to trip, those that allow no controlled stop before others, or NONE."""
    heave, surge, load, spring, meter, _, probes, _, panel = sense
    in_heave, in_surge = motion
    e_stop, limit_switch, panel_age = panel
    if e_stop != 0:
        return Reason.EMERGENCY_STOP.value
    heave_zero, surge_zero = zeros(params, state, heave, surge)
    heave_fault = axis.check(params.heave, state.heave, heave, in_heave, heave_zero, mode)
    surge_mode = OFF if params.surge_use == SURGE_OFF else mode
    surge_fault = axis.check(params.surge, state.surge, surge, in_surge, surge_zero, surge_mode)
    if heave_fault != NO_REASON and CATEGORY[heave_fault] == 0:
        if heave_fault == Reason.DRIVE_FAULT.value:
            return _heave_drive(heave.fault)
        return heave_fault
    if surge_fault != NO_REASON and CATEGORY[surge_fault] == 0:
        return _SURGE[surge_fault]
    lcb, trs, slew, stator_a, stator_b, string_pot, rotor_angle, load_age = load
    stator, _, stator_age = spring
    ac, dc, bus_voltage, meter_age = meter
    one, two, three, probe_age = probes
    # One sum instead of many tests: it is finite only if every term is.
    if not finite(
        lcb + trs + slew + stator_a + stator_b + string_pot + rotor_angle + load_age + stator
        + stator_age + ac + dc + bus_voltage + meter_age + one + two + three + probe_age + panel_age
    ):  # fmt: skip
        return Reason.NOT_FINITE.value
    (
        apart, most_travel, metres_per_radian, most_voltage,
        most_stator_age, most_load_age, most_meter_age, most_panel_age, most_span,
    ) = params.limits  # fmt: skip
    if bus_voltage > most_voltage:
        return Reason.BUS_OVERVOLTAGE.value
    tared = state.tare
    position = in_heave.position
    stale = not 0.0 <= load_age <= most_load_age  # below 0: a clock is wrong
    gap = string_pot - tared.zeros.string_pot - position if tared.seeded == 1 else 0.0
    # The string pot comes over a slow bus: since its value the body may have moved on.
    apart = apart + params.heave.limits.velocity_stop * load_age
    if not (-apart <= gap <= apart or stale):
        return Reason.POSITION_DISAGREES.value
    powers = state.stations.reason
    if powers != NO_REASON and CATEGORY[powers] == 0:
        return powers
    if heave_fault != NO_REASON:  # damping trusts the encoder, so the string pot is asked first
        return heave_fault
    if surge_fault != NO_REASON:
        return _SURGE[surge_fault]
    if limit_switch != 0:
        return Reason.LIMIT_SWITCH.value
    if not 0.0 <= panel_age <= most_panel_age:
        return Reason.STALE_PANEL.value
    if stale:
        return Reason.STALE_LOAD_CELL.value
    if not 0.0 <= meter_age <= most_meter_age:
        return Reason.STALE_ANALYSER.value
    if not 0.0 <= stator_age <= most_stator_age:
        return Reason.STALE_STATOR.value
    if not -most_travel <= rotor_angle * metres_per_radian <= most_travel:
        return Reason.ROTOR_TRAVEL.value
    stroke = state.active_setpoint.stroke
    if not -stroke <= position <= stroke:
        return Reason.SPRING_STROKE.value
    if tared.samples > 0 and tared.highest - tared.lowest > most_span:
        return Reason.NOT_CALM.value
    return powers
