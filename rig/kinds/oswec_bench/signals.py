"""The words of the bench: what is sensed and commanded in a tick, its row, its set points.

All angles, velocities and torques are those of the gearbox output, the motor's own ones divided
(torques multiplied) by the gear ratio. Signs: a positive torque of the motor turns the shaft to
positive angles; the brake's torque opposes the shaft's velocity.
"""

from enum import IntEnum
from typing import NamedTuple

from controllers.oswec_position import Component
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
from rig.realtime import cycle, safety


class DriveMode(IntEnum):
    """Which loop of the servo drive is closed."""

    VELOCITY = 0  # commanded in volts
    TORQUE = 1  # commanded in amperes


# Plain ints for the tick, as in `rig.realtime.safety`.
VELOCITY, TORQUE = (int(mode) for mode in DriveMode)


class EncoderSense(NamedTuple):
    """Both encoders, read in one frame: they are equally old."""

    motor_counts: Count  # unwrapped, arbitrary zero; of the motor's shaft
    shaft_counts: Count  # unwrapped, arbitrary zero; behind the coupling
    age: Second


class ServoSense(NamedTuple):
    """The servo drive."""

    current: Ampere  # measured motor current
    enabled: Flag  # its power stage is on
    fault: Index  # its error code, 0: none
    age: Second


class WrenchSense(NamedTuple):
    """The six-axis load cell between shaft and brake; z lies along the shaft."""

    fx: Newton
    fy: Newton
    fz: Newton
    tx: NewtonMetre
    ty: NewtonMetre
    tz: NewtonMetre  # about the shaft, positive as the motor's torque on the brake
    age: Second


class BrakeSense(NamedTuple):
    """The amplifier of the particle brake."""

    current: Ampere  # measured, >= 0
    age: Second


class Sense(NamedTuple):
    """All that is read in a tick."""

    encoders: EncoderSense
    servo: ServoSense
    load: WrenchSense
    brake: BrakeSense
    panel: PanelSense


class Rotation(NamedTuple):
    """Estimated motion about the shaft's axis, from the tared zero."""

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
    """What the shaft should do; that of the loop not in use is 0."""

    angle: Radian
    velocity: RadianPerSecond
    torque: NewtonMetre


class LoopDemand(NamedTuple):
    """What is asked of the drive before limits; that of the loop not in use is 0."""

    torque: NewtonMetre
    velocity: RadianPerSecond


class Command(NamedTuple):
    """All that is written in a tick, after all limits."""

    mode: Index  # `DriveMode`
    velocity: RadianPerSecond
    volts: Volt  # velocity command of the drive
    torque: NewtonMetre
    current: Ampere  # motor current, torque loop
    enable: Flag  # the drive shall have its power stage on
    limited: (
        Flag  # set of `rig.realtime.limits.Limited`: why what was asked was not granted in full
    )
    brake_torque: NewtonMetre  # asked of the brake, >= 0 whichever way the shaft turns
    brake_current: Ampere  # of the brake's amplifier
    locked: Flag  # 1: somebody has clamped the shaft for this session, or holds the flap
    sea: Index = -1  # of the session's seas, what the wave maker shall run; -1: still water
    clamp: Radian = 0.0  # where the shaft is held while it is locked


class BenchRow(NamedTuple):
    """One tick of a bench run; tick stands first and last so that a torn row shows."""

    tick: Tick
    time: Second  # planned, since run start
    timing: cycle.Timing
    plan: cycle.PlanRecord  # its wave clock is the row's own: since its motion began
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
    correction: Turning  # what is added for the driveline's deflection
    demand: LoopDemand
    command: Command
    tick_end: Tick


class Flume(NamedTuple):
    """What a set point asks of a flap in its flume, in the brake's place."""

    sea: Index  # of the session's seas; -1: still water
    held: Flag  # 1: somebody holds the flap
    angle: Radian  # at this angle
    damping: float  # N*m*s/rad, of the motor as a power take-off


NO_FLUME = Flume(-1, 0, 0.0, 0.0)
"""A set point of the bench."""


class Setpoints(NamedTuple):
    """Table of set points by columns, all of one length; a plan segment names its index.

    ``components`` are those of the reference: rad in the velocity loop, N*m in the torque loop.
    """

    components: tuple[tuple[Component, ...], ...]
    damping: tuple[float, ...]  # N*m*s/rad, R of the brake law T = R |v|
    brake_current: tuple[float, ...]  # A, beside the brake law
    rise: tuple[float, ...]  # s, in which the reference grows from nothing
    until: tuple[float, ...]  # s of the row's own clock, when it begins to fade
    flume: tuple[Flume, ...]


# Motor and shaft from their zeros, as `rig.realtime.axis` has them: rad for m.
Motion = tuple[Estimate, Estimate]

# The bench's own part of a row, made in the tick.
TickSignals = tuple[Motion, Zeros, Reference, Turning, LoopDemand]
