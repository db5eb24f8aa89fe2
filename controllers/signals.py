"""The words of the loop: what is sensed, estimated, demanded and commanded, with its unit.

A word is a NamedTuple whose leaves are float or int; the unit is the annotation. A log row is
built of these words, so a unit is said once, here.
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
    """What a drive says is wrong with it."""

    NONE = 0
    GENERAL = 1
    UNDERVOLTAGE = 2  # its bus ran out of energy
    OVERVOLTAGE = 3  # its bus took more than the dump resistors could burn


class AxisSense(NamedTuple):
    """One powered axis as its drive and encoder report it."""

    counts: Count  # encoder, unwrapped, arbitrary zero
    encoder_age: Second  # time since the counts were sampled
    current: Ampere  # measured drive current, i = F / (Kt N)
    enabled: Flag  # the drive says its power stage is on
    fault: Index  # `DriveFault`: why the drive is in fault, 0 if it is not
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
    """What the law asks for, and the gains it used in this tick."""

    kp: NewtonSecondPerMetre
    ki: NewtonPerMetre
    km: Kilogram
    force: Newton  # force on the body before limits


class AxisCommand(NamedTuple):
    """What is sent to the drive of one axis, after all limits."""

    force: Newton  # force on the body
    current: Ampere  # drive current, F / (Kt N)
    enable: Flag  # the drive shall have its power stage on
    limited: Flag  # set of `Limited` flags: why the demand was not granted in full


class SpringSense(NamedTuple):
    """The magnetic spring's stator actuator."""

    position: Percent  # stator position by the field's convention, Table 4-1 of the MASK4 report
    arrived: Flag  # at its target and at rest
    age: Second


class SpringCommand(NamedTuple):
    """Where the stator actuator shall stand."""

    rate: NewtonPerMetre  # spring rate asked for, small-displacement, Table 4-1
    target: Percent  # stator position that gives it
    enable: Flag  # 1: go to the target and hold there; 0: stay where you are


class Modulation(IntEnum):
    """How a custom drive switches its bridge (MASK4 report (Sandia), Table 3-2)."""

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
    velocity_threshold: MetrePerSecond  # below it the power stage rests; 0: never
    discharge_level: Index  # set of dump resistors in use: 1 one, 15 all four


class DriveCommand(NamedTuple):
    """What a custom drive is told beside its current; a drive without such settings ignores it."""

    conducting: Flag  # 0: the power stage rests, no current and no switching loss
    settings: DriveSettings


class DriveSense(NamedTuple):
    """What a custom drive reports beside its current; as old as the axis's ``drive_age``."""

    conducting: Flag  # its power stage switches
    saturated: Flag  # the bus voltage does not suffice for the current asked
    dump: Index  # set of dump resistors that burn now


class ProbeSense(NamedTuple):
    """Wave probes of the basin; they see what the body radiates, too."""

    probe_1: Metre
    probe_2: Metre
    probe_3: Metre
    age: Second


class PanelSense(NamedTuple):
    """Digital inputs of the rig, as far as they are read: the stop chain itself is hard-wired."""

    e_stop: Flag  # 1: pressed
    limit_switch: Flag  # 1: an end of travel was reached
    age: Second


class Reference(NamedTuple):
    """Open-loop reference force, part of the demand."""

    scale: Ratio
    force: Newton  # on the body, scale included


class Turning(NamedTuple):
    """An angle about a shaft's axis and its rate."""

    angle: Radian
    velocity: RadianPerSecond
