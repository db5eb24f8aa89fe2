"""The session file of a bench: rig, rows, timing, correction and feedback.

A session uses one loop of the servo drive. Rows of the velocity loop have an amplitude of the
shaft's angle, rows of the torque loop an amplitude of torque or of current.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, TypeAlias

from pydantic import BeforeValidator, Field

from rig.config.matrix import KindColumns, MatrixColumns, combination_model
from rig.config.model import FileModel, RuleViolation, TupleOf, WholeNumber, rule_error
from rig.config.problems import format_number, format_value
from rig.config.task_file import FolderName, Tare, TareOrNone
from rig.row_contents import Column

SESSION_COLUMNS = {
    Column("amplitude_deg", "amplitude", "deg", "amplitude"): Field(ge=0.1, le=90),
    Column("torque_amplitude_n_m", "torque_amplitude", "N*m", "torque amplitude"): Field(
        gt=0, le=1000
    ),
    Column("current_amplitude_a", "current_amplitude", "A", "current amplitude"): Field(
        gt=0, le=100
    ),
    Column("period_s", "period", "s", "period"): Field(ge=0.2, le=600),
    Column("damping_n_m_s_per_rad", "damping", "N*m*s/rad", "damping"): Field(ge=0, le=1000),
    Column("brake_current_a", "brake_current", "A", "brake current"): Field(ge=0, le=20),
    Column("release_deg", "release", "deg", "release angle"): Field(ge=-90, le=90),
    Column("wave_amplitude_m", "wave_amplitude", "m", "wave amplitude"): Field(ge=0.001, le=0.5),
    Column("pto_damping_n_m_s_per_rad", "pto_damping", "N*m*s/rad", "motor damping"): Field(
        ge=0, le=1000
    ),
}
"""Columns that may change from row to row, with their ranges; a missing one is not commanded."""

_COLUMNS = KindColumns(
    None,
    tuple(SESSION_COLUMNS),
    {column.key: Annotated[(float, bounds)] for column, bounds in SESSION_COLUMNS.items()},
    {},
)


FREE_SHAFT = (
    "in the torque loop nothing keeps a free shaft in its range, and a stop would swing it up: the "
    "motor's inertia is too small for damping at the rate of the loop"
)


class SessionRequirements(NamedTuple):
    """Columns that the rows of a kind of session must and may have, and its options."""

    loop: Literal["velocity", "torque"]
    amplitude_column: str
    optional_columns: tuple[str, ...]  # in addition to amplitude and period
    required_columns: tuple[str, ...] = ()  # in addition to amplitude and period
    allows_irregular: bool = False  # the reference may be irregular
    allows_correction: bool = False  # the position may be corrected
    allows_feedback: bool = False  # the torque loop may be closed
    flap_coupling: Literal["", "free", "coupled"] = ""  # rigid coupling of the flap; "": no flap
    needs_waves: bool = False  # the amplitude is that of waves

    @property
    def needs_clamp(self) -> bool:
        """Whether only a clamp can hold the shaft."""
        return self.loop == "torque" and not self.flap_coupling


_BRAKE_COLUMNS = ("damping_n_m_s_per_rad", "brake_current_a")
SESSION_KINDS = {
    "driveline": SessionRequirements(
        "velocity", "amplitude_deg", _BRAKE_COLUMNS, allows_irregular=True, allows_correction=True
    ),
    "velocity_constant": SessionRequirements("velocity", "amplitude_deg", ()),
    "brake_map": SessionRequirements("velocity", "amplitude_deg", ("brake_current_a",)),
    "losses": SessionRequirements("velocity", "amplitude_deg", _BRAKE_COLUMNS),
    "torque_constant": SessionRequirements("torque", "current_amplitude_a", ("brake_current_a",)),
    "torque_tracking": SessionRequirements(
        "torque", "torque_amplitude_n_m", ("brake_current_a",), allows_feedback=True
    ),
    "flap_free_decay": SessionRequirements("torque", "release_deg", (), flap_coupling="free"),
    "flap_hydrostatic": SessionRequirements(
        "velocity", "amplitude_deg", (), flap_coupling="coupled"
    ),
    "flap_rao": SessionRequirements(
        "torque",
        "wave_amplitude_m",
        (),
        allows_irregular=True,
        flap_coupling="free",
        needs_waves=True,
    ),
    "flap_pto_sweep": SessionRequirements(
        "torque",
        "wave_amplitude_m",
        (),
        ("pto_damping_n_m_s_per_rad",),
        allows_irregular=True,
        flap_coupling="coupled",
        needs_waves=True,
    ),
}
"""The requirements of each kind of session."""

if TYPE_CHECKING:
    SessionRow: TypeAlias = MatrixColumns
    SessionGrid: TypeAlias = MatrixColumns
    SessionKind: TypeAlias = str
else:
    SessionRow, SessionGrid = (
        combination_model(_COLUMNS, ()),
        combination_model(_COLUMNS, (), grid=True),
    )
    SessionKind = Literal[tuple(SESSION_KINDS)]


class SessionTiming(FileModel):
    """Duration of a row."""

    rise_s: float = Field(ge=0.1, le=60)  # of the fade-in and of the fade-out
    settle_periods: WholeNumber = Field(ge=0, le=1000)  # from fade-in to measurement
    periods: WholeNumber = Field(ge=1, le=10_000)  # periods to measure


class IrregularReference(FileModel):
    """A reference of many cosines: all lines k/repeat of a band, with random phases."""

    low_hz: float = Field(ge=0.01, le=5)  # lower end of the band
    high_hz: float = Field(ge=0.01, le=5)  # upper end of the band
    repeat_s: float = Field(ge=1, le=600)  # period after which the signal repeats
    seed: WholeNumber = Field(ge=0, le=4_294_967_295)  # of the random phases
    draws: WholeNumber = Field(default=100, ge=1, le=1000)
    """Number of draws of the phases, of which the best is kept."""

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the band contains a line, and at most `MAX_LINES` lines."""
        first, last = self.low_hz * self.repeat_s, self.high_hz * self.repeat_s
        count = int(last + 1e-9) - int(first - 1e-9)
        if self.high_hz <= self.low_hz or count < 1:
            yield self.violation(
                "high_hz",
                f"{format_number(self.high_hz)} leaves no multiple of 1/repeat_s above low_hz = "
                f"{format_number(self.low_hz)} Hz",
            )
        elif count > MAX_LINES:
            yield self.violation(
                "repeat_s",
                f"{format_number(self.repeat_s)} gives {count} lines; allowed at most {MAX_LINES}",
            )


