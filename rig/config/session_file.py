"""The session file of a bench: which rig, which rows, how long, and what is corrected or fed back.

A session is run in one loop of the servo drive: rows of the velocity loop have an amplitude of the
shaft's angle, rows of the torque loop an amplitude of torque or of current.
"""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    field_serializer,
    model_serializer,
)

from rig.config.campaign_file import FolderName, Tare, TareOrNone
from rig.config.columns import Column
from rig.config.matrix import Values
from rig.config.model import Broken, FileModel, Several, Whole, refuse
from rig.config.problems import number_text, value_text
from rig.config.session_kinds import SESSIONS, Demand

Amplitude = Annotated[float, Field(ge=0.1, le=90)]
Period = Annotated[float, Field(ge=0.2, le=600)]
Damping = Annotated[float, Field(ge=0, le=1000)]
BrakeCurrent = Annotated[float, Field(ge=0, le=20)]
TorqueAmplitude = Annotated[float, Field(gt=0, le=1000)]
CurrentAmplitude = Annotated[float, Field(gt=0, le=100)]
ReleaseAngle = Annotated[float, Field(ge=-90, le=90)]
WaveAmplitude = Annotated[float, Field(ge=0.001, le=0.5)]

SESSION_COLUMNS = (
    Column("amplitude_deg", "amplitude", "deg", "amplitude"),
    Column("torque_amplitude_n_m", "torque_amplitude", "N*m", "torque amplitude"),
    Column("current_amplitude_a", "current_amplitude", "A", "current amplitude"),
    Column("period_s", "period", "s", "period"),
    Column("damping_n_m_s_per_rad", "damping", "N*m*s/rad", "damping"),
    Column("brake_current_a", "brake_current", "A", "brake current"),
    Column("release_deg", "release", "deg", "released at"),
    Column("wave_amplitude_m", "wave_amplitude", "m", "wave amplitude"),
    Column("pto_damping_n_m_s_per_rad", "pto_damping", "N*m*s/rad", "damping of the motor"),
)
"""What may change from row to row."""


class SessionRow(FileModel):
    """One row; what is not given is not asked for."""

    amplitude_deg: Amplitude | None = None
    torque_amplitude_n_m: TorqueAmplitude | None = None
    current_amplitude_a: CurrentAmplitude | None = None
    period_s: Period | None = None
    damping_n_m_s_per_rad: Damping | None = None
    brake_current_a: BrakeCurrent | None = None
    release_deg: ReleaseAngle | None = None
    wave_amplitude_m: WaveAmplitude | None = None
    pto_damping_n_m_s_per_rad: Damping | None = None

    @model_serializer(mode="wrap")
    def _given(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in dump(self).items() if value is not None}


class SessionGrid(FileModel):
    """All combinations of the values given, the first key outermost."""

    amplitude_deg: Annotated[Several[Amplitude] | None, Values] = None
    torque_amplitude_n_m: Annotated[Several[TorqueAmplitude] | None, Values] = None
    current_amplitude_a: Annotated[Several[CurrentAmplitude] | None, Values] = None
    period_s: Annotated[Several[Period] | None, Values] = None
    damping_n_m_s_per_rad: Annotated[Several[Damping] | None, Values] = None
    brake_current_a: Annotated[Several[BrakeCurrent] | None, Values] = None
    release_deg: Annotated[Several[ReleaseAngle] | None, Values] = None
    wave_amplitude_m: Annotated[Several[WaveAmplitude] | None, Values] = None
    pto_damping_n_m_s_per_rad: Annotated[Several[Damping] | None, Values] = None

    @model_serializer(mode="wrap")
    def _given(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in dump(self).items() if value is not None}


class SessionTiming(FileModel):
    """How long a row lasts."""

    rise_s: float = Field(ge=0.1, le=60)  # in which the motion grows, and fades again
    settle_periods: Whole = Field(ge=0, le=1000)  # whole periods between that and the measurement
    periods: Whole = Field(ge=1, le=10_000)  # whole periods to measure


