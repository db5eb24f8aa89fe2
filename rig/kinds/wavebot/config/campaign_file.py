"""The WaveBot's campaign file: rig, sea, rows, surge and drive, or a hoist in place of the rows."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from rig.config.campaign_file import BaseCampaignFile, BaseStart, CampaignHead, with_laws
from rig.config.law_settings import IMPEDANCE, AxisLaw, ExpandName, ImpedanceSettings
from rig.config.matrix import Matrix, expand_values, matrix_model
from rig.config.model import FileModel, RuleViolation, TupleOf, WholeNumber, rule_error
from rig.config.problems import format_number
from rig.config.sea import CalmSea
from rig.kinds.wavebot.config.columns import (
    COLUMNS,
    BusVoltage,
    CurrentThreshold,
    DischargeLevel,
    HysteresisTolerance,
    Ki,
    Kp,
    ModulationScheme,
    SurgeKi,
    SurgeKp,
    SwitchingPeriod,
    VelocityThreshold,
)
from rig.laws import Law

Station = Annotated[float, Field(ge=-100, le=100)]
"""Position of the magnetic spring's stator, %."""

TURNAROUND_S = 1.0
"""Time of a hoist's reversal at either end of its travel, s; in between its speed is constant."""


class Hoist(FileModel):
    """Travel and speed of the hoist, and the stator positions at which the travel is run."""

    stations_percent: Annotated[TupleOf[Station], BeforeValidator(expand_values)]
    low_m: float = Field(ge=-2, lt=0)  # relative to the tared zero
    high_m: float = Field(gt=0, le=2)  # relative to the tared zero
    speed_m_per_s: float = Field(gt=0, le=0.2)  # between the reversals
    cycles: WholeNumber = Field(default=2, ge=1, le=20)  # per station

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that stations differ and that most of the travel is at constant speed."""
        for i, station in enumerate(self.stations_percent):
            if station in self.stations_percent[:i]:
                message = f"{format_number(station)} occurs twice; list each station once"
                yield RuleViolation(("stations_percent", i), message, station)
        max_speed = 0.25 * (self.high_m - self.low_m) / TURNAROUND_S
        if self.speed_m_per_s > max_speed:
            yield self.violation(
                "speed_m_per_s",
                f"{format_number(self.speed_m_per_s)} leaves no travel at constant speed; "
                f"allowed up to {format_number(max_speed)} m/s for this travel",
            )

    @property
    def period(self) -> float:
        """Duration of one cycle, s: up and down at constant speed, and two reversals."""
        return 2.0 * ((self.high_m - self.low_m) / self.speed_m_per_s + 0.5 * TURNAROUND_S)

    def description(self) -> str:
        """Return one line of text."""
        return (
            f"{format_number(self.low_m)} .. {format_number(self.high_m)} m at "
            f"{format_number(self.speed_m_per_s)} m/s, {self.cycles} times a station"
        )


if TYPE_CHECKING:
    ImpedanceMatrix = Matrix
else:
    ImpedanceMatrix = matrix_model(COLUMNS, IMPEDANCE.columns)


class SetPoint(FileModel):
    """Gains that are held while the sea builds up."""

    kp_n_s_per_m: Kp
    ki_n_per_m: Ki


class Start(BaseStart):
    """The time to the first row, with a set point of its own at the beginning."""

    set_point_s: float = Field(default=5.0, ge=0, le=600)  # duration of the first set point
    set_point: SetPoint | None = None  # None: the first row's kp, and ki 0

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the set point's time is part of the lead-in."""
        if self.set_point_s > self.lead_in_s:
            yield self.violation(
                "set_point_s",
                f"{format_number(self.set_point_s)} is longer than the lead-in it is part of; "
                f"allowed up to lead_in_s = {format_number(self.lead_in_s)} s",
            )


class SurgeControl(FileModel):
    """Control of surge; missing gains are those of the rig."""

    use: Literal["station keeping", "hold", "off"] = "station keeping"  # law of the surge drive
    kp_n_s_per_m: SurgeKp | None = None
    ki_n_per_m: SurgeKi | None = None


class DriveSetup(FileModel):
    """Settings of the custom drive for which the matrix has no column.

    Missing settings are those of the rig. ``supply`` is the state of the power supply of the bus:
    if it is disconnected, captured energy is the drive's only supply.
    """

    modulation: ModulationScheme | None = None
    supply: Literal["connected", "disconnected"] = "connected"  # of the drive
    bus_voltage_v: BusVoltage | None = None
    switching_period_s: SwitchingPeriod | None = None
    hysteresis_a: HysteresisTolerance | None = None
    velocity_threshold_m_per_s: VelocityThreshold | None = None
    current_threshold_a: CurrentThreshold | None = None
    discharge_level: DischargeLevel | None = None


class MatrixSubstitutes(CampaignHead):
    """Keys of a campaign without a matrix."""

    device: Literal["present", "absent"] = "present"  # absent: only waves and wave probes
    hoist: Hoist | None = None  # moves the body to measure the spring map; replaces the matrix


