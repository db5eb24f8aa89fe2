"""The tick of a modular rig as a template: the source of an ordinary kind, written for its parts.

A line with the word AXIS, SENSOR or TARED, together with the lines of its suite or its brackets, is
repeated for each axis, each sensor, or each sensor that is tared. A loop over the parts would cost
time in the tick, and compiled code has no loop over tuples of different types.
"""

TEMPLATE = '''"""The tick of a modular rig, written from its rig file."""

from math import floor
from typing import Annotated, NamedTuple

from controllers import open_loop, signal_generator
from controllers.blocks import finite
from controllers.signals import (
    AxisCommand, AxisSense, Count, Flag, Metre, PanelSense, Radian, Reference, Second, Tick,
)
from rig.kinds.modular.tick.signals import RotaryRecord, SensorLimits, WaveSense
from rig.realtime import axis, cycle, safety
from rig.realtime.reasons import NO_REASON, Reason
from rig.realtime.safety import CATEGORY, RUN
from rig.realtime.sequence import TARE, WAIT_DRIVE

NO_REFERENCE = Reference(0.0, 0.0)


class SENSOR_TYPE(NamedTuple):
    value: Annotated[float, "SENSOR_UNIT"]
    age: Second


class Sense(NamedTuple):
    AXIS: AxisSense
    SENSOR: SENSOR_TYPE
    wave: WaveSense
    panel: PanelSense


READINGS = (  # the type of each sensor's value in `Sense`
    SENSOR_TYPE,
)


class Command(NamedTuple):
    AXIS: AxisCommand
    waves: Flag


class Zeros(NamedTuple):
    AXIS: AXIS_UNIT
    TARED: Annotated[float, "TARED_UNIT"]
    samples: Count


class Row(NamedTuple):
    tick: Tick
    time: Second
    timing: cycle.Timing
    plan: cycle.PlanRecord
    safety: safety.State
    AXIS: AXIS_RECORD
    SENSOR: SENSOR_TYPE
    reference: Reference
    power: Power
    tare: Zeros
    wave: WaveSense
    panel: PanelSense
    tick_end: Tick


class Setpoints(NamedTuple):
    AXIS: tuple[tuple[float, ...], ...]
    reference_scale: tuple[float, ...]
    realisation: tuple[int, ...]
    signal: tuple[tuple[float, ...], ...]


class Params(NamedTuple):
    AXIS: axis.Params
    AXIS_law: law_of_AXIS.Params
    AXIS_span_stop: float
    SENSOR: SensorLimits
    reference: open_loop.Params
    reference_axis: int
    panel_age_stop: float
    setpoints: Setpoints


class Sums(NamedTuple):
    AXIS: float
    AXIS_low: float
    AXIS_high: float
    TARED: float


class Tare(NamedTuple):
    zeros: Zeros
    seeded: int
    samples: int
    sums: Sums


class Active(NamedTuple):
    setpoint: int
    AXIS: law_of_AXIS.SetPoint
    reference_scale: float
    realisation: int
    signal: signal_generator.SetPoint


class State(NamedTuple):
    AXIS: axis.State
    AXIS_law: law_of_AXIS.State
    reference: open_loop.State
    generator: signal_generator.State
    tare: Tare
    power: Power
    active: Active


NO_SUMS = Sums(
    0.0,  # AXIS
    0.0,  # AXIS_low
    0.0,  # AXIS_high
    0.0,  # TARED
)


def start(params):
    zeros = Zeros(
        0.0,  # AXIS
        0.0,  # TARED
        0,
    )
    active = Active(
        -1,
        law_of_AXIS.SetPoint(AXIS_ZEROS),
        0.0,
        0,
        signal_generator.NO_SIGNAL,
    )
    return State(
        axis.start(),  # AXIS
        law_of_AXIS.start(params.AXIS_law),
        open_loop.start(),
        signal_generator.start(),
        Tare(zeros, 0, 0, NO_SUMS),
        start_power(),
        active,
    )


def zeros_in_use(params, state, sense):
    """Return the zero of each axis in the frame of its encoder; before the first tick, here."""
    tare = state.tare
    if tare.seeded == 1:
        return (
            tare.zeros.AXIS,
        )
    return (
        sense.AXIS.counts * params.AXIS.metres_per_count,
    )


def observe(params, state, sense, periods, dt):
    zeros = zeros_in_use(params, state, sense)
    return (
        axis.observe(params.AXIS, state.AXIS, sense.AXIS, zeros[AXIS_INDEX], periods, dt),
    )


def ready(params, state, sense):
    if sense.AXIS.enabled == 0:
        return 0
    return WAIT_DRIVE


def check(params, state, sense, motion, mode):
    e_stop, limit_switch, panel_age = sense.panel
    if e_stop != 0:
        return Reason.EMERGENCY_STOP.value
    zeros = zeros_in_use(params, state, sense)
    fault_of_AXIS = axis.check(
        params.AXIS, state.AXIS, sense.AXIS, motion[AXIS_INDEX], zeros[AXIS_INDEX], mode
    )
    if fault_of_AXIS != NO_REASON and CATEGORY[fault_of_AXIS] == 0:
        return reasons_of_AXIS[fault_of_AXIS]
    # One sum instead of many tests: it is finite only if every term is.
    total = panel_age
    total = total + sense.SENSOR.value + sense.SENSOR.age
    if not finite(total):
        return Reason.NOT_FINITE.value
    if fault_of_AXIS != NO_REASON:
        return reasons_of_AXIS[fault_of_AXIS]
    if limit_switch != 0:
        return Reason.LIMIT_SWITCH.value
    if not 0.0 <= panel_age <= params.panel_age_stop:  # below 0: a clock is wrong
        return Reason.STALE_PANEL.value
    if not 0.0 <= sense.SENSOR.age <= params.SENSOR.age_stop:
        return SENSOR_STALE
    if not params.SENSOR.low <= sense.SENSOR.value <= params.SENSOR.high:
        return SENSOR_RANGE
    tare = state.tare
    if tare.samples > 0 and tare.sums.AXIS_high - tare.sums.AXIS_low > params.AXIS_span_stop:
        return Reason.NOT_CALM.value
    return NO_REASON


def load_setpoint(params, setpoint):
    table = params.setpoints
    return Active(
        setpoint,
        law_of_AXIS.SetPoint(AXIS_COLUMNS),
        table.reference_scale[setpoint],
        table.realisation[setpoint],
        signal_generator.SetPoint(
            table.signal[0][setpoint],
            table.signal[1][setpoint],
            table.signal[2][setpoint],
            table.signal[3][setpoint],
            table.signal[4][setpoint],
        ),
    )


def step_tare(params, tare, sense, phase):
    """Add to the sums during the tare; after it, set the zeros to the means."""
    zeros, seeded, samples, sums = tare
    x_of_AXIS = sense.AXIS.counts * params.AXIS.metres_per_count
    if seeded == 0:
        zeros = Zeros(
            x_of_AXIS,
            sense.TARED.value,
            0,
        )
    if phase == TARE:
        sums = Sums(
            sums.AXIS + x_of_AXIS,
            x_of_AXIS if samples == 0 or x_of_AXIS < sums.AXIS_low else sums.AXIS_low,
            x_of_AXIS if samples == 0 or x_of_AXIS > sums.AXIS_high else sums.AXIS_high,
            sums.TARED + sense.TARED.value,
        )
        return Tare(zeros, 1, samples + 1, sums)
    if samples > 0:
        zeros = Zeros(
            sums.AXIS / samples,
            sums.TARED / samples,
            samples,
        )
    return Tare(zeros, 1, 0, NO_SUMS)


def control(params, state, sense, motion, plan, guard, setpoint, dt):
    memory_of_AXIS = state.AXIS_law
    reference_state, active, tare = state.reference, state.active, state.tare
    generator = state.generator
    phase, wave_clock, mode = plan.phase, plan.wave_clock, guard.mode
    if setpoint != active.setpoint:
        active = load_setpoint(params, setpoint)
    reference = NO_REFERENCE
    if mode == RUN:
        force = 0.0
        if len(params.reference.table) > 0:
            wave_tick = floor(wave_clock / dt + 0.5) if wave_clock >= 0.0 else -1
            reference_state, force = open_loop.step(
                params.reference,
                reference_state,
                active.reference_scale,
                active.realisation,
                wave_tick,
                dt,
            )
            reference = Reference(reference_state.scale.value, force)
        if not signal_generator.at_rest(generator, active.signal):
            generator, generated = signal_generator.step(
                signal_generator.Params(params.reference.ramp), generator, active.signal, dt
            )
            force = force + generated
            reference = Reference(reference.scale, force)
        memory_of_AXIS, demand_of_AXIS = law_of_AXIS.step(
            params.AXIS_law,
            memory_of_AXIS,
            active.AXIS,
            motion[AXIS_INDEX],
            force if params.reference_axis == AXIS_INDEX else 0.0,
            state.AXIS.saturation_deficit,
            dt,
        )
    else:  # reset the laws, so that a later start ramps its gains up from zero
        memory_of_AXIS, demand_of_AXIS = law_of_AXIS.start(params.AXIS_law), axis.NO_DEMAND
        reference_state, generator = open_loop.start(), signal_generator.start()
    after_of_AXIS, record_of_AXIS = axis.control(
        params.AXIS,
        state.AXIS,
        sense.AXIS,
        motion[AXIS_INDEX],
        demand_of_AXIS,
        1,
        0,
        mode,
        dt,
    )
    if phase == TARE or tare.samples > 0 or tare.seeded == 0:
        tare = step_tare(params, tare, sense, phase)
        if state.tare.seeded == 1:
            shift_of_AXIS = tare.zeros.AXIS - state.tare.zeros.AXIS
            after_of_AXIS = axis.rezero(after_of_AXIS, shift_of_AXIS)
    power = step_power(
        state.power,
        STATION_SIGNALS
        phase,
    )
    new_state = State(
        after_of_AXIS,
        memory_of_AXIS,
        reference_state,
        generator,
        tare,
        power,
        active,
    )
    command = Command(
        record_of_AXIS.command,
        1 if wave_clock >= 0.0 else 0,
    )
    records = (
        record_of_AXIS,
    )
    return new_state, command, (records, reference, power, tare.zeros)


def row(tick, time, timing, plan, guard, sense, command, signals):
    records, reference, power, zeros = signals
    return Row(
        tick,
        time,
        timing,
        plan,
        guard,
        records[AXIS_INDEX],
        sense.SENSOR,
        reference,
        power,
        zeros,
        sense.wave,
        sense.panel,
        tick,
    )


def assessed(row):
    power = row.power
    return (STATION_POWERS), row.FIRST_NAME.estimate.velocity
'''
