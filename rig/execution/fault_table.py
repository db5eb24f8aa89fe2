"""Tables of faults: the faults of a rig's emulated devices, and the required reaction to each."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Literal, NamedTuple

from pydantic import Field

from rig.config.model import FileModel, RuleViolation, TupleOf
from rig.config.problems import ConfigError, Problem
from rig.config.pydantic_errors import load
from rig.config.yaml_source import SourceMap
from rig.kinds.registry import RigKind
from rig.kinds.rig_file import kind_of_task
from rig.realtime.reasons import ReasonTable

REFUSED, GOES_ON, UNDETECTED = "refused at start", "goes on", "not detected"
LOOP_LOST = "loop lost"
START, MOTION = "start", "motion"  # otherwise the fault is injected while the law acts
_ONSET_LABELS = {"": "", START: " from the start", MOTION: " in motion"}
NO_STOP = (REFUSED, GOES_ON, UNDETECTED)  # without a category, and without a time


class FaultEntry(FileModel):
    """One fault of one device or link, as the file has it."""

    fault: str = Field(min_length=1)  # of those of the emulated device
    expected: str = Field(alias="must", min_length=1)
    """A reason of a stop, `refused at start`, `goes on` (correctly), `not detected` (it goes on,
    and should not), or `loop lost`."""
    alternatives: TupleOf[str] = Field(default=(), alias="and")
    """Other correct reactions: which one comes first is chance."""
    category: Literal[0, 1] | None = None  # of the stop (IEC 60204-1); none without one
    max_seconds: float = Field(default=0.0, alias="within_s", ge=0, le=60)
    """Longest time from the fault until no motor has power, s; 0 where the run does not stop."""
    explanation: str = Field(default="", alias="why")
    """Reason for the reaction; required if the run goes on."""
    value: float | None = None  # magnitude of the fault; none: its default
    toward: Literal["host", "device"] | None = None  # direction of a link's fault; none: both
    onset: Literal["", "start", "motion"] = Field(default="", alias="from")
    """`start`: before the run; `motion`: while the motors move; none: while the law acts."""
    short: bool = False
    """Part of the short selection, which `rig faults` rehearses without options."""
    long_run: bool = Field(default=False, alias="long")
    """In a run of `long_task`, for checks that average over a long time."""

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that category, time and explanation fit the reaction."""
        if self.expected in NO_STOP:
            if self.category is not None or self.max_seconds:
                yield RuleViolation(
                    ("must",), "has no category and no time within_s", self.expected
                )
            if self.expected != REFUSED and not self.explanation:
                yield RuleViolation(("must",), "needs an explanation (why)", self.expected)
            return
        if self.max_seconds <= 0.0:
            yield RuleViolation(("must",), "needs a time within_s above 0 s", self.expected)
        if self.expected == LOOP_LOST and self.category is not None:
            yield RuleViolation(("category",), f"{LOOP_LOST} has none", self.category)


class Motion(FileModel):
    """The condition of faults `from: motion`: the magnitude of a log field."""

    field: str = Field(min_length=1)  # of the log
    above: float = Field(gt=0)  # in the unit of the field


