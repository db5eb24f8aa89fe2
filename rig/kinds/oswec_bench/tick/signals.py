"""Signals of the bench: readings and commands of a tick, the log row, the set points.

All angles, velocities and torques refer to the gearbox output: the motor's own values divided
(torques multiplied) by the gear ratio. Signs: a positive torque of the motor turns the shaft to
positive angles; the brake's torque opposes the shaft's velocity.
"""

from enum import IntEnum
from typing import NamedTuple

from controllers.oswec_position import Components
from controllers.signals import (
    Ampere,
    Count,
    Estimate,
    Flag,
    Index,
    Newton,
    NewtonMetre,
    PanelSense,
    Radian,
    RadianPerSecond,
    RadianPerSecond2,
    Second,
    Tick,
    Turning,
    Volt,
)
from rig.kinds.oswec_bench.tick import manual, stations
from rig.realtime import cycle, safety


class DriveMode(IntEnum):
    """The closed loop of the servo drive."""

    VELOCITY = 0  # commanded in volts
    TORQUE = 1  # commanded in amperes


# Plain ints for the compiled tick, as in `rig.realtime.safety`.
VELOCITY, TORQUE = (int(mode) for mode in DriveMode)


class EncoderSense(NamedTuple):
    """Both encoders; one frame carries both, so they have one age."""

    motor_counts: Count  # unwrapped, arbitrary zero; of the motor's shaft
    shaft_counts: Count  # unwrapped, arbitrary zero; behind the coupling
    age: Second


class ServoSense(NamedTuple):
    """Readings of the servo drive."""

    current: Ampere  # measured motor current
    enabled: Flag  # power stage is on
    fault: Index  # error code, 0: none
    age: Second


class WrenchSense(NamedTuple):
    """The six-axis load cell between shaft and brake; z is the axis of the shaft."""

    fx: Newton
    fy: Newton
    fz: Newton
    tx: NewtonMetre
    ty: NewtonMetre
    tz: NewtonMetre  # about the shaft, positive as the motor's torque on the brake
    age: Second


class BrakeSense(NamedTuple):
    """Readings of the particle brake's amplifier."""

    current: Ampere  # measured, >= 0
    age: Second


class Sense(NamedTuple):
    """All readings of a tick."""

    encoders: EncoderSense
    servo: ServoSense
    load: WrenchSense
    brake: BrakeSense
    panel: PanelSense


SENSE_IN_ROW: dict[str, str] = {}
"""Fields of `Sense` that have another name in a row."""


class Rotation(NamedTuple):
    """Estimated motion about the shaft's axis, relative to the tared zero."""

    angle: Radian
    velocity: RadianPerSecond
    acceleration: RadianPerSecond2


class Zeros(NamedTuple):
    """The zeros in use: measured angle = counts * rad per count - zero."""

    motor: Radian
    shaft: Radian
    torque: NewtonMetre  # of the load cell's tz
    samples: Count  # ticks averaged; 0: provisional, from the first tick alone


class Reference(NamedTuple):
    """The reference of the shaft; fields of the loop that is not in use are 0."""

    angle: Radian
    velocity: RadianPerSecond
    torque: NewtonMetre


class LoopDemand(NamedTuple):
    """The demand on the drive before limits; the field of the loop that is not in use is 0."""

    torque: NewtonMetre
    velocity: RadianPerSecond


class Command(NamedTuple):
    """All outputs of a tick, after all limits."""

    mode: Index  # `DriveMode`
    velocity: RadianPerSecond
    volts: Volt  # velocity command of the drive
    torque: NewtonMetre
    current: Ampere  # motor current, torque loop
    enable: Flag  # request to keep the drive's power stage on
    limited: Flag  # set of `rig.realtime.limits.LimitFlag`: why the demand was reduced
    brake_torque: NewtonMetre  # demand on the brake, >= 0 in both directions of rotation
    brake_current: Ampere  # setpoint of the brake's amplifier
    locked: Flag  # 1: the shaft is clamped for this session, or a person holds the flap
    sea: Index = -1  # sea for the wave maker, index into the session's seas; -1: still water
    clamp: Radian = 0.0  # angle of the shaft while it is locked


class BenchRow(NamedTuple):
    """One tick of a bench run; the tick stands first and last so that readers detect a torn row."""

    tick: Tick
    time: Second  # planned time since run start
    timing: cycle.Timing
    plan: cycle.PlanRecord  # its wave clock counts from the start of each row's motion
    safety: safety.State
    encoders: EncoderSense
    servo: ServoSense
    load: WrenchSense
    brake: BrakeSense
    panel: PanelSense
    motor: Rotation
    shaft: Rotation
    tared: Zeros
    reference: Reference  # without correction and feedback
    correction: Turning  # compensation of the driveline's deflection
    demand: LoopDemand
    command: Command
    power: stations.Power
    tick_end: Tick


class Setpoints(NamedTuple):
    """Table of set points by columns, all of one length; a plan segment holds its row's index."""

    components: Components  # of the references of all set points, those of each one together
    first: tuple[int, ...]  # index of the first component of the set point's reference
    length: tuple[int, ...]  # number of its components
    rise: tuple[float, ...]  # s, `EnvelopeTimes` of the reference
    fade_start: tuple[float, ...]  # s
    damping: tuple[float, ...]  # N*m*s/rad, R of the brake law T = R |v|
    brake_current: tuple[float, ...]  # A, added to the current of the brake law
    sea: tuple[int, ...]  # index into the session's seas; -1: still water
    flap_held: tuple[int, ...]  # 1: a person holds the flap
    hold_angle: tuple[float, ...]  # rad, of the held flap
    pto_damping: tuple[float, ...]  # N*m*s/rad, of the motor acting as power take-off
    manual: manual.Columns  # in manual mode


# Motion of motor and shaft relative to their zeros, as in `rig.realtime.axis`, rad for m.
Motion = tuple[Estimate, Estimate]

# The bench's own part of a row, computed in the tick.
TickSignals = tuple[Motion, Zeros, Reference, Turning, LoopDemand, stations.Power]
