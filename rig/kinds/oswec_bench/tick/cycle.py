"""The bench as a kind of rig: servo drive in either loop, driveline, load cell, brake."""

from controllers import brake_damping, oswec_position, torque_tracking
from controllers.blocks import clamp
from controllers.oswec_position import EnvelopeTimes, PeriodicReference
from controllers.signals import Demand, Estimate, Turning
from rig.kinds.oswec_bench.tick import manual, speed, stations, tare
from rig.kinds.oswec_bench.tick.check import check, motor_sense
from rig.kinds.oswec_bench.tick.reasons import REASONS
from rig.kinds.oswec_bench.tick.signals import (
    TORQUE,
    VELOCITY,
    BenchRow,
    Command,
    LoopDemand,
    Motion,
    Reference,
    Rotation,
    Sense,
    TickSignals,
)
from rig.kinds.oswec_bench.tick.state import (
    LAWS_AT_REST,
    BrakeState,
    Laws,
    Params,
    ShaftState,
    State,
    encoder_angles,
    start,
    zeros_in_use,
)
from rig.realtime import axis, cycle, limits, motor_power, safety
from rig.realtime.safety import RUN, STOP_1
from rig.realtime.sequence import MANUAL, TARE, WAIT_ARRIVAL, WAIT_DRIVE

_ZERO_REFERENCE = Reference(0.0, 0.0, 0.0)
_NO_CORRECTION = Turning(0.0, 0.0)
_ZERO_DEMAND = LoopDemand(0.0, 0.0)


def observe(params: Params, state: State, sense: Sense, periods: int, dt: float) -> Motion:
    """Return the motion of motor and shaft relative to the zeros in use."""
    encoders, age = sense.encoders, sense.encoders.age
    motor_zero, shaft_zero = zeros_in_use(params, state, encoders)
    motor = axis.observe(params.motor, state.motor, motor_sense(sense), motor_zero, periods, dt)
    measured = encoders.shaft_counts * params.shaft.radians_per_count - shaft_zero
    if state.tare.seeded == 0:
        return motor, Estimate(measured, 0.0, 0.0)
    shaft_state = state.shaft
    shaft = axis.track(
        params.shaft.estimator,
        shaft_state.motion,
        measured,
        shaft_state.age,
        age,
        state.motor.min_age,  # one frame carries both encoders
        axis.recent_sample_gap(state.motor, age, dt),
        periods,
        dt,
    )
    return motor, shaft


def ready(params: Params, state: State, sense: Sense) -> int:
    """Return which wait conditions of the plan are met; the bench has no stator to wait for."""
    return WAIT_ARRIVAL | WAIT_DRIVE if sense.servo.enabled == 1 else WAIT_ARRIVAL