class FaultTableFile(FileModel):
    """A table of faults, with the task in whose runs they are injected."""

    task: str = Field(min_length=1)  # campaign or session of some seconds, relative to this file
    long_task: str | None = Field(default=None, min_length=1)  # for rows with `long`
    motion: Motion | None = None  # for rows with `from: motion`
    faults: dict[str, TupleOf[FaultEntry]] = Field(min_length=1)
    """By emulated device, link, or process (`process loop`)."""

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that no row occurs twice, and that each has the task or condition it needs."""
        names = set()
        for device, entries in self.faults.items():
            for i, entry in enumerate(entries):
                key = ("faults", device, i)
                name = _row(device, entry).name
                if name in names:
                    yield RuleViolation((*key, "fault"), "occurs twice", entry.fault)
                names.add(name)
                if entry.onset == MOTION and self.motion is None:
                    yield RuleViolation((*key, "from"), "needs the key motion of the table", MOTION)
                if entry.long_run and self.long_task is None:
                    yield RuleViolation((*key, "long"), "needs the key long_task of the table")


class FaultRow(NamedTuple):
    """One fault of one device or link, with the fields of `FaultEntry`."""

    device: str  # name at the emulated devices
    fault: str
    expected: str
    category: int | None = None
    max_seconds: float = 0.0
    explanation: str = ""
    value: float | None = None
    toward: str | None = None
    onset: str = ""
    short: bool = False
    long_run: bool = False
    alternatives: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Return the name of the row: device, fault, value, onset."""
        name = f"{self.device}: {self.fault}"
        name += f" {self.value:g}" if self.value is not None else ""
        return name + _ONSET_LABELS[self.onset]

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Return the correct verdicts; GOES_ON and UNDETECTED look the same in a run."""
        expected = (self.expected, *self.alternatives)
        return tuple(GOES_ON if verdict == UNDETECTED else verdict for verdict in expected)


class FaultTable(NamedTuple):
    """A checked table of faults."""

    path: Path
    kind: RigKind  # of the rig of its task
    task: Path
    long_task: Path  # the task itself without a longer one
    motion: Motion | None
    rows: tuple[FaultRow, ...]
    locate: SourceMap
    problems: tuple[Problem, ...] = ()  # of its reactions

    @property
    def name(self) -> str:
        """The name of the file."""
        return self.path.stem

    def selection(self, texts: Iterable[str] = (), *, every: bool = False) -> list[FaultRow]:
        """Return the rows with any of the texts in their names; without texts the short selection.

        ``every``, or a table without a short selection: all rows. ValueError if no row has a text.
        """
        found = list(self.rows)
        if texts := tuple(texts):
            absent = [text for text in texts if not any(text in row.name for row in found)]
            if absent:
                raise ValueError(f"no row of {self.path} has {' or '.join(absent)} in its name")
            return [row for row in found if any(text in row.name for text in texts)]
        short = [row for row in found if row.short]
        return found if every or not short else short


def load_table(path: Path, rig: Path | None = None) -> FaultTable:
    """Return a table of faults; ``rig`` replaces the rig that its task names.

    Raises `ConfigError` with every problem of the table, or of the files that it needs. Devices,
    faults and their values are unchecked (`rig.execution.fault_check`).
    """
    table = read_table(path, rig)
    if table.problems:
        raise ConfigError(table.problems)
    return table


def read_table(path: Path, rig: Path | None = None) -> FaultTable:
    """Return a table of faults as `load_table` does; its field has the problems of reactions."""
    file, locate = load(path, FaultTableFile)
    task = locate.existing_path(("task",), file.task)
    long_task = task
    if file.long_task is not None:
        long_task = locate.existing_path(("long_task",), file.long_task)
    kind = kind_of_task(task, rig)
    reasons: ReasonTable = kind.room("tick").find_kind("").reason_table
    problems = tuple(_reason_problems(file, locate, reasons))
    rows = [_row(device, entry) for device, entries in file.faults.items() for entry in entries]
    return FaultTable(path, kind, task, long_task, file.motion, tuple(rows), locate, problems)


def _row(device: str, entry: FaultEntry) -> FaultRow:
    return FaultRow(device=device, **dict(entry))


def _reason_problems(
    file: FaultTableFile, locate: SourceMap, reasons: ReasonTable
) -> Iterator[Problem]:
    """Yield the rows whose reactions are no reasons of the kind of rig, or of another category."""
    category = {reason.name: reason.category for reason in reasons.reasons}
    others = (*NO_STOP, LOOP_LOST)
    for device, entries in file.faults.items():
        for i, entry in enumerate(entries):
            key = ("faults", device, i)
            for name, reaction in (
                ("must", entry.expected),
                *(("and", each) for each in entry.alternatives),
            ):
                if reaction not in category and reaction not in others:
                    allowed = ", ".join((*sorted(category), *others))
                    message = f"is not a reaction of this kind of rig; allowed {allowed}"
                    yield locate.problem((*key, name), reaction, message)
            needed = category.get(entry.expected, entry.category)
            if entry.category != needed:
                message = f"{entry.expected} is a stop of category {needed}"
                yield locate.problem((*key, "category"), entry.category, message)


def missing_rows(table: Iterable[FaultRow], available: Mapping[str, Iterable[str]]) -> list[str]:
    """Return the faults without a row; ``available``: the faults that exist, by device."""
    listed = {(row.device, row.fault) for row in table}
    return [
        f"{device}: {fault}"
        for device, faults in sorted(available.items())
        for fault in sorted(faults)
        if (device, fault) not in listed
    ]