MAX_LINES = 40
"""Maximum number of cosines of a reference; each costs the tick some microseconds."""


class NoCorrection(FileModel):
    """No correction of the driveline."""

    kind: Literal["none"]


class OnlineCorrection(FileModel):
    """Amplification and phase advance of each component by regressions of an uncorrected run."""

    kind: Literal["online"]
    regressions: str = Field(min_length=1)  # file of constants with driveline points
    conditions: str | None = Field(default=None, min_length=1)  # None: the file of regressions
    phase_over: Literal["velocity", "torque", "both"] = "both"  # regressors of the phase


class InstantaneousCorrection(FileModel):
    """Lead of the motor by the deflection that follows from the measured torque."""

    kind: Literal["instantaneous"]
    map: str = Field(min_length=1)  # file of constants with a deflection map


AnyCorrection = NoCorrection | OnlineCorrection | InstantaneousCorrection


MAX_WAVE_HZ = 2.0
"""Maximum wave frequency, Hz; shorter waves do not excite a body of a flap's size."""


def _check_flap(
    requirements: SessionRequirements, at: tuple[str, int], given: dict[str, Any]
) -> Iterator[RuleViolation]:
    """Check that wave periods are long enough and that the release angle is not the rest angle."""
    for key, values in given.items():
        is_list = isinstance(values, list | tuple)
        for i, value in enumerate(values if is_list else [values]):
            value_key = (*at, key, i) if is_list else (*at, key)
            if requirements.needs_waves and key == "period_s" and value < 1.0 / MAX_WAVE_HZ:
                message = f"{format_number(value)} is too short for waves; allowed 0.5 s and longer"
                yield RuleViolation(value_key, message, value)
            if key == "release_deg" and abs(value) < MIN_RELEASE_DEG:
                message = f"{format_number(value)} is the rest position; "
                message += "allowed angles from 0.1 deg, either sign"
                yield RuleViolation(value_key, message, value)


MIN_RELEASE_DEG = 0.1
"""Minimum magnitude of a release angle, deg."""


def _expand_correction(value: Any) -> Any:
    if value == "none":
        return {"kind": "none"}
    if isinstance(value, str):
        raise rule_error(
            f"{format_value(value)} is not known; allowed none, or a mapping with kind online or "
            "instantaneous"
        )
    return value


