"""The signals of a WaveBot: senses and commands of a tick, its log row, its set points."""

from typing import NamedTuple

from controllers.signals import (
    AxisCommand,
    AxisSense,
    DriveCommand,
    DriveSense,
    Estimate,
    Flag,
    Metre,
    Newton,
    PanelSense,
    ProbeSense,
    Radian,
    Reference,
    Second,
    SpringCommand,
    SpringSense,
    Tick,
    Volt,
    Watt,
)
from rig.kinds.wavebot.tick import stations, tare
from rig.realtime import axis, cycle, safety


class LoadSense(NamedTuple):
    """Load cells and the second position sensor."""

    lcb: Newton  # column load cell: force on the body
    trs: Newton  # shaft torque sensor as a linear force on the body
    slew: Newton  # reaction of the magnetic spring's torque at its lever
    stator_a: Newton  # axial force of the stator, first of two cells
    stator_b: Newton
    string_pot: Metre
    rotor_angle: Radian  # of the magnetic spring
    age: Second


class PowerSense(NamedTuple):
    """Values of the power analyser."""

    ac: Watt
    dc: Watt
    bus_voltage: Volt
    age: Second


class WaveSense(NamedTuple):
    """Undisturbed elevation at the device; only a simulated basin knows it (NaN elsewhere)."""

    elevation: Metre


class Sense(NamedTuple):
    """All signals that are read in a tick."""

    heave: AxisSense
    surge: AxisSense
    load: LoadSense
    spring: SpringSense
    power: PowerSense
    drive: DriveSense  # of heave
    probes: ProbeSense
    wave: WaveSense
    panel: PanelSense


SENSE_IN_ROW = {
    "heave": "heave.sense",
    "surge": "surge.sense",
    "spring": "spring_sense",
    "power": "power_sense",
    "drive": "drive_sense",
}
"""Fields of `Sense` that have another name in a row."""

Motion = tuple[Estimate, Estimate]  # heave and surge, from their zeros


class Command(NamedTuple):
    """All signals that are written in a tick."""

    heave: AxisCommand
    surge: AxisCommand
    spring: SpringCommand
    drive: DriveCommand  # of heave
    wave_trigger: Flag  # 1: the wave maker runs; its rising edge is zero of the wave clock


class WaveBotRow(NamedTuple):
    """One tick of a WaveBot run; the tick is first and last, so that a torn row is detected."""

    tick: Tick
    time: Second  # planned, since run start
    timing: cycle.Timing
    plan: cycle.PlanRecord
    safety: safety.State
    heave: axis.Record
    surge: axis.Record
    reference: Reference  # of the axis that the campaign excites
    load: LoadSense
    spring_sense: SpringSense
    spring_command: SpringCommand
    drive_sense: DriveSense
    drive_command: DriveCommand
    power_sense: PowerSense
    power: stations.Power
    tare: tare.Zeros
    probes: ProbeSense
    wave: WaveSense
    panel: PanelSense
    tick_end: Tick


class Setpoints(NamedTuple):
    """Table of set points by columns, all of one length; a plan segment holds its row's index."""

    law: tuple[tuple[float, ...], ...]  # of the heave law: a column per field of its SetPoint
    reference_scale: tuple[float, ...]
    realisation: tuple[int, ...]  # index of the reference in its table
    spring_rate: tuple[float, ...]  # N/m
    stroke: tuple[float, ...]  # m, either way from the zero: where the stator's force reverses
    surge_kp: tuple[float, ...]  # N*s/m
    surge_ki: tuple[float, ...]  # N/m
    bus_voltage: tuple[float, ...]  # V
    switching_period: tuple[float, ...]  # s
    hysteresis_tolerance: tuple[float, ...]  # A
    velocity_threshold: tuple[float, ...]  # m/s
    discharge_level: tuple[int, ...]  # set of dump resistors
    signal: tuple[tuple[float, ...], ...]  # a column per field of `signal_generator.SetPoint`


# The WaveBot's own part of a row, computed in the tick: heave, surge, reference, power, zeros.
TickSignals = tuple[axis.Record, axis.Record, Reference, stations.Power, tare.Zeros]
