"""The file of a WaveBot rig: what is screwed together, and how its numbers are scaled."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from rig.config.calibration_file import CalibrationFile, Stroke, Table
from rig.config.columns import (
    BusVoltage,
    CurrentThreshold,
    DischargeLevel,
    HysteresisTolerance,
    Scheme,
    SurgeKi,
    SurgeKp,
    SwitchingPeriod,
    VelocityThreshold,
)
from rig.config.model import Broken, FileModel, Reason, Several, Whole, refuse
from rig.config.problems import number_text
from rig.config.wiring import Wiring

SupervisorTimeout = Annotated[float, Field(ge=0.3, le=30)]
"""Seconds without a sign of life of `rig run` after which the loop stops the rig (category 1).

The signs come every 0.1 s; the shortest time leaves room for a lost one and a busy host."""

SUPERVISOR_TIMEOUT: SupervisorTimeout = 1.0

_SECOND = 10**9  # ns
_FASTEST = 2000  # Hz


def _whole_nanoseconds(slowest: int) -> AfterValidator:
    def validated(rate: int) -> int:
        if _SECOND % rate:
            whole = (str(r) for r in range(slowest, _FASTEST + 1) if _SECOND % r == 0)
            raise refuse(
                f"{rate} gives a tick of no whole number of ns; allowed {', '.join(whole)} Hz"
            )
        return rate

    return AfterValidator(validated)


Rate = Annotated[
    Whole,
    Field(ge=200, le=_FASTEST),
    Reason("a tick is at most 5 ms and a whole number of ns"),
    _whole_nanoseconds(200),
]
"""Ticks a second, Hz."""
BenchRate = Annotated[
    Whole,
    Field(ge=500, le=_FASTEST),
    Reason("a bench's tick is at most 2 ms and a whole number of ns"),
    _whole_nanoseconds(500),
]
"""Ticks a second of a bench, Hz: its driveline is stiffer than a body in water."""


class Axis(FileModel):
    """Drive, encoder and estimator of one powered axis."""

    torque_constant_n_m_per_a: float = Field(ge=0.01, le=100)
    gear_ratio_rad_per_m: float = Field(ge=0.1, le=1000)
    counts_per_revolution: Whole = Field(ge=100, le=100_000_000)
    encoder_noise_counts: float = Field(ge=0, le=1000)  # standard deviation besides quantisation
    jerk_density_m2_per_s5: float = Field(ge=1e-4, le=1e6)
    gain_ramp_s: float = Field(ge=0, le=10)


class SpringPoint(FileModel):
    """One measured station of the spring map."""

    stator_percent: float = Field(ge=-100, le=100)
    rate_n_per_m: float = Field(ge=-50_000, le=50_000)
    stroke_m: Stroke


class SpringMapping(FileModel):
    """What a spring map is worked out with."""

    slew_lever_m: float = Field(ge=0.01, le=10)  # of the load cell that takes the torque
    moving_mass_kg: float = Field(ge=1, le=1e6)  # with the water's: natural frequency, eq. 3.1


class MagneticSpring(FileModel):
    """The magnetic spring and the actuator of its stator."""

    metres_per_radian: float = Field(ge=0.01, le=10)
    arrival_tolerance_percent: float = Field(ge=0.01, le=10)
    move_timeout_s: float = Field(ge=1, le=600)
    mapping: SpringMapping | None = None  # none: no map can be made of it
    map: Several[SpringPoint] = Field(min_length=2, strict=False)

    def broken_rules(self) -> Iterator[Broken]:
        """The map can be inverted: stator rises, and the rate only rises or only falls."""
        falling = self.map[1].rate_n_per_m < self.map[0].rate_n_per_m
        for i in range(1, len(self.map)):
            before, here = self.map[i - 1], self.map[i]
            if here.stator_percent <= before.stator_percent:
                yield Broken(
                    ("map", i, "stator_percent"),
                    f"{number_text(here.stator_percent)} does not rise above "
                    f"{number_text(before.stator_percent)} of the entry before",
                    here.stator_percent,
                )
            if here.rate_n_per_m == before.rate_n_per_m or falling != (
                here.rate_n_per_m < before.rate_n_per_m
            ):
                way = "fall" if falling else "rise"
                yield Broken(
                    ("map", i, "rate_n_per_m"),
                    f"{number_text(here.rate_n_per_m)} after {number_text(before.rate_n_per_m)}: "
                    f"the map must {way} strictly, or a rate has two stator positions",
                    here.rate_n_per_m,
                )

    def by_rate(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Rates (N/m, increasing) and the stator positions (%) that give them."""
        pairs = sorted((point.rate_n_per_m, point.stator_percent) for point in self.map)
        return tuple(rate for rate, _ in pairs), tuple(position for _, position in pairs)

    def rate(self, stator: float) -> float | None:
        """Spring rate (N/m) at a stator position (%); None beyond the ends of the map."""
        for low, high in pairwise(self.map):
            if low.stator_percent <= stator <= high.stator_percent:
                span = high.stator_percent - low.stator_percent
                share = (stator - low.stator_percent) / span
                return low.rate_n_per_m + share * (high.rate_n_per_m - low.rate_n_per_m)
        return None

    def stroke(self, rate: float) -> float:
        """Stroke (m, either way) at a spring rate (N/m): the lesser of the stations beside it."""
        ranked = sorted((point.rate_n_per_m, point.stroke_m) for point in self.map)
        above = next((i for i, (r, _) in enumerate(ranked) if r >= rate), len(ranked) - 1)
        below = above if ranked[above][0] == rate else max(above - 1, 0)
        return min(ranked[below][1], ranked[above][1])


