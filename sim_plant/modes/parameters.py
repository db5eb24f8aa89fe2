"""Schema of the plant file of a rig of coupled modes.

A number is written plainly, or as {value, unit, source} with one of the units of its field.
Translations are in m, N and kg, rotations in rad, N m and kg m2.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, get_args

from pydantic import BaseModel, BeforeValidator, Field, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from sim_plant.entries import StrictModel, Text
from sim_plant.modes import readings
from sim_plant.modes.bem_content import rotates

MODE_SIGNALS = {"position": readings.MODE_POSITION, "velocity": readings.MODE_VELOCITY}
BUS_SIGNALS = {
    "voltage": readings.BUS_VOLTAGE,
    "supply_power": readings.SUPPLY_POWER,
    "dump_power": readings.DUMP_POWER,
}
MAX_COUNTS = 1.0e9  # per unit of an axis: `sensors.encoder_count` has no larger ones
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]


@dataclass(frozen=True)
class _Plain(BeforeValidator):
    """A validator of a number, and the unit of a plain one: of a translation and of a rotation."""

    unit: str = ""
    rotary: str = ""


def _plain(*units: str, rotary: str = "") -> _Plain:
    """Return a validator that takes the value out of {value, unit, source} and checks the unit.

    A plain number has the first unit or, of a rotation, the unit ``rotary``.
    """

    def take(given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        unknown = set(given) - {"value", "unit", "source"}
        if unknown or "value" not in given:
            raise ValueError("is neither a number nor a mapping of value, unit and source")
        unit = given.get("unit")
        if unit is not None and unit not in units:
            names = {"given": unit, "allowed": ", ".join(units)}
            raise PydanticCustomError(
                "unit", "unit '{given}' is not allowed; allowed: {allowed}", names
            )
        return given["value"]

    return _Plain(take, unit=units[0], rotary=rotary or units[0])


_FORCE_PER_SPEED = _plain("N*s/m", "N s/m", "N*m*s/rad", "N m s/rad", "N m s", rotary="N*m*s/rad")
_STIFFNESS = _plain("N/m", "N*m/rad", "N m/rad", "N m", rotary="N*m/rad")
_INERTIA = _plain("kg", "kg*m2", "kg m2", "kg*m^2", "kg m^2", rotary="kg*m2")
_ONE = _plain("1")
_SECOND = _plain("s")

Inertia = Annotated[float, Field(gt=0.0, le=1.0e12), _INERTIA]
ReflectedInertia = Annotated[float, Field(ge=0.0, le=1.0e12), _INERTIA]
Stiffness = Annotated[float, Field(ge=-1.0e12, le=1.0e12), _STIFFNESS]
StopStiffness = Annotated[float, Field(gt=0.0, le=1.0e12), _STIFFNESS]
Damping = Annotated[float, Field(ge=0.0, le=1.0e12), _FORCE_PER_SPEED]
QuadraticDamping = Annotated[
    float,
    Field(ge=0.0, le=1.0e12),
    _plain("N*s2/m2", "N s2/m2", "N*m*s2/rad2", "N m s2/rad2", "N m s2", rotary="N*m*s2/rad2"),
]
StopPosition = Annotated[float, Field(gt=0.0, le=1.0e3), _plain("m", "rad", rotary="rad")]
Position = Annotated[float, Field(ge=-1.0e3, le=1.0e3), _plain("m", "rad", rotary="rad")]
Force = Annotated[float, Field(ge=0.0, le=1.0e9), _plain("N", "N*m", "N m", rotary="N*m")]
Preload = Annotated[float, Field(ge=-1.0e9, le=1.0e9), _plain("N", "N*m", "N m", rotary="N*m")]
Radius = Annotated[float, Field(gt=0.0, le=1.0e3), _plain("m", "m/rad", "rad/rad", "1", rotary="1")]
Pull = Annotated[float, Field(ge=0.0, le=1.0e6), _plain("1/m", "1/rad", rotary="1/rad")]
HalfAngle = Annotated[float, Field(gt=0.0, lt=1.5), _plain("rad")]
Positions = Annotated[
    list[Annotated[float, Field(ge=-1.0e3, le=1.0e3)]],
    Field(min_length=2, max_length=64),
    _plain("m", "rad"),
]
Rates = Annotated[
    list[Annotated[float, Field(ge=-1.0e12, le=1.0e12)]],
    Field(min_length=2, max_length=64),
    _STIFFNESS,
]
Speed = Annotated[float, Field(gt=0.0, le=10.0), _plain("m/s", "rad/s", rotary="rad/s")]
TorqueConstant = Annotated[float, Field(gt=0.0, le=1.0e6), _plain("N*m/A", "N m/A", "N/A")]
GearRatio = Annotated[float, Field(gt=0.0, le=1.0e6), _plain("rad/m", "rad/rad", "1", rotary="1")]
Counts = Annotated[int, Field(gt=0, le=2**40), _plain("count", "1")]
CountOffset = Annotated[int, Field(ge=-(10**9), le=10**9), _plain("count", "1")]
Bandwidth = Annotated[float, Field(gt=0.0, le=1.0e5), _plain("Hz")]
Current = Annotated[float, Field(gt=0.0, le=1.0e5), _plain("A")]
CurrentNoise = Annotated[float, Field(ge=0.0, le=1.0e3), _plain("A")]
Resistance = Annotated[float, Field(ge=0.0, le=1.0e5), _plain("ohm")]
LinearLoss = Annotated[float, Field(ge=0.0, le=1.0e3), _plain("W/A")]
BackEmf = Annotated[float, Field(gt=0.0, le=1.0e5), _plain("V*s/rad", "V s/rad")]
Voltage = Annotated[float, Field(ge=0.0, le=1.0e5), _plain("V")]
Capacitance = Annotated[float, Field(gt=0.0, le=1.0e3), _plain("F")]
Ohms = Annotated[float, Field(gt=0.0, le=1.0e6), _plain("ohm")]
Area = Annotated[float, Field(gt=0.0, le=10.0), _plain("m2", "m^2")]
Displacement = Annotated[float, Field(gt=0.0, le=1.0), _plain("m3/rad", "m^3/rad")]
Pressure = Annotated[float, Field(gt=0.0, le=1.0e9), _plain("Pa")]
Volume = Annotated[float, Field(gt=0.0, le=1.0e3), _plain("m3", "m^3")]
Exponent = Annotated[float, Field(ge=1.0, le=1.7), _ONE]
Leakage = Annotated[float, Field(ge=0.0, le=1.0), _plain("m3/s/Pa", "m^3/s/Pa")]
MotorInertia = Annotated[float, Field(gt=0.0, le=1.0e6), _plain("kg*m2", "kg m2", "kg m^2")]
MotorDamping = Annotated[float, Field(ge=0.0, le=1.0e6), _plain("N*m*s/rad", "N m s/rad", "N m s")]
Efficiency = Annotated[float, Field(gt=0.0, le=1.0), _ONE]
LineStiffness = Annotated[float, Field(ge=0.0, le=1.0e12), _plain("N/m")]
LineDamping = Annotated[float, Field(ge=0.0, le=1.0e12), _plain("N*s/m", "N s/m")]
Vector = Annotated[
    list[Annotated[float, Field(ge=-1.0e5, le=1.0e5)]], Field(min_length=3, max_length=3)
]
Power = Annotated[float, Field(ge=0.0, le=1.0e6), _plain("W")]
Share = Annotated[float, Field(ge=0.0, le=1.0), _ONE]
Time = Annotated[float, Field(gt=0.0, le=100.0), _SECOND]
Delay = Annotated[float, Field(ge=0.0, le=1.0), _SECOND]
Factor = Annotated[
    float, Field(ge=-1.0e6, le=1.0e6), _plain("1", "m/m", "rad/m", "m/rad", "rad/rad")
]
Number = Annotated[float, Field(ge=-1.0e12, le=1.0e12)]
Density = Annotated[float, Field(gt=0.0, le=2.0e3), _plain("kg/m3", "kg/m^3")]
Gravity = Annotated[float, Field(gt=0.0, le=30.0), _plain("m/s2", "m/s^2")]
Depth = Annotated[float, Field(gt=0.0, le=2.0e4), _plain("m")]
Length = Annotated[float, Field(gt=0.0, le=1.0e4), _plain("m")]
Direction = Annotated[float, Field(ge=-360.0, le=360.0), _plain("deg")]


class EndStop(StrictModel):
    """A spring and a damper beyond ± position of a mode."""

    position: StopPosition  # to either side, m or rad
    stiffness: StopStiffness  # beyond the position
    damping: Damping = 0.0  # beyond the position; never pulls


class Mode(StrictModel):
    """One mode of motion; `dof` is its name in the BEM file, None: a mass out of the water."""

    dof: Text | None = None  # name in the BEM file; none: a mass out of the water
    mass: Inertia  # kg or kg m2
    stiffness: Stiffness | None = None  # instead of the BEM file's own stiffness of this mode
    linear_damping: Damping = 0.0  # force per speed
    quadratic_damping: QuadraticDamping = 0.0  # force per square of the speed, rho Cd S / 2
    end_stop: EndStop | None = None  # of this mode


class Drive(StrictModel):
    """Motor drive: a first-order current loop with limit, enable delay and watchdog.

    `resistance_ohm`: copper loss is resistance times the square of the drive current, which is the
    current that the torque constant multiplies. Where that is the peak phase current of a
    three-phase motor, it is 3/2 of the resistance of a phase (3/4 of that between two terminals);
    where it is the rms of a phase, 3 times the resistance of a phase (3/2 between two terminals).
    """

    current_bandwidth_hz: Bandwidth  # of the current loop
    current_limit_a: Current  # of the drive
    resistance_ohm: Resistance = 0.0  # copper loss per square of the current
    loss_w_per_a: LinearLoss = 0.0  # of the power stage, times the magnitude of the current
    standby_w: Power = 0.0  # while the drive has its supply
    regeneration_efficiency: Share = 1.0  # share of the motor's power that the drive returns
    enable_delay_s: Time = 0.1  # from the request until the drive has power
    watchdog_s: Time = 0.2  # without commands for longer, the drive stops
    current_noise_a: CurrentNoise = 0.0  # standard deviation of the measured current
    # With a bus: the current is at most (modulation times bus voltage -+ back-EMF) / voltage drop.
    back_emf_v_s_per_rad: BackEmf | None = None  # of the motor
    voltage_drop_v_per_a: Ohms | None = None  # of the motor; without: resistance_ohm
    modulation: Share = 0.577  # greatest motor voltage per bus voltage


class Backlash(StrictModel):
    """Play between motor and axis; the motor is an inertia of its own, and bears the friction.

    Motion and stiffness are at the axis.
    """

    half_gap: StopPosition  # play to either side, at the axis
    stiffness: StopStiffness  # of the teeth, at the axis
    damping: Damping = 0.0  # of the teeth, at the axis


class Cogging(StrictModel):
    """Force of the magnets on the slots of a linear motor."""

    force_n: Annotated[float, Field(gt=0.0, le=1.0e6), _plain("N")]  # amplitude
    pitch_m: Length  # period along the motor


class Hydraulic(StrictModel):
    """Oil between axis and generator: cylinder, check valves, accumulator, hydraulic motor."""

    area_m2: Area  # of the cylinder's piston
    displacement_m3_per_rad: Displacement  # of the hydraulic motor
    low_pressure_pa: Pressure = 5.0e5  # of the return line
    precharge_pa: Pressure  # of the accumulator's gas
    volume_m3: Volume  # of the gas without oil
    relief_pa: Pressure | None = None  # at which the relief valve opens; without: 4 precharges
    start_pressure_pa: Pressure | None = None  # without: the precharge
    exponent: Exponent = 1.4  # of the gas
    leakage_m3_per_s_pa: Leakage = 0.0  # between the two lines, per pressure difference
    inertia_kg_m2: MotorInertia  # of hydraulic motor and generator
    viscous_n_m_s_per_rad: MotorDamping = 0.0  # friction of the hydraulic motor
    valve_velocity_m_per_s: Speed = 0.01  # speed within which the check valves change over


class Spring(StrictModel):
    """A linear spring between axis and ground, without force at the rest position.

    A negative rate takes stiffness away. `preload`: force on the axis at its position 0.
    """

    rate: Stiffness  # restoring force per motion; negative takes stiffness away
    rest_position: Position | None = None  # without force
    preload: Preload | None = None  # force at position 0, instead of a rest position

    @model_validator(mode="after")
    def _check_rest(self) -> Spring:
        if self.rest_position is not None and self.preload is not None:
            raise ValueError("preload: is rate times rest_position; give one of them")
        return self


class MagneticSpring(StrictModel):
    """A magnetic spring on the rotor of a pinion; its rate is fixed or a table over the stator.

    Rates are those of small motions or, with `fit_half_angle_rad`, the least-squares slopes over
    ± that rotor angle. The stator is at `stator_position` plus the position of the axis `stator`.
    """

    pinion_radius: Radius  # position of the axis per rotor angle
    rate: Stiffness | None = None  # of small motions, without a table
    stator_positions: Positions | None = None  # of the table
    rates: Rates | None = None  # of the table, linear between its positions
    fit_half_angle_rad: HalfAngle | None = None
    """The rates are least-squares slopes over ± that rotor angle."""
    stator: Name | None = None  # axis that moves the stator; none: it stands
    stator_position: Position | None = None  # without: 0
    pull: Pull = 0.0  # mean force on the stator per torque amplitude

    @model_validator(mode="after")
    def _check_table(self) -> MagneticSpring:
        positions, rates = self.stator_positions, self.rates
        if (positions is None) != (rates is None) or (rates is None) == (self.rate is None):
            raise ValueError("rate: needs either rate, or stator_positions with rates")
        if positions is None or rates is None:
            for name in ("stator", "stator_position", "pull"):
                if getattr(self, name):
                    raise ValueError(f"{name}: a fixed rate has no stator; give a table of rates")
            return self
        if len(positions) != len(rates):
            raise ValueError(f"rates: {len(rates)} for {len(positions)} stator_positions")
        if any(after <= before for before, after in pairwise(positions)):
            raise ValueError(f"stator_positions: {positions} must ascend")
        start = self.stator_position or 0.0
        if not positions[0] <= start <= positions[-1]:
            raise ValueError(
                f"stator_position: {start:g} is beyond the table; allowed {positions[0]:g} .. "
                f"{positions[-1]:g}"
            )
        return self


class Axis(StrictModel):
    """One PTO: position = sum of factor times position of the modes that it moves with.

    Inertia and friction are at the axis. A screw or belt is a gear: 2 pi / lead, or 1 / radius. A
    linear motor turns once per metre: its gear ratio is 2 pi rad/m, its torque constant the force
    constant / 2 pi, its counts per revolution are those per metre.
    """

    moves_with: Annotated[dict[Name, Factor], Field(min_length=1)]
    """Position of the axis per position of each mode."""
    inertia: ReflectedInertia = 0.0  # of motor and gear, at the axis
    viscous_friction: Damping = 0.0  # force per speed, at the axis
    coulomb_friction: Force = 0.0  # at the axis, N or N m
    coulomb_velocity: Speed = 0.002  # width of the regularised sign, tanh(v / v_c)
    torque_constant_n_m_per_a: TorqueConstant  # as in the rig file
    gear_ratio: GearRatio  # motor per axis, rad/m or rad/rad, as in the rig file
    gear_efficiency: Efficiency = 1.0  # of the force
    counts_per_revolution: Counts  # of the motor, as in the rig file
    count_offset: CountOffset = 0  # counts at position 0
    cogging: Cogging | None = None  # of a linear motor
    backlash: Backlash | None = None  # between motor and axis
    hydraulic: Hydraulic | None = None  # PTO with oil between axis and generator
    end_stop: EndStop | None = None  # of the axis
    spring: Spring | None = None  # between axis and ground
    magnetic_spring: MagneticSpring | None = None  # on a pinion of the axis
    drive: Drive  # of the motor

    @model_validator(mode="after")
    def _check_parts(self) -> Axis:
        if not any(self.moves_with.values()):
            raise ValueError("moves_with: all factors are 0; the axis would not move")
        if self.backlash and not self.inertia > 0.0:
            raise ValueError("backlash: the motor needs an inertia above 0 (at the axis)")
        drop = self.drive.voltage_drop_v_per_a or self.drive.resistance_ohm
        if self.drive.back_emf_v_s_per_rad and not drop > 0.0:
            raise ValueError(
                "drive.back_emf_v_s_per_rad: needs drive.voltage_drop_v_per_a, or resistance_ohm "
                "above 0"
            )
        counts = self.gear_ratio / (2.0 * math.pi) * self.counts_per_revolution
        if counts > MAX_COUNTS:
            raise ValueError(
                f"counts_per_revolution: {counts:.3g} counts per unit of the axis; allowed up to "
                f"{MAX_COUNTS:.0e}: an encoder's count has a limit"
            )
        if self.hydraulic is not None:
            self._check_hydraulic(self.hydraulic)
        return self

    def _check_hydraulic(self, oil: Hydraulic) -> None:
        for name in ("backlash", "inertia", "cogging"):
            if getattr(self, name):
                raise ValueError(f"{name}: a hydraulic axis has none; its motor is in `hydraulic`")
        if self.gear_efficiency < 1.0:
            raise ValueError("gear_efficiency: losses of a hydraulic axis are in `hydraulic`")
        ratio = oil.area_m2 / oil.displacement_m3_per_rad
        if abs(self.gear_ratio - ratio) > 1.0e-3 * ratio:
            raise ValueError(
                f"gear_ratio: {self.gear_ratio:g} rad/m is not hydraulic.area_m2 / "
                f"displacement_m3_per_rad = {ratio:.6g} rad/m"
            )
        if oil.low_pressure_pa >= oil.precharge_pa:
            raise ValueError(
                f"hydraulic.precharge_pa: {oil.precharge_pa:g} is not above low_pressure_pa "
                f"{oil.low_pressure_pa:g}"
            )
        if oil.relief_pa is not None and oil.relief_pa <= (
            oil.start_pressure_pa or oil.precharge_pa
        ):
            raise ValueError(
                f"hydraulic.relief_pa: {oil.relief_pa:g} is not above the pressure at the start"
            )
        if oil.start_pressure_pa is not None and oil.start_pressure_pa < oil.precharge_pa:
            raise ValueError(
                f"hydraulic.start_pressure_pa: {oil.start_pressure_pa:g} is below precharge_pa "
                f"{oil.precharge_pa:g}"
            )


class Line(StrictModel):
    """A taut mooring line; `moves_with` is the fairlead's displacement per position of each mode.

    Each is a vector: m per m of a translation, m per rad of a rotation.
    """

    anchor_m: Vector  # position of the anchor
    fairlead_m: Vector  # at rest
    pretension_n: Force  # at rest
    stiffness_n_per_m: LineStiffness  # axial: EA / length
    damping_n_s_per_m: LineDamping = 0.0  # axial
    moves_with: Annotated[dict[Name, Vector], Field(min_length=1)]
    """Displacement of the fairlead per position of each mode."""

    @model_validator(mode="after")
    def _check_length(self) -> Line:
        if self.anchor_m == self.fairlead_m:
            raise ValueError("fairlead_m: is at the anchor; a line needs a length")
        if not any(any(vector) for vector in self.moves_with.values()):
            raise ValueError("moves_with: all vectors are 0; the fairlead would not move")
        return self


class Mooring(StrictModel):
    """Linear stiffness between modes, symmetric, and taut lines."""

    stiffness: dict[Name, dict[Name, Stiffness]] = Field(default={})  # N/m, N, N m/rad
    lines: dict[Name, Line] = Field(default={}, max_length=24)

    @model_validator(mode="after")
    def _check_symmetry(self) -> Mooring:
        for one, row in self.stiffness.items():
            for other, value in row.items():
                mirror = self.stiffness.get(other, {}).get(one, value)
                if mirror != value:
                    raise ValueError(
                        f"stiffness.{one}.{other}: {value:g} differs from stiffness.{other}.{one} "
                        f"{mirror:g}; a mooring is conservative: give it once"
                    )
        return self


class Bus(StrictModel):
    """The DC bus of all drives: capacitor, supply behind a diode, dump resistor, voltage trips."""

    capacitance_f: Capacitance  # of all drives together
    voltage_v: Voltage  # at the start
    supply_v: Voltage | None = None  # None: no supply
    supply_resistance_ohm: Ohms = 1.0  # behind the diode
    dump_ohm: Ohms | None = None  # None: no dump resistor
    dump_on_v: Voltage | None = None  # voltage at which the dump resistor is switched on
    dump_off_v: Voltage | None = None  # voltage at which the dump resistor is switched off
    undervoltage_v: Voltage  # below for the delay, the drives trip
    undervoltage_delay_s: Time = 0.1  # until the trip
    brownout_v: Voltage  # below, drives draw no standby power
    overvoltage_v: Voltage  # above, the drives trip at once

    @model_validator(mode="after")
    def _check_order(self) -> Bus:
        dump = [self.dump_off_v, self.dump_on_v]
        if (self.dump_ohm is not None) != all(value is not None for value in dump):
            raise ValueError("dump_ohm, dump_on_v and dump_off_v belong together")
        names = ["brownout_v", "undervoltage_v", "voltage_v", "overvoltage_v"]
        if self.dump_ohm is not None:
            names[2:3] = ["dump_off_v", "dump_on_v"]
        values = [getattr(self, name) for name in names]
        if values != sorted(values) or len(set(values)) < len(values):
            listed = " < ".join(f"{n} {v:g}" for n, v in zip(names, values, strict=True))
            raise ValueError(f"voltages must ascend; this is not true: {listed}")
        highest = self.dump_off_v or self.overvoltage_v
        if self.supply_v is not None and not 0.0 < self.supply_v < highest:
            raise ValueError(
                f"supply_v: {self.supply_v:g} is out of range; allowed above 0 and below "
                f"{highest:g}, or it would feed the dump resistor or trip the drives"
            )
        if not self.undervoltage_v < self.voltage_v < self.overvoltage_v:
            raise ValueError(
                f"voltage_v: {self.voltage_v:g} is not between undervoltage_v and overvoltage_v"
            )
        return self


class Sensor(StrictModel):
    """One channel: scale times the signal plus offset plus white noise (standard deviation)."""

    signal: Text  # what it measures
    noise: Annotated[float, Field(ge=0.0, le=1.0e9)] = 0.0  # standard deviation
    offset: Number = 0.0  # added to the scaled signal
    scale: Number = 1.0  # reading per unit of the signal


class Plant(StrictModel):
    """A complete plant file; `bem` and `radiation` are paths relative to it."""

    name: Text  # title for people
    bem: Text  # BEM file
    radiation: Text | None = None  # a stored fit; without, each load fits the BEM file
    wave_direction_deg: Direction | None = None  # where the BEM file has several
    density_kg_per_m3: Density | None = None  # where the BEM file does not state it
    gravity_m_per_s2: Gravity | None = None  # where the BEM file does not state it
    depth_m: Depth | None = None  # of the water, where the BEM file does not state it
    length_scale_m: Length | None = None  # ULEN of WAMIT's numeric files; 1 without
    modes: Annotated[dict[Name, Mode], Field(min_length=1, max_length=24)]
    """Modes of motion by name."""
    axes: Annotated[dict[Name, Axis], Field(min_length=1, max_length=24)]  # PTOs by name
    mooring: Mooring = Mooring()  # stiffness and lines
    bus: Bus | None = None  # None: each drive has a stiff bus
    sensors: dict[Name, Sensor] = Field(default={})
    """Channels by name; the rig file has their names, too."""
    delay_s: Delay = 0.001  # age of a reading, rounded up to whole ticks
    wave_onset_s: Annotated[float, Field(ge=0.0, le=100.0), _SECOND] = 5.0  # cosine

    @model_validator(mode="after")
    def _check_names(self) -> Plant:
        """Refuse names of parts that do not exist, all at once, each at its key."""
        errors = [
            InitErrorDetails(
                type=PydanticCustomError("value_error", "{error}", {"error": message}),
                loc=key,
                input=name,
            )
            for key, name, message in self._wrong_names()
        ]
        if errors:
            raise ValidationError.from_exception_data(type(self).__name__, errors)
        return self

    def _wrong_names(self) -> Iterator[tuple[tuple[str, ...], str, str]]:
        """Yield key, name and message of each name that is wrong."""
        for key, mode in self._named_modes():
            if mode not in self.modes:
                yield key, mode, f"{mode!r} is no mode; allowed: {', '.join(self.modes)}"
        if not any(mode.dof for mode in self.modes.values()):
            yield ("modes",), "", "none has a dof of the BEM file; at least one moves in water"
        for name, axis in self.axes.items():
            stator = axis.magnetic_spring and axis.magnetic_spring.stator
            if stator and stator not in (others := [each for each in self.axes if each != name]):
                allowed_axes = ", ".join(others) or "none, the plant has one axis"
                message = f"{stator!r} is no other axis; allowed: {allowed_axes}"
                yield ("axes", name, "magnetic_spring", "stator"), stator, message
        for name in self.mooring.lines:
            if name in self.axes or name in self.modes or name in ("wave", "bus"):
                yield ("mooring", "lines", name), name, f"{name!r} is taken; choose another name"
        allowed = self.signals()
        for name, sensor in self.sensors.items():
            if sensor.signal not in allowed:
                message = f"{sensor.signal!r} is no signal; allowed: {', '.join(allowed)}"
                yield ("sensors", name, "signal"), sensor.signal, message
        by_dof: dict[str, str] = {}
        for name, each in self.modes.items():
            if each.dof is None:
                continue
            if each.dof in by_dof:
                message = f"{each.dof!r} is already that of {by_dof[each.dof]}"
                yield ("modes", name, "dof"), each.dof, message
            by_dof[each.dof] = name

    def _named_modes(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Yield the key of each place that names a mode, with the name."""
        for name, axis in self.axes.items():
            yield from ((("axes", name, "moves_with", mode), mode) for mode in axis.moves_with)
        for name, line in self.mooring.lines.items():
            key = ("mooring", "lines", name, "moves_with")
            yield from (((*key, mode), mode) for mode in line.moves_with)
        for mode, row in self.mooring.stiffness.items():
            yield ("mooring", "stiffness", mode), mode
            yield from ((("mooring", "stiffness", mode, each), each) for each in row)

    def sprung_axes(self) -> list[str]:
        """Return the axes with a spring of either sort."""
        return [name for name, axis in self.axes.items() if axis.spring or axis.magnetic_spring]

    def signals(self) -> dict[str, tuple[int, int]]:
        """Return the signals that a sensor may measure, with their kind and index in the step.

        Where a mode has the name of an axis, `position` and `velocity` are those of the axis.
        """
        found = {
            f"{mode}.{name}": (kind, index)
            for index, mode in enumerate(self.modes)
            for name, kind in MODE_SIGNALS.items()
        }
        for index, (name, axis) in enumerate(self.axes.items()):
            left_out = "motor_position" if axis.hydraulic else "pressure"
            found |= {
                f"{name}.{signal}": (kind, index)
                for kind, signal in enumerate(readings.AXIS_SIGNALS)
                if signal != left_out
            }
        for index, name in enumerate(self.sprung_axes()):
            found[f"{name}.spring_force"] = (readings.SPRING_FORCE, index)
            magnetic = self.axes[name].magnetic_spring
            if magnetic is not None and magnetic.rates is not None:
                found[f"{name}.stator_force"] = (readings.STATOR_FORCE, index)
        for index, name in enumerate(self.mooring.lines):
            found[f"{name}.tension"] = (readings.TENSION, index)
        if self.bus is not None:
            found |= {f"bus.{name}": (kind, 0) for name, kind in BUS_SIGNALS.items()}
        return found | {"wave.elevation": (readings.ELEVATION, 0)}


