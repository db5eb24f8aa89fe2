"""The campaign file: which rig, which sea, which rows, in which order and timing."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationInfo,
    field_serializer,
    field_validator,
)
from pydantic_core import PydanticCustomError

from rig.config.columns import (
    BusVoltage,
    CurrentThreshold,
    DischargeLevel,
    HysteresisTolerance,
    Ki,
    Kp,
    Scheme,
    SurgeKi,
    SurgeKp,
    SwitchingPeriod,
    VelocityThreshold,
)
from rig.config.hoist import Hoist
from rig.config.matrix import Matrix
from rig.config.model import Broken, FileModel, Several, Whole, refuse
from rig.config.problems import number_text, value_text
from rig.config.reference import Reference
from rig.config.sea import CalmSea, Sea


class Timing(FileModel):
    """How long a row lasts; what is not given follows from the sea.

    See rig.planning.campaign.windows.
    """

    scheme: Literal["default", "mask4"] = "default"
    settle_s: float | None = Field(default=None, ge=0, le=3600)
    interval_s: float | None = Field(default=None, ge=1, le=7200)
    periods: Whole | None = Field(default=None, ge=1, le=10_000)  # whole periods to measure

    def broken_rules(self) -> Iterator[Broken]:
        """A row lasts longer than its settling."""
        settle, interval = self.settle_s, self.interval_s
        if settle is not None and interval is not None and interval <= settle:
            yield Broken(
                ("interval_s",),
                f"{number_text(interval)} leaves nothing to measure; "
                f"allowed above settle_s = {number_text(settle)} s",
                interval,
            )


class SetPoint(FileModel):
    """Gains held while the sea builds up."""

    kp_n_s_per_m: Kp
    ki_n_per_m: Ki


class Start(FileModel):
    """From the wave maker's trigger (0 s of the wave clock) to the first row."""

    set_point_s: float = Field(default=5.0, ge=0, le=600)
    lead_in_s: float = Field(default=120.0, ge=0, le=3600)
    set_point: SetPoint | None = None  # the first row's kp with ki 0 if missing

    def broken_rules(self) -> Iterator[Broken]:
        """The set point is part of the lead-in."""
        if self.set_point_s > self.lead_in_s:
            yield Broken(
                ("set_point_s",),
                f"{number_text(self.set_point_s)} is longer than the lead-in it is part of; "
                f"allowed up to lead_in_s = {number_text(self.lead_in_s)} s",
                self.set_point_s,
            )


class TransferFunction(FileModel):
    """Coefficients by falling powers of s."""

    numerator: Several[float] = Field(min_length=1, max_length=20)
    denominator: Several[float] = Field(min_length=1, max_length=20)


class Law(FileModel):
    """What the heave law has beside the gains of the matrix."""

    zc: TransferFunction | None = None  # Z_c(s), N*s/m: its force on the body is Z_c v


class SurgeControl(FileModel):
    """How surge is held; gains that are not given are the rig's."""

    use: Literal["station keeping", "hold", "off"] = "station keeping"
    kp_n_s_per_m: SurgeKp | None = None
    ki_n_per_m: SurgeKi | None = None


class DriveSetup(FileModel):
    """Settings of the custom drive where the matrix has no column for them.

    What is not given is the rig's. ``supply`` is whether somebody has left the power supply on
    the bus: without it the drive lives on what it captures.
    """

    modulation: Scheme | None = None
    supply: Literal["connected", "disconnected"] = "connected"
    bus_voltage_v: BusVoltage | None = None
    switching_period_s: SwitchingPeriod | None = None
    hysteresis_a: HysteresisTolerance | None = None
    velocity_threshold_m_per_s: VelocityThreshold | None = None
    current_threshold_a: CurrentThreshold | None = None
    discharge_level: DischargeLevel | None = None


class Tare(FileModel):
    """Sensor zeros, taken in calm water with the drive off."""

    duration_s: float = Field(default=5.0, ge=0.5, le=600)


def _folder_name(name: str) -> str:
    plain = all(c.isascii() and (c.isalnum() or c in "._-") for c in name)
    if not (plain and name and len(name) <= 64 and name[0].isalnum() and name[-1] != "."):
        raise refuse(
            f"{value_text(name)} cannot name a run's folder; allowed 1 .. 64 letters, digits, "
            "'-', '_', '.', beginning with a letter or digit"
        )
    return name


FolderName = Annotated[str, AfterValidator(_folder_name)]
"""What names a run's folder."""


def _tare(value: Any) -> Any:
    if value == "none":
        return None
    if isinstance(value, (dict, Tare)):
        return value
    raise refuse(f"{value_text(value)} is not known; allowed none or a mapping with duration_s")


TareOrNone = Annotated[Tare | None, BeforeValidator(_tare)]
"""A tare, or None where the file says `none`."""


def _timing(value: Any) -> Any:
    if isinstance(value, str):
        if value in ("default", "mask4"):
            return {"scheme": value}
        raise refuse(
            f"{value_text(value)} is not known; "
            "allowed default, mask4, or a mapping of settle_s, interval_s, periods"
        )
    return value


