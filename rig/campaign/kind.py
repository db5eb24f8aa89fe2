"""A campaign, its plan, and what a kind of rig adds to them.

`CampaignKind` is the type of the constant `CAMPAIGNS` of a kind's room `campaign`. It calls for
campaigns and plans, and a campaign contains it, so their types are in this module, too.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from datetime import date
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from pydantic import BaseModel

from rig.config.campaign_file import BaseCampaignFile
from rig.config.law_settings import AxisLaw
from rig.config.problems import Problem
from rig.config.rig_file import BaseRigFile
from rig.config.yaml_source import SourceMap
from rig.laws import Law
from rig.planning.elevation import Elevation
from rig.planning.input_files import ConfigSource, InputFile
from rig.planning.point import MAX_ROWS, Point
from rig.planning.points import count_points, matrix_points
from rig.planning.reference import ReferenceRecord
from rig.planning.windows import RowWindows, row_windows
from rig.realtime.sequence import WAIT_DRIVE, Segments
from rig.stations import Station

F = TypeVar("F", bound=BaseCampaignFile)
R = TypeVar("R", bound=BaseRigFile)
L = TypeVar("L", bound=BaseModel)
S = TypeVar("S")  # set point of a row
T = TypeVar("T")  # table of set points

# `Any` stands for the kind's own types: its models of campaign and rig file, and the set point of
# a row (`set_points.row_setting`).
File: TypeAlias = Any
Rig: TypeAlias = Any
Setting: TypeAlias = Any


class Wait(NamedTuple):
    """A wait for parts of the rig: before the lead-in, or before a row for which a part moves."""

    setting: Setting  # set point while the plan waits
    seconds: float  # least duration
    conditions: int  # `WAIT_...` of `rig.realtime.sequence`
    timeout: float  # s


def wait_for_drive(file: File, rig: Rig, setting: Setting) -> Wait:
    """Return the wait for the drive to be enabled."""
    return Wait(setting, 1.0 / rig.rate_hz, WAIT_DRIVE, rig.drive_enable_timeout_s)


def no_move(file: File, rig: Rig, before: Setting, after: Setting, least: float) -> Wait | None:
    """Return None: no part of the rig moves between two rows."""
    return None


def one_place(rig: Rig, points: Sequence[Point]) -> Sequence[float]:
    """Return the same place for every point: no part of the rig moves."""
    return [0.0] * len(points)


def points_of_matrix(file: File, rig: Rig | None, locate: SourceMap) -> tuple[Point, ...] | None:
    """Return the points of the matrix, in the order of the file; None if there are too many.

    Building millions of them would take long.
    """
    if file.matrix is None:
        return ()
    if count_points(file.matrix.grid, file.matrix.combinations) > MAX_ROWS:
        return None
    return matrix_points(file.matrix, locate, file.kind_columns, file.law_columns())


def windows_of_rows(file: File) -> RowWindows:
    """Return the windows of every row; WindowError if none fits."""
    return row_windows(file.sea, file.timing, file.reference)


def lead_in(file: File, first: Setting) -> list[tuple[float, Setting]]:
    """Return the lead-in with the set point of the first row."""
    return [(file.start.lead_in_s, first)]


class CampaignKind(NamedTuple):
    """The parts of campaigns that depend on the kind of rig.

    Parts without a default: `axes` returns the names of the axes of a rig file as read. `find_laws`
    returns the law of each axis and may complete the campaign's mapping from the rig's
    (`law_settings.inherit_law`); it raises `ConfigError` for a law that cannot be used. `model`
    returns the model of a campaign file with these laws on a rig file as read
    (`config.campaign_file.with_laws`). `gain_ramp` returns the duration of a gain ramp of an axis,
    s. `set_points` returns the loop's table of set points, by columns (`set_points.columns_of`).
    """

    rig_file: type[BaseRigFile]
    limits_file: type[BaseModel]
    campaign_file: type[BaseCampaignFile]  # without laws
    axes: Callable[[dict[str, Any]], Sequence[str]]
    find_laws: Callable[[ConfigSource, ConfigSource | None], dict[str, Law]]
    model: Callable[[dict[str, Law], dict[str, Any]], type[BaseCampaignFile]]
    gain_ramp: Callable[[Rig, str], float]
    set_points: Callable[[File, Rig, tuple[Setting, ...]], Any]
    defaults: Callable[[File, Rig], dict[str, float]] = lambda file, rig: {}
    """Values of columns that a matrix lacks; without: 0, the law's, and those of the reference."""
    points: Callable[[File, Rig | None, SourceMap], tuple[Point, ...] | None] = points_of_matrix
    """The points, or None for too many or without the rig; no points: a wave calibration."""
    point_problems: Callable[
        [File | None, Rig, tuple[Point, ...], SourceMap], Iterable[Problem]
    ] = lambda file, rig, points, locate: ()
    """Problems of points on a rig; the file is None if another key of it is invalid."""
    windows: Callable[[File], RowWindows] = windows_of_rows
    places: Callable[[Rig, Sequence[Point]], Sequence[float]] = one_place
    """Position, for each point, of the part that moves between rows (`planning.order`)."""
    lead_in: Callable[[File, Setting], Sequence[tuple[float, Setting]]] = lead_in
    """Durations (s) and set points of the lead-in, from the set point of the first row."""
    prepare: Callable[[File, Rig, Setting], Wait] = wait_for_drive
    """The wait before the lead-in, whose first set point is given."""
    move: Callable[[File, Rig, Setting, Setting, float], Wait | None] = no_move
    """The wait from a row's set point to the next one's, of at least so many s; None: no move."""
    last: Callable[[File, Setting], Setting] = lambda file, setting: setting
    """The set point at the end of the plan, from that of the last row."""
    validity_warnings: "Callable[[AnyCampaign, date], tuple[Problem, ...]]" = lambda _, day: ()
    """Warnings about calibrations that are not valid on a day (UTC)."""
    report_lines: "Callable[[AnyCampaign, AnyPlan], list[tuple[str, str]]]" = (
        lambda campaign, plan: []
    )
    """Further labels and texts of the report of a check."""
    earlier_limits: Callable[[dict[str, Any]], dict[str, Any]] = lambda recorded: recorded
    """Recorded limits, completed by those of checks that are newer than the run."""
    assessed_stations: Callable[[Rig], Sequence[Station]] = lambda rig: ()
    """The stations by whose power a row may end, in the order of `cycle.Kind.assessed`."""
    transients: Callable[[Any, Sequence[Any]], Sequence[float]] | None = None
    """The times (s) in which transients decay to 1 % of their amplitude in rows of a campaign,
    after a change of gains or the begin of the waves; infinite if unknown. None: no kind of row."""
    signals: Callable[[Rig], Collection[str]] = lambda rig: ()
    """The signals of the formulas of the power stations, which an uncertainty budget names."""
    swept_keys: tuple[str, ...] = ("sea", "law", "reference", "seed", "start", "timing", "tare")
    """Keys of the campaign file that may be swept."""


