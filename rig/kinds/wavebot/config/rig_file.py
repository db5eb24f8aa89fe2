"""The rig file of a WaveBot: its components and their scales, and its wiring."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, ValidationInfo, field_validator

from rig.config.calibration_file import CalibrationFile, Stroke, TableCorrection
from rig.config.model import FileModel, RuleViolation, TupleOf, rule_error
from rig.config.rig_file import Axis, PowerRigFile, Rate, StopTiming
from rig.config.segment import Segment
from rig.config.wiring import (
    PANEL_INPUTS,
    WAVE_TRIGGER,
    Actuator,
    AnyBlock,
    BlockContent,
    CanBus,
    TorqueDrive,
    Wiring,
)
from rig.kinds.wavebot.config.columns import (
    BusVoltage,
    CurrentThreshold,
    DischargeLevel,
    HysteresisTolerance,
    ModulationScheme,
    SurgeKi,
    SurgeKp,
    SwitchingPeriod,
    VelocityThreshold,
)


class WaveBotWiring(Wiring):
    """The wiring of the WaveBot.

    The heave drive's first two analog inputs read the column load cell and the shaft torque
    sensor; those of the surge drive read the string pot and the rotor angle. Slew and stator
    cells, wave probes, power analyser and digital inputs are read over Modbus.
    """

    can: CanBus | None = None
    ethercat: Segment | None = None  # either this or `can`
    heave: TorqueDrive
    surge: TorqueDrive
    stator: Actuator
    analyser: Annotated[
        AnyBlock, BlockContent("power analyser", {"ac": "W", "dc": "W", "bus_voltage": "V"})
    ]
    cells: Annotated[
        AnyBlock,
        BlockContent(
            "strain-gauge amplifier: load cells", {"slew": "N", "stator_a": "N", "stator_b": "N"}
        ),
    ]
    probes: Annotated[
        AnyBlock,
        BlockContent(
            "strain-gauge amplifier: wave probes", {"probe_1": "m", "probe_2": "m", "probe_3": "m"}
        ),
    ]
    inputs: Annotated[AnyBlock, PANEL_INPUTS]
    outputs: Annotated[AnyBlock, WAVE_TRIGGER]

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the register blocks, the node numbers and the numbers of analog inputs."""
        yield from super().check_rules()
        for name in ("heave", "surge"):
            scales: tuple[float, ...] = getattr(self, name).analog_per_v
            if len(scales) != 2:
                yield RuleViolation((name, "analog_per_v"), "must be two scales", scales)


class SpringPoint(FileModel):
    """One measured station of the spring map."""

    stator_percent: float = Field(ge=-100, le=100)  # position of the stator
    rate_n_per_m: float = Field(ge=-50_000, le=50_000)  # spring rate there
    stroke_m: Stroke


class SpringMapping(FileModel):
    """Parameters for computing a spring map from measurements."""

    slew_lever_m: float = Field(ge=0.01, le=10)  # lever arm of the load cell that holds the torque
    moving_mass_kg: float = Field(ge=1, le=1e6)  # with added mass: natural frequency, eq. 3.1


class MagneticSpring(FileModel):
    """The magnetic spring and the actuator of its stator."""

    metres_per_radian: float = Field(ge=0.01, le=10)  # travel of heave per angle of the rotor
    arrival_tolerance_percent: float = Field(ge=0.01, le=10)
    """Distance within which the stator has arrived."""
    move_timeout_s: float = Field(ge=1, le=600)  # time in which a move must end
    mapping: SpringMapping | None = None  # None: a map cannot be measured
    map: TupleOf[SpringPoint] = Field(min_length=2, strict=False)

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the map is invertible: the stator rises, the rate is strictly monotone."""
        stators = [point.stator_percent for point in self.map]
        yield from self.check_rising(
            stators, ("map",), "stator_percent", of=" of the previous entry"
        )
        rates = [point.rate_n_per_m for point in self.map]
        rule = "the map must {} strictly, or a rate has two stator positions"
        yield from self.check_monotone(rates, ("map",), "rate_n_per_m", rule=rule)

    def by_rate(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the rates (N/m, increasing) and the stator position (%) of each rate."""
        pairs = sorted((point.rate_n_per_m, point.stator_percent) for point in self.map)
        return tuple(rate for rate, _ in pairs), tuple(position for _, position in pairs)

    def rate(self, stator: float) -> float | None:
        """Return the spring rate (N/m) at a stator position (%); None outside the map."""
        for low, high in pairwise(self.map):
            if low.stator_percent <= stator <= high.stator_percent:
                span = high.stator_percent - low.stator_percent
                fraction = (stator - low.stator_percent) / span
                return low.rate_n_per_m + fraction * (high.rate_n_per_m - low.rate_n_per_m)
        return None

    def stroke(self, rate: float) -> float:
        """Return the stroke (m, either direction) at a spring rate (N/m).

        Between two stations of the map it is the smaller of their strokes.
        """
        ranked = sorted((point.rate_n_per_m, point.stroke_m) for point in self.map)
        above = next((i for i, (r, _) in enumerate(ranked) if r >= rate), len(ranked) - 1)
        below = above if ranked[above][0] == rate else max(above - 1, 0)
        return min(ranked[below][1], ranked[above][1])