class StationKeeping(FileModel):
    """What holds surge where the campaign says nothing else."""

    kp_n_s_per_m: SurgeKp
    ki_n_per_m: SurgeKi
    reach_m: float = Field(gt=0, le=2)  # either way from the station: no soft stop within
    soft_stop_n_per_m: float = Field(ge=0, le=1e6)
    soft_stop_n_s_per_m2: float = Field(ge=0, le=1e6)  # its damping, per metre of depth


class Hold(FileModel):
    """What holds surge in place where a campaign asks for that."""

    stiffness_n_per_m: float = Field(ge=0, le=1e6)
    damping_n_s_per_m: float = Field(ge=0, le=1e5)
    speed_m_per_s: float = Field(gt=0, le=1)  # on the way to the zero
    acceleration_m_per_s2: float = Field(gt=0, le=10)


class CotsDrive(FileModel):
    """A commercial drive: nothing to set from row to row."""

    kind: Literal["cots"]


class CustomDrive(FileModel):
    """A drive with own firmware: what it is set to where the campaign says nothing else."""

    kind: Literal["custom"]
    modulation: Scheme
    bus_voltage_v: BusVoltage
    switching_period_s: SwitchingPeriod
    hysteresis_a: HysteresisTolerance
    velocity_threshold_m_per_s: VelocityThreshold
    current_threshold_a: CurrentThreshold
    discharge_level: DischargeLevel


class Stability(FileModel):
    """What a row of the gain matrix must leave of the heave stiffness."""

    hydrostatic_stiffness_n_per_m: float = Field(ge=100, le=1e6)
    small_displacement_factor: float = Field(ge=0.5, le=3)  # small-signal over table rate
    least_stiffness_n_per_m: float = Field(ge=0, le=1e5)


class StopTiming(FileModel):
    """How long a controlled stop takes, and how soon it is pure damping."""

    duration_s: float = Field(ge=0.1, le=60)
    ramp_s: float = Field(ge=0, le=2)  # from what the run asked for to pure damping

    def broken_rules(self) -> Iterator[Broken]:
        """At least half of a stop is pure damping."""
        if self.ramp_s > 0.5 * self.duration_s:
            yield Broken(
                ("ramp_s",),
                f"{number_text(self.ramp_s)} leaves too little of the stop to pure damping; "
                f"allowed up to half of duration_s = {number_text(self.duration_s)} s",
                self.ramp_s,
            )


class Stop(StopTiming):
    """A controlled stop: passive damping for a while, then power off."""

    damping_n_s_per_m: float = Field(gt=0, le=20_000)  # of the body; the force is -damping * v


class RigFile(FileModel):
    """A rig of kind `wavebot`."""

    inline: ClassVar[tuple[str, ...]] = ("spring_map",)

    name: str = Field(min_length=1, max_length=64)
    kind: Literal["wavebot"]
    rate_hz: Rate
    realtime: Literal["best effort", "required"]
    limits: str = Field(min_length=1)  # file, relative to this one
    plant: str = Field(min_length=1)  # file, relative to this one; stands in for the hardware
    heave: Axis
    surge: Axis
    station_keeping: StationKeeping
    surge_hold: Hold
    drive: Annotated[CotsDrive | CustomDrive, Field(discriminator="kind")]  # of heave
    spring_map: CalibrationFile | None = None  # a file: as measured, in place of spring.map
    spring: MagneticSpring
    stability: Stability
    drive_enable_timeout_s: float = Field(ge=0.1, le=60)
    stop: Stop
    supervisor_timeout_s: SupervisorTimeout = SUPERVISOR_TIMEOUT
    wiring: Wiring | None = None  # none: it can only be rehearsed

    @field_validator("spring_map")
    @classmethod
    def _a_spring_map(cls, file: CalibrationFile | None) -> CalibrationFile | None:
        if file is not None and file.quantity != "spring_map":
            raise refuse(f"{file.title} corrects {file.quantity}; allowed a spring_map", "quantity")
        return file

    @field_validator("spring", mode="before")
    @classmethod
    def _as_measured(cls, spring: Any, info: ValidationInfo) -> Any:
        """The stations of a measured map take the place of those in the file."""
        measured = info.data.get("spring_map")
        if measured is None or not isinstance(spring, dict):
            return spring
        assert isinstance(measured.correction, Table)
        table = measured.correction
        stations = zip(table.recorded, table.corrected, measured.stroke_m or (), strict=True)
        names = ("stator_percent", "rate_n_per_m", "stroke_m")
        return {**spring, "map": [dict(zip(names, one, strict=True)) for one in stations]}