def control(
    params: Params,
    state: State,
    sense: Sense,
    motion: Motion,
    plan: cycle.PlanRecord,
    guard: safety.State,
    setpoint: int,
    dt: float,
) -> tuple[State, Command, TickSignals]:
    """Return new state, command and logged signals of a tick.

    The set point becomes a velocity or a torque within limits, and a current of the brake.
    """
    brake, tare_state, table = state.brake, state.tare, params.setpoints
    motor_motion, shaft_motion = motion
    encoders, servo, load, brake_sense, _ = sense
    phase, clock = plan.phase, plan.wave_clock
    mode = guard.mode
    torque = load.tz - tare_state.zeros.torque
    if mode == RUN:
        laws, reference, correction, demand = _step_laws(
            params, state, setpoint, motion, torque, phase, clock, dt
        )
    else:  # the laws are reset while they do not act
        laws, correction = LAWS_AT_REST, _NO_CORRECTION
        reference, demand = _ZERO_REFERENCE, _ZERO_DEMAND
    # As a mismatch of currents, with the velocity that was commanded last.
    mismatch, deviation = 0, motor_motion.velocity - state.speed.velocity
    if servo.enabled == 1 and RUN <= mode <= STOP_1:
        max_difference = params.limits.velocity_difference_stop
        mismatch = limits.count_mismatch(state.mismatch, deviation, max_difference)
    motor, speed_state, drive = _command_drive(params, state, sense, motor_motion, demand, mode, dt)
    damps_only = (
        mode == RUN
        and table.pto_damping[setpoint] > 0.0
        and table.length[setpoint] == 0
        and not manual.excites(laws.manual)
    )
    power = stations.step(
        state.power,
        cell_torque=torque,
        shaft_velocity=shaft_motion.velocity,
        motor_torque=params.motor.limits.newtons_per_ampere * servo.current,
        motor_velocity=motor_motion.velocity,
        phase=phase,
    )
    fed = power.load_cell if damps_only else 0.0
    checked = motor_power.step(
        params.motor_power, state.motor_power, fed, power.motor, power.load_cell, mode
    )
    brake_command = brake_damping.start()
    if RUN <= mode <= STOP_1:  # the brake acts during a controlled stop, too
        brake_command = brake_damping.step(
            params.brake,
            brake.command,
            table.damping[setpoint],
            table.brake_current[setpoint],
            shaft_motion.velocity,
            dt,
        )
    if phase == TARE or tare_state.samples > 0 or tare_state.seeded == 0:
        previous_tare = tare_state
        tare_state = tare.step(tare_state, *encoder_angles(params, encoders), load.tz, phase)
        if previous_tare.seeded == 1:
            motor = axis.rezero(motor, tare_state.zeros.motor - previous_tare.zeros.motor)
            x, v, a = shaft_motion
            zero_change = tare_state.zeros.shaft - previous_tare.zeros.shaft
            shaft_motion = Estimate(x - zero_change, v, a)
    new_state = State(
        motor,
        ShaftState(shaft_motion, encoders.age),
        speed_state,
        laws,
        BrakeState(brake_command, _brake_mismatch_ticks(params, brake, brake_sense.current)),
        mismatch,
        power,
        checked,
        tare_state,
    )
    locked = 1 if params.locked == 1 or table.flap_held[setpoint] == 1 else 0
    sea = table.sea[setpoint] if clock >= 0.0 else -1
    command = Command(
        *drive,
        brake_command.torque,
        brake_command.current,
        locked,
        sea,
        table.hold_angle[setpoint],
    )
    return new_state, command, (motion, tare_state.zeros, reference, correction, demand, power)


def _step_laws(
    params: Params,
    state: State,
    setpoint: int,
    motion: Motion,
    torque: float,
    phase: int,
    clock: float,
    dt: float,
) -> tuple[Laws, Reference, Turning, LoopDemand]:
    """Return the laws' state, the shaft's reference, the correction and the demand on the drive.

    In manual mode people give the reference, without clock and correction. Damping by the motor
    uses the shaft's velocity as the brake's law filters it. The motor's own velocity would close a
    loop over the resonance of the coupling.
    """
    laws, table = state.laws, params.setpoints
    pto_damping, manual_state = table.pto_damping[setpoint], laws.manual
    chosen = manual.NO_DEMAND
    if phase == MANUAL:
        manual_state, chosen = manual.step(
            params.manual,
            manual_state,
            manual.set_point(table.manual, setpoint),
            pto_damping,
            motion[0].position,
            dt,
        )
        pto_damping = chosen.damping
    span = EnvelopeTimes(table.rise[setpoint], table.fade_start[setpoint])
    periodic = PeriodicReference(table.first[setpoint], table.length[setpoint], span)
    if params.mode == TORQUE:
        torque_reference = chosen.torque
        if phase != MANUAL:
            torque_reference = oswec_position.reference(table.components, periodic, clock).angle
        if pto_damping > 0.0:
            torque_reference += brake_damping.motor_damping_torque(
                pto_damping, state.brake.command.velocity
            )
        tracking, tracking_output = torque_tracking.step(
            params.torque, laws.torque, torque_reference, torque, state.motor.saturation_deficit, dt
        )
        reference = Reference(0.0, 0.0, torque_reference)
        demand = LoopDemand(tracking_output.torque, 0.0)
        return Laws(laws.position, tracking, manual_state), reference, _NO_CORRECTION, demand
    if phase == MANUAL:
        reference = Reference(chosen.angle, chosen.velocity, 0.0)
        demand = LoopDemand(0.0, chosen.velocity)
        return Laws(laws.position, laws.torque, manual_state), reference, _NO_CORRECTION, demand
    position, (plain_motion, correction) = oswec_position.step(
        params.position, laws.position, table.components, periodic, clock, torque, dt
    )
    angle, velocity = plain_motion
    if clock < 0.0:  # between rows: homing, so that drift does not accumulate
        rate, max_velocity = params.homing
        demand = LoopDemand(0.0, clamp(-rate * motion[1].position, -max_velocity, max_velocity))
    else:
        angle_error = angle + correction.angle - motion[0].position
        demand = LoopDemand(
            0.0, velocity + correction.velocity + params.position_feedback * angle_error
        )
    return (
        Laws(position, laws.torque, manual_state),
        Reference(angle, velocity, 0.0),
        correction,
        demand,
    )