class StationKeeping(FileModel):
    """Default station keeping of surge, which a campaign may change."""

    kp_n_s_per_m: SurgeKp
    ki_n_per_m: SurgeKi
    reach_m: float = Field(gt=0, le=2)  # distance of the soft stops, either side of the station
    soft_stop_n_per_m: float = Field(ge=0, le=1e6)  # stiffness of the soft stops
    soft_stop_n_s_per_m2: float = Field(ge=0, le=1e6)  # damping per metre of penetration


class SurgeHold(FileModel):
    """Position hold of surge, for campaigns with `surge.use: hold`."""

    stiffness_n_per_m: float = Field(ge=0, le=1e6)  # of the hold
    damping_n_s_per_m: float = Field(ge=0, le=1e5)  # of the hold
    speed_m_per_s: float = Field(gt=0, le=1)  # of the approach to zero
    acceleration_m_per_s2: float = Field(gt=0, le=10)  # greatest one of the approach


class CotsDrive(FileModel):
    """A commercial drive, without settings that change from row to row."""

    kind: Literal["cots"]


class CustomDrive(FileModel):
    """A drive with our own firmware; these are its settings unless the campaign changes them."""

    kind: Literal["custom"]
    modulation: ModulationScheme
    bus_voltage_v: BusVoltage
    switching_period_s: SwitchingPeriod
    hysteresis_a: HysteresisTolerance
    velocity_threshold_m_per_s: VelocityThreshold
    current_threshold_a: CurrentThreshold
    discharge_level: DischargeLevel


class Stability(FileModel):
    """The minimum heave stiffness that every row of the gain matrix must leave."""

    hydrostatic_stiffness_n_per_m: float = Field(ge=100, le=1e6)  # of the body in water
    small_displacement_factor: float = Field(ge=0.5, le=3)  # small-signal rate over table rate
    least_stiffness_n_per_m: float = Field(ge=0, le=1e5)
    """Minimum of hydrostatic stiffness, spring and gains together."""


class Stop(StopTiming):
    """A controlled stop: passive damping for ``duration_s``, then power off."""

    damping_n_s_per_m: float = Field(gt=0, le=20_000)  # of the body; the force is -damping * v


class RigFile(PowerRigFile):
    """A rig of kind `wavebot`."""

    inline: ClassVar[tuple[str, ...]] = (*PowerRigFile.inline, "spring_map")

    kind: Literal["wavebot"]
    rate_hz: Rate
    heave: Axis
    surge: Axis
    station_keeping: StationKeeping
    surge_hold: SurgeHold
    drive: Annotated[CotsDrive | CustomDrive, Field(discriminator="kind")]  # of heave
    spring_map: CalibrationFile | None = None  # in a file: measured, replaces spring.map
    spring: MagneticSpring
    stability: Stability
    stop: Stop
    law: str | dict[str, Any] | None = None  # of campaigns without one; checked with them
    wiring: WaveBotWiring | None = None  # None: the rig can only be rehearsed

    @field_validator("spring_map")
    @classmethod
    def _require_spring_map(cls, file: CalibrationFile | None) -> CalibrationFile | None:
        if file is not None and file.quantity != "spring_map":
            raise rule_error(
                f"{file.title} corrects {file.quantity}; allowed a spring_map", "quantity"
            )
        return file

    @field_validator("spring", mode="before")
    @classmethod
    def _use_measured_map(cls, spring: Any, info: ValidationInfo) -> Any:
        """Replace the stations in the file by those of a measured map."""
        measured = info.data.get("spring_map")
        if measured is None or not isinstance(spring, dict):
            return spring
        assert isinstance(measured.correction, TableCorrection)
        table = measured.correction
        stations = zip(table.recorded, table.corrected, measured.stroke_m or (), strict=True)
        names = ("stator_percent", "rate_n_per_m", "stroke_m")
        return {**spring, "map": [dict(zip(names, station, strict=True)) for station in stations]}