class Irregular(FileModel):
    """A reference of many cosines: all lines k/repeat of a band, random phases."""

    low_hz: float = Field(ge=0.01, le=5)
    high_hz: float = Field(ge=0.01, le=5)
    repeat_s: float = Field(ge=1, le=600)
    seed: Whole = Field(ge=0, le=4_294_967_295)
    draws: Whole = Field(default=100, ge=1, le=1000)

    def broken_rules(self) -> Iterator[Broken]:
        """The band holds a line, and not more lines than a tick has time for."""
        first, last = self.low_hz * self.repeat_s, self.high_hz * self.repeat_s
        count = int(last + 1e-9) - int(first - 1e-9)
        if self.high_hz <= self.low_hz or count < 1:
            yield Broken(
                ("high_hz",),
                f"{number_text(self.high_hz)} leaves no multiple of 1/repeat_s above low_hz = "
                f"{number_text(self.low_hz)} Hz",
                self.high_hz,
            )
        elif count > MOST_LINES:
            yield Broken(
                ("repeat_s",),
                f"{number_text(self.repeat_s)} gives {count} lines; allowed at most {MOST_LINES}",
                self.repeat_s,
            )


MOST_LINES = 40
"""Most cosines of a reference: each costs the tick some microseconds."""


class NoCorrection(FileModel):
    """The driveline as it is."""

    kind: Literal["none"]


class OnlineCorrection(FileModel):
    """Each component amplified and advanced by regressions of an uncorrected run."""

    kind: Literal["online"]
    regressions: str = Field(min_length=1)  # file of constants with driveline points
    conditions: str | None = Field(default=None, min_length=1)  # the same file if missing
    phase_over: Literal["velocity", "torque", "both"] = "both"  # the line of the delay


class InstantaneousCorrection(FileModel):
    """The motor ahead by the deflection that the measured torque tells."""

    kind: Literal["instantaneous"]
    map: str = Field(min_length=1)  # file of constants with a deflection map


AnyCorrection = NoCorrection | OnlineCorrection | InstantaneousCorrection


HIGHEST_WAVE = 2.0
"""Hz; a shorter wave excites nothing of a flap's size."""


def _of_a_flap(told: Demand, at: tuple[str, int], given: dict[str, Any]) -> Iterator[Broken]:
    """Waves that a wave maker makes, and a flap that is let go from somewhere else than rest."""
    for key, values in given.items():
        one = not isinstance(values, list | tuple)
        for i, value in enumerate([values] if one else values):
            where = (*at, key) if one else (*at, key, i)
            if told.waves and key == "period_s" and value < 1.0 / HIGHEST_WAVE:
                message = f"{number_text(value)} is too short for waves; allowed 0.5 s and longer"
                yield Broken(where, message, value)
            if key == "release_deg" and abs(value) < LEAST_RELEASE:
                message = f"{number_text(value)} is where it rests; allowed 0.1 deg and further"
                yield Broken(where, message, value)


LEAST_RELEASE = 0.1  # deg


def _one_word(value: Any) -> Any:
    if value == "none":
        return {"kind": "none"}
    if isinstance(value, str):
        raise refuse(
            f"{value_text(value)} is not known; allowed none, or a mapping with kind online or "
            "instantaneous"
        )
    return value