class Campaign(NamedTuple, Generic[F, R, L]):
    """A campaign whose files passed all checks that need no simulated plant."""

    kind: CampaignKind
    file: F
    locate: SourceMap  # of the campaign file
    rig: R
    rig_locate: SourceMap  # of the rig file
    limits: L
    plant: dict[str, Any]  # merged, not validated: sim_plant validates its own parameters
    plant_locate: SourceMap  # of the plant file
    points: tuple[Point, ...]  # empty for a wave calibration
    elevation: Elevation | None  # of a recorded sea
    record: ReferenceRecord | None  # of a recorded reference
    files: tuple[InputFile, ...]  # with the files that they extend
    seed: int  # one of those of the file; the others have seas, and plans, of their own

    @property
    def axis_laws(self) -> dict[str, AxisLaw]:
        """The law of each axis."""
        return dict(self.file.axis_laws)

    @property
    def sea_seed(self) -> int:
        """Seed of the sea's phases."""
        seed: int = self.file.sea_seed(self.seed)
        return seed

    def validity_warnings(self, day: date) -> tuple[Problem, ...]:
        """Return warnings about calibrations that are not valid on a day (UTC)."""
        return self.kind.validity_warnings(self, day)


AnyCampaign = Campaign[Any, Any, Any]
"""A campaign of any kind of rig."""


class CampaignRow(NamedTuple, Generic[S]):
    """One row of the plan: a point of the matrix, run once."""

    row: int  # from 0, in the order of the plan
    point: int  # from 0, in the order of the file
    repetition: int  # from 0
    seed: int  # of the sea
    place: float  # of the part that moves between rows, in the unit of its column
    setting: S
    periods: int  # wave or repeat periods measured; 0: not a whole number
    measure: float  # s, at most
    least_measure: float  # s


class PhaseSeconds(NamedTuple):
    """Planned duration of each phase, s."""

    tare: float
    lead_in: float
    moving: float
    settle: float
    measure: float
    tail: float


class Plan(NamedTuple, Generic[S, T]):
    """A campaign that `rig.realtime.sequence.step` can execute."""

    rows: tuple[CampaignRow[S], ...]
    segments: Segments
    setpoints: T
    dt: float  # s, length of a tick
    duration: float  # s, at most; waiting for parts of the rig may add to it
    wave_seconds: float  # s of the wave clock, planned
    moves: int  # of a part of the rig between rows
    phases: PhaseSeconds
    axis_laws: Mapping[str, AxisLaw]
    rig: Rig  # its file, for displays
    seed: int  # of the rows that the segments measure
    least_duration: float  # s, if all rows end as early as they may


AnyPlan = Plan[Any, Any]
"""The plan of a campaign of any kind of rig."""
