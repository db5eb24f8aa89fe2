"""The words of the loop: what is sensed, estimated, demanded and commanded, with its unit.

A word is a NamedTuple whose leaves are float or int; the unit is the annotation. A log row is
built of these words, so a unit is said once, here.
"""

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
NewtonPerMetre = Annotated[float, "N/m"]
NewtonSecondPerMetre = Annotated[float, "N*s/m"]
Percent = Annotated[float, "%"]
Radian = Annotated[float, "rad"]
Second = Annotated[float, "s"]
Tick = Annotated[int, "tick"]
Volt = Annotated[float, "V"]
Watt = Annotated[float, "W"]


class AxisSense(NamedTuple):
    """One powered axis as its drive and encoder report it."""

    counts: Count  # encoder, unwrapped, arbitrary zero
    encoder_age: Second  # time since the counts were sampled
    current: Ampere  # measured drive current, i = F / (Kt N)
    enabled: Flag  # the drive says its power stage is on
    fault: Flag  # the drive says it is in fault
    drive_age: Second  # time since the drive's values were sampled


class Estimate(NamedTuple):
    """Motion of one axis, heave up positive."""

    position: Metre
    velocity: MetrePerSecond
    acceleration: MetrePerSecond2


class Gains(NamedTuple):
    """Gains of the impedance law in the recorded sign: Kp < 0 absorbs, Km > 0 takes mass off."""

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