class SessionFile(FileModel):
    """A session of the bench."""

    name: FolderName
    session: Literal[
        "driveline",
        "velocity_constant",
        "brake_map",
        "losses",
        "torque_constant",
        "torque_tracking",
        "flap_free_decay",
        "flap_hydrostatic",
        "flap_rao",
        "flap_pto_sweep",
    ]
    rig: str = Field(min_length=1)  # file, relative to this one
    plant: str | None = Field(default=None, min_length=1)  # in place of the rig's
    calibrations: Several[str] = Field(default=(), strict=False)  # before the rig's own
    seed: Whole = Field(default=1, ge=0, le=4_294_967_295)
    shaft: Literal["free", "clamped"] = "free"
    rows: Several[SessionRow] | None = Field(default=None, min_length=1, strict=False)
    grid: Several[SessionGrid] | None = Field(default=None, min_length=1, strict=False)
    irregular: Irregular | None = None
    timing: SessionTiming
    correction: Annotated[
        Annotated[AnyCorrection, Field(discriminator="kind")], BeforeValidator(_one_word)
    ] = NoCorrection(kind="none")
    position_feedback_per_s: float = Field(default=0.0, ge=0, le=5)  # 0: the shaft may drift
    control: Literal["open loop", "closed loop"] = "open loop"
    tare: TareOrNone = Tare()
    order: Literal["as given", "random"] = "as given"
    repeat: Whole = Field(default=1, ge=1, le=1000)

    def broken_rules(self) -> Iterator[Broken]:
        """Rows that this session can have, and nothing that its loop cannot do."""
        told = SESSIONS[self.session]
        if (self.rows is None) == (self.grid is None):
            found = "nothing given" if self.rows is None else "rows and grid given"
            yield Broken((), f"{found}; allowed exactly one of rows, grid")
        for key, entries in (("rows", self.rows), ("grid", self.grid)):
            for i, entry in enumerate(entries or ()):
                given = entry.model_dump()
                yield from self._row(told, (key, i), set(given))
                yield from _of_a_flap(told, (key, i), given)
        if self.irregular is not None and not told.irregular:
            yield Broken(("irregular",), f"a session {self.session} is regular; leave the key out")
        if self.correction.kind != "none" and not told.correction:
            message = f"a session {self.session} is not corrected; allowed none"
            yield Broken(("correction",), message, self.correction.kind)
        if self.control == "closed loop" and not told.feedback:
            message = f"a session {self.session} has no torque to follow; allowed open loop"
            yield Broken(("control",), message, self.control)
        if self.shaft == "clamped" and told.loop == "velocity":
            yield Broken(("shaft",), "the velocity loop would turn it; allowed free", self.shaft)
        if self.shaft == "clamped" and told.flap:
            message = f"a session {self.session} needs it to move; allowed free"
            yield Broken(("shaft",), message, self.shaft)
        if self.irregular is not None and told.waves and self.irregular.high_hz > HIGHEST_WAVE:
            message = f"{number_text(self.irregular.high_hz)} makes no waves; allowed up to 2 Hz"
            yield Broken(("irregular", "high_hz"), message, self.irregular.high_hz)
        if self.position_feedback_per_s > 0.0 and told.loop == "torque":
            message = "the torque loop has no position; leave the key out"
            yield Broken(("position_feedback_per_s",), message, self.position_feedback_per_s)

    def _row(self, told: Demand, at: tuple[str, int], given: set[str]) -> Iterator[Broken]:
        period = () if self.irregular is not None else ("period_s",)
        needed = [told.amplitude, *period, *told.needed]
        for key in needed:
            if key not in given:
                yield Broken(at, f"{key} missing; a session {self.session} needs it in every row")
        for key in sorted(given - {*needed, *told.columns}):
            if key == "period_s":
                message = "an irregular reference repeats after irregular.repeat_s; leave it out"
            else:
                allowed = ", ".join((*needed, *told.columns))
                message = f"a session {self.session} has no use for it; allowed {allowed}"
            yield Broken((*at, key), message)

    @field_serializer("tare")
    def _tare_as_written(self, tare: Tare | None) -> Any:
        return "none" if tare is None else tare.model_dump()

    @property
    def tare_duration(self) -> float:
        """Seconds of tare; 0 where the file says `none`."""
        return 0.0 if self.tare is None else self.tare.duration_s

    @property
    def loop(self) -> Literal["velocity", "torque"]:
        """Which loop of the drive is closed."""
        return SESSIONS[self.session].loop