def plain_unit(plant: Plant, path: Sequence[str], rotary_axes: Collection[str]) -> str:
    """Return the unit of a plain number of a plant; empty without one, "1" for a ratio.

    ``rotary_axes``: axes that turn, as the rig file says. Modes turn by the name of their degree of
    freedom.
    """
    section, name, *_ = (*path, "", "")
    mode = plant.modes.get(name) if section == "modes" else None
    turns = name in rotary_axes if section == "axes" else bool(mode and rotates(mode.dof or ""))
    found: list[Any] = [Plant]
    for part in path:
        found = [below for each in found for below in _below(each, part)]
    units = (each for each in found if isinstance(each, _Plain))
    return next((each.rotary if turns else each.unit for each in units), "")


def _below(annotation: Any, part: str) -> Iterator[Any]:
    """Yield the annotations and validators of a key below an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        field = annotation.model_fields.get(part)
        if field is not None:
            yield from (field.annotation, *field.metadata)
            yield from _inside(field.annotation)
    elif getattr(annotation, "__origin__", None) is dict:
        yield from (get_args(annotation)[1], *_inside(get_args(annotation)[1]))


def _inside(annotation: Any) -> Iterator[Any]:
    """Yield the parts of a union or an annotated type, of any depth."""
    for each in (*get_args(annotation), *getattr(annotation, "__metadata__", ())):
        yield each
        yield from _inside(each)
