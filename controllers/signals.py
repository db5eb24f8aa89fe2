"""Signals of the loop: sensed, estimated, demanded and commanded values, with their units.

Each signal is a NamedTuple whose leaves are float or int; the annotation gives the unit. A log row
consists of these signals, so this module alone defines their units.
"""

from enum import IntEnum
from typing import Annotated, NamedTuple

Ampere = Annotated[float, "A"]
Count = Annotated[int, "count"]
Flag = Annotated[int, "flag"]  # 0 or 1; a set of flags where the field says so
Index = Annotated[int, "index"]
Kilogram = Annotated[float, "kg"]
Metre = Annotated[float, "m"]
MetrePerSecond = Annotated[float, "m/s"]
MetrePerSecond2 = Annotated[float, "m/s^2"]
Newton = Annotated[float, "N"]
NewtonMetre = Annotated[float, "N*m"]
NewtonPerMetre = Annotated[float, "N/m"]
NewtonSecondPerMetre = Annotated[float, "N*s/m"]
Percent = Annotated[float, "%"]
Radian = Annotated[float, "rad"]
RadianPerSecond = Annotated[float, "rad/s"]
RadianPerSecond2 = Annotated[float, "rad/s^2"]
Ratio = Annotated[float, "1"]
Second = Annotated[float, "s"]
Tick = Annotated[int, "tick"]
Volt = Annotated[float, "V"]
Watt = Annotated[float, "W"]


class DriveFault(IntEnum):
    """Cause of a fault of an axis: as its drive reports it, above 0, or at its bus."""

    FIELDBUS_LOST = -1  # the bus to the drive failed, or the drive left its operation
    NONE = 0
    GENERAL = 1
    UNDERVOLTAGE = 2  # the bus ran out of energy
    OVERVOLTAGE = 3  # the bus took more energy than the dump resistors could burn


class AxisSense(NamedTuple):
    """One powered axis as its drive and encoder report it."""

    counts: Count  # encoder, unwrapped, arbitrary zero
    encoder_age: Second  # time since the counts were sampled
    current: Ampere  # measured drive current, i = F / (Kt N)
    enabled: Flag  # 1: the drive reports its power stage on
    fault: Index  # `DriveFault`: cause of the fault, 0 without a fault
    drive_age: Second  # time since the drive's values were sampled


class Estimate(NamedTuple):
    """Motion of one axis, heave up positive."""

    position: Metre
    velocity: MetrePerSecond
    acceleration: MetrePerSecond2


class Gains(NamedTuple):
    """Gains of the impedance law in the recorded sign: Kp < 0 absorbs."""

    kp: NewtonSecondPerMetre
    ki: NewtonPerMetre
    km: Kilogram


class Demand(NamedTuple):
    """Demand of the law, and the gains it used in this tick."""

    kp: NewtonSecondPerMetre
    ki: NewtonPerMetre
    km: Kilogram
    force: Newton  # force on the body before limits


class AxisCommand(NamedTuple):
    """Command to the drive of one axis, after all limits."""

    force: Newton  # force on the body
    current: Ampere  # drive current, F / (Kt N)
    enable: Flag  # 1: the drive shall switch its power stage on
    limited: Flag  # set of `LimitFlag` values: why the demand was not granted in full


class SpringSense(NamedTuple):
    """The magnetic spring's stator actuator."""

    position: Percent  # stator position by the convention of Table 4-1 of the MASK4 report
    arrived: Flag  # 1: at its target and at rest
    age: Second


class SpringCommand(NamedTuple):
    """Command to the stator actuator."""

    rate: NewtonPerMetre  # demanded spring rate, small-displacement, Table 4-1
    target: Percent  # stator position that gives this rate
    enable: Flag  # 1: move to the target and hold there; 0: stay in place


class Modulation(IntEnum):
    """Modulation scheme of a custom drive's bridge (MASK4 report (Sandia), Table 3-2)."""

    SVPWM = 0
    SINE_TRIANGLE = 1
    DPWM = 2
    HYSTERESIS = 3


class DriveSettings(NamedTuple):
    """Settings of the custom motor drive, MASK4 report (Sandia), Table 3-3."""

    scheme: Index  # `Modulation`
    bus_voltage: Volt  # set point of the DC bus
    switching_period: Second
    hysteresis_tolerance: Ampere  # dead band of the current, hysteresis scheme only
    velocity_threshold: MetrePerSecond  # below it the power stage rests; 0: it never rests
    discharge_level: Index  # set of dump resistors in use: 1 one, 15 all four


class DriveCommand(NamedTuple):
    """Command to a custom drive in addition to its current; other drives ignore it."""

    conducting: Flag  # 0: the power stage rests, no current and no switching loss
    settings: DriveSettings


class DriveSense(NamedTuple):
    """Report of a custom drive in addition to its current; as old as the axis's ``drive_age``."""

    conducting: Flag  # 1: the power stage switches
    saturated: Flag  # 1: the bus voltage does not suffice for the commanded current
    dump: Index  # set of dump resistors that are burning energy now


class ProbeSense(NamedTuple):
    """Wave probes of the basin; they also measure the waves that the body radiates."""

    probe_1: Metre
    probe_2: Metre
    probe_3: Metre
    age: Second


class PanelSense(NamedTuple):
    """Digital inputs of the rig that the loop reads; the stop chain itself is hard-wired."""

    e_stop: Flag  # 1: pressed
    limit_switch: Flag  # 1: the axis reached an end of travel
    age: Second


class Reference(NamedTuple):
    """Open-loop reference force, part of the demand."""

    scale: Ratio
    force: Newton  # on the body, scale included


class Turning(NamedTuple):
    """Angle and angular velocity of a shaft."""

    angle: Radian
    velocity: RadianPerSecond
