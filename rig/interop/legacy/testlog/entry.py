"""Types of a test log: entries, their settings, and remarks on irregularities."""

from enum import StrEnum
from typing import NamedTuple


class WaveKind(StrEnum):
    """Kinds of waves."""

    CALM = "calm"
    REGULAR = "regular"
    JONSWAP = "jonswap"
    PINK = "pink"


class Activity(StrEnum):
    """The activity of the rig in a run."""

    GAIN_MATRIX = "gain matrix"
    GAINS = "gains"  # written in the entry itself
    MULTISINE = "multisine"
    SINE = "sine"
    CHIRP = "chirp"
    RAMPS = "ramps"
    SPRING_SWEEP = "spring sweep"
    BY_HAND = "by hand"


class Condition(StrEnum):
    """Condition of a run by the colour of its row, from the legend of the log."""

    PLAIN = "plain"
    UNUSUAL = "slightly unusual"
    NOT_UPLOADED = "not uploaded"
    WAVES_END_EARLY = "wave data end early"
    VERY_UNUSUAL = "very unusual"
    COMPROMISED = "minor error"
    SERIOUS = "serious error"
    UNKNOWN = "colour not in the legend"


class RemarkKind(StrEnum):
    """Kinds of irregularity."""

    RUN_ID_SPACES = "run ID with spaces"
    FILE_MISSING = "no file name"
    FILE_PARTIAL = "file name without its time"
    FILE_NO_NAME = "invalid file name"
    FILE_SHARED = "file shared with another run"
    FILE_ORDER = "file older than that of the run before"
    SERIES_MISSING = "waves without a wave series"
    SERIES_SEVERAL = "several wave series"
    SERIES_UNREADABLE = "wave series not readable"
    NO_WATER = "not in the water"
    HEIGHT_UNSPECIFIED = "height not marked as amplitude or Hs"
    HEIGHT_DISAGREES = "height in inches and metres disagree"
    WAVES_UNREADABLE = "waves not readable"
    WAVES_MIXED = "several kinds of waves"
    SEA_NOT_IN_TABLE = "sea not in the report's table"
    WAVE_UNCALIBRATED = "uncalibrated wave"
    RANGE_EMPTY = "range that MATLAB takes as empty"
    AMPLITUDE_UNKNOWN = "amplitude not known"
    SPRING_UNSPECIFIED = "spring mentioned without a rate"
    SPRING_SEVERAL = "several spring rates"
    SPRING_IN_NOTES = "spring rate in the notes"
    SPRING_CLOSE = "spring rate close to another"
    DRIVE_CARRIED = "drive known from another run only"
    SCHEME_IN_NOTES = "switching scheme in the notes"
    SCHEME_MISSPELT = "switching scheme misspelt"
    SCHEME_SEVERAL = "several switching schemes"
    SCHEME_UNSPECIFIED = "switching scheme not given"
    SURGE_MISSPELT = "surge drive misspelt"
    BY_HAND = "done by hand"
    BIAS = "sensor bias"
    SENSOR = "sensor missing or doubtful"
    TIME_SYNC = "time synchronisation"
    WAVE_MAKER = "wave maker"
    SUPPLY = "power supply switched"
    TRIPPED = "trip or failure"
    ROWS_DOUBTFUL = "rows doubtful"
    INCOMPLETE = "incomplete"
    COLOUR_UNKNOWN = "colour not in the legend"


class Remark(NamedTuple):
    """An irregularity: its kind, its cell, and a quotation from the log."""

    kind: RemarkKind
    cell: str  # such as A54
    text: str


class Cell(NamedTuple):
    """A cell of the log as text."""

    name: str  # such as A54
    text: str  # a number as text; empty for a blank cell

    def remark(self, kind: RemarkKind, text: str | None = None) -> Remark:
        """Return a remark on this cell that quotes ``text``, or all of the cell."""
        return Remark(kind, self.name, self.text.strip() if text is None else text)


class Wave(NamedTuple):
    """One sea. A regular sea has an amplitude, an irregular one Hs; never both."""

    kind: WaveKind
    amplitude_m: float | None = None
    hs_m: float | None = None
    frequency_hz: float | None = None  # peak frequency of an irregular sea
    period_s: float | None = None  # 1 / frequency_hz
    written: str = ""  # unit of the value in the log: Hz or s
    gamma: float | None = None
    repeat_s: float | None = None
    code: str = ""  # name of the wave file: 4A, PINKA (not amperes)


class Gain(NamedTuple):
    """Gains written in the entry itself, in house signs."""

    axis: str  # heave, surge
    name: str  # kp (N*s/m), ki (N/m)
    values: tuple[float, ...]  # empty if MATLAB evaluates the written range as empty
    cell: str


class Amplitude(NamedTuple):
    """Amplitude of the drive current of an open-loop test."""

    amperes: float
    waveform: str = ""  # phase realisation A, B, C; empty if not given


class Spring(NamedTuple):
    """Spring rate as written in the log; calibrations correct it."""

    written_n_per_m: float
    cell: str


class Bias(NamedTuple):
    """Action on the zero of a position sensor, and its time."""

    action: str  # corrected, attempted, zeroed, seen, lost
    when: str  # before, after (the run); empty if not given
    cell: str


class Entry(NamedTuple):
    """One run of the log."""

    run: int
    series_name: str  # series of the runs: MASK4
    row: int  # row of the sheet
    wave_series: tuple[int, ...]
    file: str  # name of the record; empty if the cell has none
    recorded: str  # ISO date and time from the file's name, recorder's clock
    file_text: str
    waves: tuple[Wave, ...]
    waves_text: str
    wavebot_text: str
    notes: str
    activities: tuple[Activity, ...]
    matrix: str  # name of the gain matrix
    gains: tuple[Gain, ...]
    spring: Spring | None
    stator_percent: tuple[float, ...]
    drive: str  # COTS, custom
    drive_source: str  # cell that names the drive, or `from the start`
    scheme: str  # SVPWM, SineTri, DPWM, Hyst
    surge: str  # enabled, disabled, by hand; empty if not given
    bus_voltage_v: float | None
    amplitudes: tuple[Amplitude, ...]
    order: tuple[Amplitude, ...]  # order of the tests within the run, if the notes give it
    biases: tuple[Bias, ...]
    condition: Condition
    remarks: tuple[Remark, ...]

    @property
    def name(self) -> str:
        """Run ID as in the log: MASK4_024."""
        return f"{self.series_name}_{self.run:03d}"


class Separator(NamedTuple):
    """A row between runs that notes a change of the setup."""

    row: int
    cell: str
    text: str
    before_run: int  # next run; 0 after the last
