"""The bench as a kind of rig: servo in either of its loops, driveline, load cell, brake."""

from controllers import brake_damping, oswec_position, torque_tracking
from controllers.blocks import clamp
from controllers.signals import Demand, Estimate, Turning
from rig.kinds.oswec_bench import speed, stations, tare
from rig.kinds.oswec_bench.check import check, motor_sense
from rig.kinds.oswec_bench.signals import (
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
from rig.kinds.oswec_bench.state import (
    LAWS_AT_REST,
    ActiveSetpoint,
    BrakeState,
    Laws,
    Params,
    ShaftState,
    State,
    angles,
    hold,
    start,
    zeros,
)
from rig.realtime import axis, cycle, limits, safety
from rig.realtime.safety import RUN, STOP_1
from rig.realtime.sequence import TARE, WAIT_DRIVE, WAIT_STATOR

_NOWHERE = Reference(0.0, 0.0, 0.0)
_STRAIGHT = Turning(0.0, 0.0)
_NOTHING = LoopDemand(0.0, 0.0)


def observe(params: Params, state: State, sense: Sense, periods: int, dt: float) -> Motion:
    """Motion of motor and shaft relative to the zeros in use."""
    encoders, age = sense.encoders, sense.encoders.age
    zero, shaft_zero = zeros(params, state, encoders)
    motor = axis.observe(params.motor, state.motor, motor_sense(sense), zero, periods, dt)
    measured = encoders.shaft_counts * params.shaft.radians_per_count - shaft_zero
    if state.tare.seeded == 0:
        return motor, Estimate(measured, 0.0, 0.0)
    before = state.shaft
    shaft = axis.track(
        params.shaft.estimator,
        before.motion,
        measured,
        before.age,
        age,
        state.motor.min_age,  # both encoders come in one frame
        axis.recent_sample_gap(state.motor, age, dt),
        periods,
        dt,
    )
    return motor, shaft


def ready(params: Params, state: State, sense: Sense) -> int:
    """Which conditions of the plan hold; the bench has no stator to wait for."""
    return WAIT_STATOR | WAIT_DRIVE if sense.servo.enabled == 1 else WAIT_STATOR


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
    """Set point -> velocity or torque within limits, and the brake's current."""
    motor, _, told, laws, brake, mismatch, powers, tared, held = state
    in_motor, in_shaft = motion
    encoders, servo, load, brake_sense, _ = sense
    _, phase, _, clock = plan
    mode = guard.mode
    if setpoint != held.setpoint:
        held = hold(params.setpoints, setpoint)
    torque = load.tz - tared.zeros.torque
    if mode == RUN:
        laws, wanted, turned, asked = _laws(
            params,
            laws,
            held,
            motion,
            brake.told.velocity,
            torque,
            motor.saturation_deficit,
            clock,
            dt,
        )
    else:  # at rest they start afresh
        laws, wanted, turned, asked = LAWS_AT_REST, _NOWHERE, _STRAIGHT, _NOTHING
    mismatch = _mismatch(params, told, mismatch, servo.enabled, in_motor.velocity, mode)
    motor, told, drive = _driven(params, motor, told, sense, in_motor, asked, mode, dt)
    damps = mode == RUN and held.flume.damping > 0.0 and len(held.components) == 0
    powers = stations.step(
        params.stations, powers, servo.current, torque, in_motor.velocity, damps, mode
    )
    braked = _braked(params, brake.told, held, in_shaft.velocity, mode, dt)
    if phase == TARE or tared.samples > 0 or tared.seeded == 0:
        before, tared = tared, tare.step(tared, *angles(params, encoders), load.tz, phase)
        if before.seeded == 1:
            motor = axis.rezero(motor, tared.zeros.motor - before.zeros.motor)
            (x, v, a), by = in_shaft, tared.zeros.shaft - before.zeros.shaft
            in_shaft = Estimate(x - by, v, a)
    after = State(
        motor,
        ShaftState(in_shaft, encoders.age),
        told,
        laws,
        BrakeState(braked, _astray(params, brake, brake_sense.current)),
        mismatch,
        powers,
        tared,
        held,
    )
    command = Command(*drive, braked.torque, braked.current, *_around(params, held, clock))
    return after, command, (motion, tared.zeros, wanted, turned, asked)


def _laws(
    params: Params,
    laws: Laws,
    held: ActiveSetpoint,
    motion: Motion,
    turning: float,
    torque: float,
    short: float,
    clock: float,
    dt: float,
) -> tuple[Laws, Reference, Turning, LoopDemand]:
    """What the shaft should do, the correction, and what is asked of the drive for both.

    ``turning``: the shaft's velocity as the law of the brake filters it, rad/s; the motor's own
    would close a loop over the coupling's resonance.
    """
    _, components, span, _, _, flume = held
    if params.mode == TORQUE:
        plain = oswec_position.reference(components, span, clock).angle
        if flume.damping > 0.0:
            plain += brake_damping.opposing(flume.damping, turning)
        tracking, drawn = torque_tracking.step(params.torque, laws.torque, plain, torque, short, dt)
        wanted, asked = Reference(0.0, 0.0, plain), LoopDemand(drawn.torque, 0.0)
        return Laws(laws.position, tracking), wanted, _STRAIGHT, asked
    position, (plain_turn, correction) = oswec_position.step(
        params.position, laws.position, components, span, clock, torque, dt
    )
    angle, velocity = plain_turn
    if clock < 0.0:  # between rows: home, so that drift does not add up from row to row
        rate, most = params.homing
        asked = LoopDemand(0.0, clamp(-rate * motion[1].position, -most, most))
    else:
        astray = angle + correction.angle - motion[0].position
        asked = LoopDemand(0.0, velocity + correction.velocity + params.feedback * astray)
    return Laws(position, laws.torque), Reference(angle, velocity, 0.0), correction, asked


Drive = tuple[int, float, float, float, float, int, int]
"""The first fields of a `Command`, up to why it was limited."""


def _driven(
    params: Params,
    motor: axis.State,
    told: speed.State,
    sense: Sense,
    motion: Estimate,
    asked: LoopDemand,
    mode: int,
    dt: float,
) -> tuple[axis.State, speed.State, Drive]:
    """What the drive is told in its present loop.

    A controlled stop is zero velocity in the velocity loop, damping in the torque loop. The motor's
    axis knows one torque constant, the rig's own: what it grants is a current.
    """
    in_torque = params.mode == TORQUE
    scale = params.motor.limits.newtons_per_ampere
    nominal = scale * torque_tracking.current(params.torque, asked.torque)
    motor, record = axis.control(
        params.motor,
        motor,
        motor_sense(sense),
        motion,
        Demand(0.0, 0.0, 0.0, nominal),
        1 if in_torque else 0,
        0,
        mode,
        dt,
    )
    if in_torque:
        _, current, enable, limited = record.command
        torque = torque_tracking.torque(params.torque, current)
        return motor, told, (TORQUE, 0.0, 0.0, torque, current, enable, limited)
    told, (velocity, volts, enable, limited) = speed.grant(
        params.speed, told, asked.velocity, mode, dt
    )
    return motor, told, (VELOCITY, velocity, volts, 0.0, 0.0, enable, limited)


def _braked(
    params: Params,
    before: brake_damping.Braked,
    held: ActiveSetpoint,
    velocity: float,
    mode: int,
    dt: float,
) -> brake_damping.Braked:
    """Torque and current of the brake; it takes part in a stop, and is let go with the power."""
    if not RUN <= mode <= STOP_1:
        return brake_damping.start()
    return brake_damping.step(params.brake, before, held.damping, held.brake_current, velocity, dt)


def _around(params: Params, held: ActiveSetpoint, clock: float) -> tuple[int, int, float]:
    """What people and wave maker do: `locked`, `sea` and `clamp` of a command."""
    sea, by_hand, angle, _ = held.flume
    locked = 1 if params.locked == 1 or by_hand == 1 else 0
    return locked, sea if clock >= 0.0 else -1, angle


def _mismatch(
    params: Params, told: speed.State, before: int, enabled: int, velocity: float, mode: int
) -> int:
    """Ticks in which the motor did not turn as commanded before, as the current's are counted."""
    if enabled == 0 or not RUN <= mode <= STOP_1:
        return 0
    most = params.limits.velocity_difference_stop
    return limits.counted(before, velocity - told.velocity, most)


def _astray(params: Params, brake: BrakeState, measured: float) -> int:
    """Ticks in a row in which the brake did not have the current it was told before."""
    most = params.limits.brake_difference_stop
    return 0 if -most <= measured - brake.told.current <= most else brake.mismatch_ticks + 1


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
    """The tick's log row."""
    (motor, shaft), tared, wanted, correction, asked = signals
    encoders, servo, load, brake, panel = sense
    return BenchRow(
        tick,
        time,
        timing,
        plan,
        guard,
        encoders,
        servo,
        load,
        brake,
        panel,
        Rotation(*motor),
        Rotation(*shaft),
        tared,
        wanted,
        correction,
        asked,
        command,
        tick,
    )


KIND = cycle.Kind(BenchRow, Params, start, observe, ready, check, control, row)