DriveFields = tuple[int, float, float, float, float, int, int]
"""The first fields of a `Command`, up to the reason why the demand was limited."""


def _command_drive(
    params: Params,
    state: State,
    sense: Sense,
    motion: Estimate,
    demand: LoopDemand,
    mode: int,
    dt: float,
) -> tuple[axis.State, speed.State, DriveFields]:
    """Return the drive's part of the command for its present loop.

    A controlled stop is zero velocity in the velocity loop and damping in the torque loop. The
    motor's axis knows one torque constant, the nominal one of the rig file; its output is a
    current.
    """
    in_torque_loop = params.mode == TORQUE
    scale = params.motor.limits.newtons_per_ampere
    nominal = scale * torque_tracking.current(params.torque, demand.torque)
    motor, record = axis.control(
        params.motor,
        state.motor,
        motor_sense(sense),
        motion,
        Demand(0.0, 0.0, 0.0, nominal),
        1 if in_torque_loop else 0,
        0,
        mode,
        dt,
    )
    if in_torque_loop:
        _, current, enable, limited = record.command
        torque = torque_tracking.torque(params.torque, current)
        return motor, state.speed, (TORQUE, 0.0, 0.0, torque, current, enable, limited)
    speed_state, (velocity, volts, enable, limited) = speed.limit_command(
        params.speed, state.speed, demand.velocity, mode, dt
    )
    return motor, speed_state, (VELOCITY, velocity, volts, 0.0, 0.0, enable, limited)


def _brake_mismatch_ticks(params: Params, brake: BrakeState, measured: float) -> int:
    """Return for how many consecutive ticks the brake has lacked its commanded current."""
    max_difference = params.limits.brake_difference_stop
    return (
        0
        if -max_difference <= measured - brake.command.current <= max_difference
        else brake.mismatch_ticks + 1
    )


def row(
    tick: int,
    time: float,
    timing: cycle.Timing,
    plan: cycle.PlanRecord,
    guard: safety.State,
    sense: Sense,
    command: Command,
    signals: TickSignals,
) -> BenchRow:
    """Return the log row of the tick."""
    (motor, shaft), zeros, reference, correction, demand, power = signals
    return BenchRow(
        tick,
        time,
        timing,
        plan,
        guard,
        sense.encoders,
        sense.servo,
        sense.load,
        sense.brake,
        sense.panel,
        Rotation(*motor),
        Rotation(*shaft),
        zeros,
        reference,
        correction,
        demand,
        command,
        power,
        tick,
    )


KIND = cycle.Kind(
    BenchRow,
    Params,
    start,
    observe,
    ready,
    check,
    control,
    row,
    reasons=REASONS,
    sense_type=Sense,
)


def find_kind(law: str) -> cycle.Kind:
    """Return the bench; it has no law to choose, so the request ``law`` is empty."""
    return KIND