class CampaignFile(BaseCampaignFile, MatrixSubstitutes):
    """A campaign: the rows of a gain matrix, or a wave calibration without the device."""

    kind_columns = COLUMNS
    reference_axes = ("heave", "surge")
    axis_laws: ClassVar[Mapping[str, AxisLaw]] = {
        "heave": AxisLaw(IMPEDANCE, IMPEDANCE.columns, IMPEDANCE.parameters)
    }

    matrix: ImpedanceMatrix | None = None  # None without the device, and with a hoist
    start: Start = Start()
    law: Annotated[ImpedanceSettings, ExpandName] = ImpedanceSettings()  # or the law's name
    surge: SurgeControl = SurgeControl()
    drive: DriveSetup = DriveSetup()
    order: Literal["as given", "fewest spring moves", "random"] = "as given"

    @field_validator("matrix")
    @classmethod
    def _matrix_matches_device(cls, matrix: Matrix | None, info: ValidationInfo) -> Matrix | None:
        device, has_hoist = info.data.get("device"), info.data.get("hoist", True) is not None
        if matrix is None and device == "present" and not has_hoist:
            raise PydanticCustomError("missing", "missing")
        if matrix is not None and device == "absent":
            raise rule_error("device: absent has no rows; leave the key out")
        if matrix is not None and info.data.get("hoist") is not None:
            raise rule_error("the rows are the hoist's stations; leave the key out")
        return matrix

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check reference, hoist and device; without the device, only waves are measured."""
        yield from super().check_rules()
        if self.start.set_point is not None and self.zc_law is None:
            message = "only the impedance law has these gains; leave the key out"
            yield RuleViolation(("start", "set_point"), message)
        excited_axis = self.reference is not None and self.reference.axis
        if excited_axis == "surge" and self.surge.use == "off":
            message = "surge cannot be excited while surge.use is off; allowed heave"
            yield RuleViolation(("reference", "axis"), message, "surge")
        if self.hoist is not None:
            yield from self._hoist_rules()
        if self.device == "present":
            return
        if excited_axis:
            message = "device: absent has no axis to excite; leave the key out"
            yield RuleViolation(("reference",), message)
        if isinstance(self.sea, CalmSea):
            message = "calm water has no waves to calibrate; allowed any other sea"
            yield RuleViolation(("sea", "kind"), message, "calm")
        for key in ("tare", "order", "repeat"):
            # The configuration in a run's record has every key, so defaults must be accepted.
            if getattr(self, key) != type(self).model_fields[key].default:
                yield RuleViolation((key,), "device: absent has no use for it; leave the key out")
        if len(self.seeds) > 1:
            yield RuleViolation(("seed",), "device: absent has no rows to repeat; allowed one seed")
        if self.start.set_point is not None:
            message = "device: absent has no gains; leave the key out"
            yield RuleViolation(("start", "set_point"), message)
        if self.timing.scheme == "mask4":
            yield RuleViolation(
                ("timing",), "device: absent has no rows; leave the key out", "mask4"
            )
        if self.timing.settle_s is not None:
            message = "device: absent has no rows that settle; use a longer start.lead_in_s instead"
            yield RuleViolation(("timing", "settle_s"), message, self.timing.settle_s)

    def _hoist_rules(self) -> Iterator[RuleViolation]:
        """Check that only the hoist moves the body and that its cycles define a row's duration."""
        if self.device == "absent":
            yield self.violation("device", "a hoist needs a body to move; allowed present")
        if not isinstance(self.sea, CalmSea):
            yield RuleViolation(
                ("sea", "kind"), "a hoist needs calm water; allowed calm", self.sea.kind
            )
        if self.reference is not None:
            yield RuleViolation(("reference",), "the hoist alone moves the body; leave the key out")
        if self.start.set_point is not None:
            yield RuleViolation(("start", "set_point"), "a hoist has no gains; leave the key out")
        for key in ("periods", "interval_s"):
            if getattr(self.timing, key) is not None:
                yield RuleViolation(("timing", key), "hoist.cycles defines it; leave the key out")
        if self.timing.scheme == "mask4":
            yield RuleViolation(
                ("timing",), "a hoist has no mask4 windows; leave the key out", "mask4"
            )

    @property
    def excited_axis(self) -> str:
        """The axis that the open-loop reference excites; heave without one."""
        return "heave" if self.reference is None else self.reference.axis

    @property
    def uses_gains_only(self) -> bool:
        """Whether the force of heave depends on Kp, Ki and Km only: no Z_c and no reference."""
        has_excitation = self.reference is not None and self.reference.axis == "heave"
        impedance = self.zc_law
        return impedance is not None and impedance.zc is None and not has_excitation

    @property
    def heave_law(self) -> Law:
        """The heave law."""
        return self.axis_laws["heave"].law

    def has_known_ki(self, values: Any) -> bool:
        """Return whether the impedance law, whose stability is known from Ki, acts at a set point.

        ``values``: an object with an attribute for each column's name.
        """
        return self.heave_law.chosen(values).module is IMPEDANCE.module

    @property
    def zc_law(self) -> ImpedanceSettings | None:
        """The settings of the impedance law; None for another law."""
        return self.law if self.heave_law.module is IMPEDANCE.module else None


def campaign_model(law: Law) -> type[CampaignFile]:
    """Return the model of a campaign with a heave law: its columns and its parameters."""
    if law.module is IMPEDANCE.module:
        return CampaignFile
    return with_laws(CampaignFile, COLUMNS, (("heave", AxisLaw(law, law.columns, law.parameters)),))
