"""All safety checks of a WaveBot in a tick, those that allow no controlled stop first."""

from controllers.blocks import finite
from rig.kinds.wavebot.tick.reasons import WaveBotReason
from rig.kinds.wavebot.tick.signals import Motion, Sense
from rig.kinds.wavebot.tick.state import SURGE_OFF, Params, State, zeros_in_use
from rig.realtime import axis
from rig.realtime.reasons import AXIS_FAULTS, NO_REASON, Reason, numbers_of_axis
from rig.realtime.safety import CATEGORY, OFF

# `axis.check` returns a reason without the axis's name; these tables map it to the reason of heave
# or surge. They are indexed by number, so that compiled code can use them, too.
_HEAVE_FAULT = (
    Reason.DRIVE_FAULT.value,  # of NONE, never used
    Reason.DRIVE_FAULT.value,
    WaveBotReason.BUS_UNDERVOLTAGE.value,
    WaveBotReason.BUS_OVERVOLTAGE.value,
)
_SURGE_REASON_BY_NUMBER = numbers_of_axis(
    {fault: WaveBotReason[f"SURGE_{fault.name}"] for fault in AXIS_FAULTS}
)


def _heave_drive_reason(fault: int) -> int:
    """Return the reason to stop for a fault of the heave drive; DRIVE_FAULT for an unknown one."""
    if 0 <= fault < len(_HEAVE_FAULT):
        return _HEAVE_FAULT[fault]
    return Reason.DRIVE_FAULT.value


def check(params: Params, state: State, sense: Sense, motion: Motion, mode: int) -> int:
    """Return the first reason to trip or NONE; reasons without a controlled stop come first."""
    heave, surge, load = sense.heave, sense.surge, sense.load
    heave_motion, surge_motion = motion
    e_stop, limit_switch, panel_age = sense.panel
    if e_stop != 0:
        return Reason.EMERGENCY_STOP.value
    heave_zero, surge_zero = zeros_in_use(params, state, heave, surge)
    heave_fault = axis.check(params.heave, state.heave, heave, heave_motion, heave_zero, mode)
    surge_mode = OFF if params.surge_use == SURGE_OFF else mode
    surge_fault = axis.check(params.surge, state.surge, surge, surge_motion, surge_zero, surge_mode)
    if heave_fault != NO_REASON and CATEGORY[heave_fault] == 0:
        if heave_fault == Reason.DRIVE_FAULT.value:
            return _heave_drive_reason(heave.fault)
        return heave_fault
    if surge_fault != NO_REASON and CATEGORY[surge_fault] == 0:
        return _SURGE_REASON_BY_NUMBER[surge_fault]
    load_age = load.age
    stator, _, stator_age = sense.spring
    ac, dc, bus_voltage, analyser_age = sense.power
    probe_1, probe_2, probe_3, probe_age = sense.probes
    # One sum instead of many tests: it is finite only if every term is.
    if not finite(
        load.lcb + load.trs + load.slew + load.stator_a + load.stator_b + load.string_pot
        + load.rotor_angle + load_age + stator + stator_age + ac + dc + bus_voltage + analyser_age
        + probe_1 + probe_2 + probe_3 + probe_age + panel_age
    ):  # fmt: skip
        return Reason.NOT_FINITE.value
    limits = params.limits
    if bus_voltage > limits.bus_voltage_stop:
        return WaveBotReason.BUS_OVERVOLTAGE.value
    tare_state = state.tare
    position = heave_motion.position
    stale = not 0.0 <= load_age <= limits.load_cell_age_stop  # below 0: a clock is wrong
    gap = (
        load.string_pot - tare_state.zeros.string_pot - position if tare_state.seeded == 1 else 0.0
    )
    # The string pot comes over a slow bus: the body may have moved since its value was read.
    max_gap = limits.string_pot_difference_stop + params.heave.limits.velocity_stop * load_age
    if not (-max_gap <= gap <= max_gap or stale):
        return WaveBotReason.POSITION_DISAGREES.value
    power_reason = state.power_checks.reason
    if power_reason != NO_REASON and CATEGORY[power_reason] == 0:
        return power_reason
    if heave_fault != NO_REASON:  # after the string pot's check: damping relies on the encoder
        return heave_fault
    if surge_fault != NO_REASON:
        return _SURGE_REASON_BY_NUMBER[surge_fault]
    if limit_switch != 0:
        return Reason.LIMIT_SWITCH.value
    if not 0.0 <= panel_age <= limits.panel_age_stop:
        return Reason.STALE_PANEL.value
    if stale:
        return WaveBotReason.STALE_LOAD_CELL.value
    if not 0.0 <= analyser_age <= limits.analyser_age_stop:
        return WaveBotReason.STALE_ANALYSER.value
    if not 0.0 <= stator_age <= limits.stator_age_stop:
        return WaveBotReason.STALE_STATOR.value
    max_travel = limits.rotor_travel_stop
    if not -max_travel <= load.rotor_angle * limits.metres_per_radian <= max_travel:
        return WaveBotReason.ROTOR_TRAVEL.value
    stroke = state.active_setpoint.stroke
    if not -stroke <= position <= stroke:
        return WaveBotReason.SPRING_STROKE.value
    if tare_state.samples > 0 and tare_state.highest - tare_state.lowest > limits.tare_span_stop:
        return Reason.NOT_CALM.value
    return power_reason
