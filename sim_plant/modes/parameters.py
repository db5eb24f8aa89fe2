"""Schema of the plant file of a rig of coupled modes.

A number is written plainly, or as {value, unit, source} with one of the units of its field.
Translations are in m, N and kg, rotations in rad, N m and kg m2.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from sim_plant.entries import StrictModel, Text
from sim_plant.modes.plant import AXIS_SIGNALS, ELEVATION, MODE_POSITION, MODE_VELOCITY

MODE_SIGNALS = {"position": MODE_POSITION, "velocity": MODE_VELOCITY}
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]


def _plain(*units: str) -> BeforeValidator:
    """Return a validator that takes the value out of {value, unit, source} and checks the unit."""

    def take(given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        unknown = set(given) - {"value", "unit", "source"}
        if unknown or "value" not in given:
            raise ValueError("is neither a number nor a mapping of value, unit and source")
        unit = given.get("unit")
        if unit is not None and unit not in units:
            raise ValueError(f"unit {unit!r} is not allowed; allowed: {', '.join(units)}")
        return given["value"]

    return BeforeValidator(take)


_FORCE_PER_SPEED = _plain("N*s/m", "N s/m", "N*m*s/rad", "N m s/rad", "N m s")
_STIFFNESS = _plain("N/m", "N*m/rad", "N m/rad", "N m")
_INERTIA = _plain("kg", "kg*m2", "kg m2", "kg*m^2", "kg m^2")
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
    _plain("N*s2/m2", "N s2/m2", "N*m*s2/rad2", "N m s2/rad2", "N m s2"),
]
StopPosition = Annotated[float, Field(gt=0.0, le=1.0e3), _plain("m", "rad")]
Force = Annotated[float, Field(ge=0.0, le=1.0e9), _plain("N", "N*m", "N m")]
Speed = Annotated[float, Field(gt=0.0, le=10.0), _plain("m/s", "rad/s")]
TorqueConstant = Annotated[float, Field(gt=0.0, le=1.0e6), _plain("N*m/A", "N m/A", "N/A")]
GearRatio = Annotated[float, Field(gt=0.0, le=1.0e6), _plain("rad/m", "rad/rad", "1")]
Counts = Annotated[int, Field(gt=0, le=2**40), _plain("count", "1")]
CountOffset = Annotated[int, Field(ge=-(10**9), le=10**9), _plain("count", "1")]
Bandwidth = Annotated[float, Field(gt=0.0, le=1.0e5), _plain("Hz")]
Current = Annotated[float, Field(gt=0.0, le=1.0e5), _plain("A")]
CurrentNoise = Annotated[float, Field(ge=0.0, le=1.0e3), _plain("A")]
Resistance = Annotated[float, Field(ge=0.0, le=1.0e5), _plain("ohm")]
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

    position: StopPosition
    stiffness: StopStiffness
    damping: Damping = 0.0


class Mode(StrictModel):
    """One mode of motion of a body; `dof` is its name in the BEM file."""

    dof: Text
    mass: Inertia
    stiffness: Stiffness | None = None  # instead of the BEM file's own stiffness of this mode
    linear_damping: Damping = 0.0
    quadratic_damping: QuadraticDamping = 0.0
    end_stop: EndStop | None = None


class Drive(StrictModel):
    """Motor drive: a first-order current loop with limit, enable delay and watchdog.

    `resistance_ohm`: copper loss is resistance times the square of the drive current, which is the
    current that the torque constant multiplies. Where that is the peak phase current of a
    three-phase motor, it is 3/2 of the resistance of a phase (3/4 of that between two terminals).
    """

    current_bandwidth_hz: Bandwidth
    current_limit_a: Current
    resistance_ohm: Resistance = 0.0
    standby_w: Power = 0.0
    regeneration_efficiency: Share = 1.0
    enable_delay_s: Time = 0.1
    watchdog_s: Time = 0.2
    current_noise_a: CurrentNoise = 0.0


class Axis(StrictModel):
    """One PTO: position = sum of factor times position of the modes that it moves with."""

    moves_with: Annotated[dict[Name, Factor], Field(min_length=1)]
    inertia: ReflectedInertia = 0.0  # reflected, at the axis
    viscous_friction: Damping = 0.0
    coulomb_friction: Force = 0.0
    coulomb_velocity: Speed = 0.002  # width of the regularised sign, tanh(v / v_c)
    torque_constant_n_m_per_a: TorqueConstant
    gear_ratio: GearRatio
    counts_per_revolution: Counts
    count_offset: CountOffset = 0
    drive: Drive

    @model_validator(mode="after")
    def _check_factors(self) -> Axis:
        if not any(self.moves_with.values()):
            raise ValueError("moves_with: all factors are 0; the axis would not move")
        return self


class Sensor(StrictModel):
    """One channel: scale times the signal plus offset plus white noise (standard deviation)."""

    signal: Text
    noise: Annotated[float, Field(ge=0.0, le=1.0e9)] = 0.0
    offset: Number = 0.0
    scale: Number = 1.0


class Plant(StrictModel):
    """A complete plant file; `bem` and `radiation` are paths relative to it."""

    name: Text
    bem: Text
    radiation: Text | None = None  # a stored fit; without, each load fits the BEM file
    wave_direction_deg: Direction | None = None  # where the BEM file has several
    density_kg_per_m3: Density | None = None  # where the BEM file does not state it
    gravity_m_per_s2: Gravity | None = None
    depth_m: Depth | None = None
    length_scale_m: Length | None = None  # ULEN of WAMIT's numeric files; 1 without
    modes: Annotated[dict[Name, Mode], Field(min_length=1, max_length=24)]
    axes: Annotated[dict[Name, Axis], Field(min_length=1, max_length=24)]
    sensors: dict[Name, Sensor] = Field(default={})
    delay_s: Delay = 0.001  # age of a reading, rounded up to whole ticks
    wave_onset_s: Annotated[float, Field(ge=0.0, le=100.0), _SECOND] = 5.0  # cosine

    @model_validator(mode="after")
    def _check_names(self) -> Plant:
        for name, axis in self.axes.items():
            for mode in axis.moves_with:
                if mode not in self.modes:
                    raise ValueError(
                        f"axes.{name}.moves_with: {mode!r} is no mode; allowed: "
                        f"{', '.join(self.modes)}"
                    )
        for name, sensor in self.sensors.items():
            if sensor.signal not in (allowed := self.signals()):
                raise ValueError(
                    f"sensors.{name}.signal: {sensor.signal!r} is no signal; allowed: "
                    f"{', '.join(allowed)}"
                )
        by_dof: dict[str, str] = {}
        for name, each in self.modes.items():
            if each.dof in by_dof:
                raise ValueError(
                    f"modes.{name}.dof: {each.dof!r} is already that of {by_dof[each.dof]}"
                )
            by_dof[each.dof] = name
        return self

    def signals(self) -> dict[str, tuple[int, int]]:
        """Return the signals that a sensor may measure, with their kind and index in the step.

        Where a mode has the name of an axis, `position` and `velocity` are those of the axis.
        """
        found = {
            f"{mode}.{name}": (kind, index)
            for index, mode in enumerate(self.modes)
            for name, kind in MODE_SIGNALS.items()
        }
        for index, axis in enumerate(self.axes):
            found |= {f"{axis}.{name}": (kind, index) for kind, name in enumerate(AXIS_SIGNALS)}
        return found | {"wave.elevation": (ELEVATION, 0)}