class SessionFile(FileModel):
    """A session of the bench."""

    name: FolderName
    session: SessionKind
    """driveline: deflection, its trends, map over torque; velocity_constant: rad/s per V, brake
    taken off (`plant`); brake_map: torque over current, both branches; losses: of bearing and
    seal, and of the gearbox; torque_constant: N*m per A, each direction; torque_tracking: error
    of a torque; flap_hydrostatic: buoyant spring, angle of rest, inertia; flap_free_decay:
    natural period and damping; flap_rao: response amplitude operator; flap_pto_sweep: best
    damping and its power.
    """
    rig: str = Field(min_length=1)  # file, relative to this one
    plant: str | None = Field(default=None, min_length=1)  # replaces that of the rig
    calibrations: TupleOf[str] = Field(default=(), strict=False)  # take precedence over the rig's
    seed: WholeNumber = Field(default=1, ge=0, le=4_294_967_295)
    """Of the random phases and of a random order."""
    shaft: Literal["free", "clamped"] = "free"
    """Whether a clamp holds the shaft; the program does not sense it."""
    rows: TupleOf[SessionRow] | None = Field(default=None, min_length=1, strict=False)
    """List of rows; or give grid."""
    grid: TupleOf[SessionGrid] | None = Field(default=None, min_length=1, strict=False)
    """Rows as products of lists; or give rows."""
    irregular: IrregularReference | None = None  # in place of one period
    timing: SessionTiming
    correction: Annotated[
        Annotated[AnyCorrection, Field(discriminator="kind")], BeforeValidator(_expand_correction)
    ] = NoCorrection(kind="none")
    """Correction of the position for the twist of the driveline."""
    position_feedback_per_s: float = Field(default=0.0, ge=0, le=5)  # 0: the shaft may drift
    control: Literal["open loop", "closed loop"] = "open loop"
    """Whether the load cell closes the torque loop."""
    tare: TareOrNone = Tare()
    order: Literal["as given", "random"] = "as given"  # in which the rows are measured
    repeat: WholeNumber = Field(default=1, ge=1, le=1000)
    """Number of times that each row is measured."""

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the rows, and that the kind of session allows all given options."""
        requirements = SESSION_KINDS[self.session]
        if (self.rows is None) == (self.grid is None):
            given_keys = "nothing given" if self.rows is None else "rows and grid given"
            yield RuleViolation((), f"{given_keys}; allowed exactly one of rows, grid")
        for key, entries in (("rows", self.rows), ("grid", self.grid)):
            for i, entry in enumerate(entries or ()):
                given = entry.model_dump()
                yield from self._check_row(requirements, (key, i), set(given))
                yield from _check_flap(requirements, (key, i), given)
        if self.irregular is not None and not requirements.allows_irregular:
            message = f"a session {self.session} is regular; leave the key out"
            yield RuleViolation(("irregular",), message)
        if self.correction.kind != "none" and not requirements.allows_correction:
            message = f"a session {self.session} is not corrected; allowed none"
            yield RuleViolation(("correction",), message, self.correction.kind)
        if self.control == "closed loop" and not requirements.allows_feedback:
            message = f"a session {self.session} has no torque to follow; allowed open loop"
            yield self.violation("control", message)
        if self.shaft == "clamped" and requirements.loop == "velocity":
            yield self.violation("shaft", "the velocity loop turns the shaft; allowed free")
        if self.shaft == "clamped" and requirements.flap_coupling:
            yield self.violation("shaft", f"a session {self.session} moves the shaft; allowed free")
        if self.shaft == "free" and requirements.needs_clamp:
            yield self.violation("shaft", f"{FREE_SHAFT}; allowed clamped")
        highest = self.irregular.high_hz if self.irregular is not None else 0.0
        if requirements.needs_waves and highest > MAX_WAVE_HZ:
            message = f"{format_number(highest)} is too high for waves; allowed up to 2 Hz"
            yield RuleViolation(("irregular", "high_hz"), message, highest)
        if self.position_feedback_per_s > 0.0 and requirements.loop == "torque":
            message = "the torque loop has no position; leave the key out"
            yield self.violation("position_feedback_per_s", message)

    def _check_row(
        self, requirements: SessionRequirements, at: tuple[str, int], given: set[str]
    ) -> Iterator[RuleViolation]:
        """Check the columns of a row: all required ones, and no column without a use."""
        period = () if self.irregular is not None else ("period_s",)
        required = [requirements.amplitude_column, *period, *requirements.required_columns]
        for key in required:
            if key not in given:
                yield RuleViolation(
                    at, f"{key} missing; a session {self.session} needs it in every row"
                )
        for key in sorted(given - {*required, *requirements.optional_columns}):
            if key == "period_s":
                message = "an irregular reference repeats after irregular.repeat_s; leave it out"
            else:
                allowed = ", ".join((*required, *requirements.optional_columns))
                message = f"a session {self.session} has no use for it; allowed {allowed}"
            yield RuleViolation((*at, key), message)

    @property
    def tare_duration(self) -> float:
        """Duration of the tare, s; 0 if the file has `tare: none`."""
        return 0.0 if self.tare is None else self.tare.duration_s

    @property
    def loop(self) -> Literal["velocity", "torque"]:
        """The loop of the drive that is closed."""
        return SESSION_KINDS[self.session].loop