class CampaignFile(FileModel):
    """A campaign: rows of a gain matrix, or without the device a wave calibration."""

    inline: ClassVar[tuple[str, ...]] = ("sea",)

    name: FolderName
    rig: str = Field(min_length=1)  # file, relative to this one
    plant: str | None = Field(default=None, min_length=1)  # in place of the rig's
    seed: Whole = Field(default=1, ge=0, le=4_294_967_295)
    sea: Sea  # or a file that holds it
    device: Literal["present", "absent"] = "present"  # absent: waves and probes alone
    hoist: Hoist | None = None  # it moves the body through the spring map; in place of a matrix
    matrix: Matrix | None = None  # None without the device, and with a hoist
    timing: Annotated[Timing, BeforeValidator(_timing)] = Timing()
    start: Start = Start()
    law: Law = Law()
    reference: Reference | None = None  # open-loop force, with the feedback of the matrix
    surge: SurgeControl = SurgeControl()
    drive: DriveSetup = DriveSetup()
    tare: TareOrNone = Tare()  # None: `none`
    order: Literal["as given", "fewest spring moves", "random"] = "as given"
    repeat: Whole = Field(default=1, ge=1, le=1000)

    @field_validator("matrix")
    @classmethod
    def _rows_of_a_device(cls, matrix: Matrix | None, info: ValidationInfo) -> Matrix | None:
        device, hoisted = info.data.get("device"), info.data.get("hoist", True) is not None
        if matrix is None and device == "present" and not hoisted:
            raise PydanticCustomError("missing", "missing")
        if matrix is not None and device == "absent":
            raise refuse("device: absent has no rows; leave the key out")
        if matrix is not None and info.data.get("hoist") is not None:
            raise refuse("the rows are the hoist's stations; leave the key out")
        return matrix

    def broken_rules(self) -> Iterator[Broken]:
        """Without the device there is nothing to tare, to order or to push; waves are the point."""
        pushed = self.reference is not None and self.reference.axis
        if pushed == "surge" and self.surge.use == "off":
            message = "surge cannot be pushed while surge.use is off; allowed heave"
            yield Broken(("reference", "axis"), message, "surge")
        if self.hoist is not None:
            yield from self._hoist_rules()
        if self.device == "present":
            return
        if pushed:
            message = "device: absent has nothing to push; leave the key out"
            yield Broken(("reference",), message)
        if isinstance(self.sea, CalmSea):
            message = "calm water has no waves to calibrate; allowed any other sea"
            yield Broken(("sea", "kind"), message, "calm")
        for key in ("tare", "order", "repeat"):
            # What a run's record keeps has every key: its default says nothing.
            if getattr(self, key) != type(self).model_fields[key].default:
                yield Broken((key,), "device: absent has no use for it; leave the key out")
        if self.start.set_point is not None:
            message = "device: absent has no gains; leave the key out"
            yield Broken(("start", "set_point"), message)
        if self.timing.scheme == "mask4":
            yield Broken(("timing",), "device: absent has no rows to time", "mask4")
        if self.timing.settle_s is not None:
            message = "device: absent has no row that settles; allowed is a longer start.lead_in_s"
            yield Broken(("timing", "settle_s"), message, self.timing.settle_s)

    def _hoist_rules(self) -> Iterator[Broken]:
        """The hoist alone moves the body, and its cycles say how long a row lasts."""
        if self.device == "absent":
            yield Broken(("device",), "absent leaves a hoist nothing to move", "absent")
        if not isinstance(self.sea, CalmSea):
            yield Broken(("sea", "kind"), "waves beside the hoist; allowed calm", self.sea.kind)
        if self.reference is not None:
            yield Broken(("reference",), "the hoist alone moves the body; leave the key out")
        if self.start.set_point is not None:
            yield Broken(("start", "set_point"), "a hoist has no gains; leave the key out")
        for key in ("periods", "interval_s"):
            if getattr(self.timing, key) is not None:
                yield Broken(("timing", key), "hoist.cycles says it; leave the key out")
        if self.timing.scheme == "mask4":
            yield Broken(("timing",), "a hoist has no such windows; leave the key out", "mask4")

    @field_serializer("tare")
    def _tare_as_written(self, tare: Tare | None) -> Any:
        return "none" if tare is None else tare.model_dump()

    @property
    def sea_seed(self) -> int:
        """Seed of the sea's phases: its own, or the campaign's."""
        own: int | None = getattr(self.sea, "seed", None)
        return self.seed if own is None else own

    @property
    def only_gains(self) -> bool:
        """Whether nothing but Kp, Ki and Km makes the force of heave: no Z_c and no reference."""
        pushed = self.reference is not None and self.reference.axis == "heave"
        return self.law.zc is None and not pushed

    @property
    def tare_duration(self) -> float:
        """Seconds of tare; 0 where the file says `none`."""
        return self.tare.duration_s if self.tare is not None and self.device == "present" else 0.0
