"""The rooms of a kind of rig: one protocol for each module of its package that the core uses.

A room is a module (or a package) of the kind's package; its protocol lists the names that the core
uses. `rig.kinds.registry.ROOMS` lists the rooms that every kind has. Optional are `commands`,
`exports`, `manual`, `campaign` for kinds with campaigns, and `simulation` for those that can be
swept (`rig.sweeps.simulator`).
"""

import asyncio
from collections.abc import Callable, Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from pydantic import BaseModel

from rig.analysis.run_products import DrawOptions, RunProducts, RunSummary
from rig.campaign.kind import CampaignKind
from rig.config.problems import Problem
from rig.config.rig_file import BaseRigFile
from rig.config.yaml_source import SourceMap
from rig.kinds.registry import Command
from rig.people.set_points import LiveColumns
from rig.processes.io_processes import IoProcess
from rig.processes.run_types import ExecutionMode, Outcome, RecordedTask, Task
from rig.realtime import cycle
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs import RunInfo

if TYPE_CHECKING:  # xarray and drivers of wires, which a check does not need
    from rig.emulation.devices import EmulatedDevices
    from rig.interop.tables import KindFormat
    from rig.wires.job import WiredJob

LogRow = dict[str, float | int]
"""A log row by dotted field names."""


class Tick(Protocol):
    """Room `tick`: what the loop executes. The loop process imports it, so it must stay light."""

    Sense: type
    """NamedTuple of all that a tick reads."""

    SENSE_IN_ROW: dict[str, str]
    """Fields of `Sense` that have another name in a row."""

    def find_kind(self, law: str) -> cycle.Kind:
        """Return the kind's cycle with a law (`rig.laws.from_request`); empty: its own law."""


class Config(Protocol):
    """Room `config`: the models of the kind's files."""

    RigFile: type[BaseRigFile]
    LimitsFile: type[BaseModel]


class NamedFile(Protocol):
    """A campaign or session file."""

    @property
    def name(self) -> str:
        """The name of campaign or session, and so of its runs."""


class Checked(Protocol):
    """A campaign or session whose files passed every check."""

    @property
    def file(self) -> NamedFile:
        """The file as its model."""

    @property
    def rig(self) -> BaseRigFile:
        """The rig file as its model."""


class CheckedPlan(Protocol):
    """The plan of a checked campaign or session."""

    @property
    def rows(self) -> Sequence[Any]:
        """The planned rows; empty for a run without any."""

    @property
    def duration(self) -> float:
        """Planned duration, s."""

    @property
    def dt(self) -> float:
        """Control period, s."""


class Report(Protocol):
    """The result of checking a campaign or session; without problems it holds both and a plan."""

    @property
    def problems(self) -> tuple[Problem, ...]:
        """The reasons why it cannot run."""

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Warnings about a campaign or session that can nevertheless run."""

    @property
    def ok(self) -> bool:
        """Whether it can run."""

    @property
    def checked(self) -> Checked | None:
        """The campaign or session; None with problems."""

    @property
    def plan(self) -> CheckedPlan | None:
        """Its plan; None with problems."""

    def text(self) -> str:
        """Return text for people: one problem a line, or the summary."""

    def to_json(self) -> str:
        """Return JSON for programs, with `ok` and `problems`."""


class Tasks(Protocol):
    """Room `tasks`: from the file of a campaign or session to the task that the loop executes."""

    TaskFile: type[BaseModel]
    """Model of the file; its keys tell the file's kind where its rig does not."""

    def examine(
        self, path: Path, rig: Path | None = None, *, day: date | None = None, predict: bool = True
    ) -> Report:
        """Check a file and all files that it refers to; never raises for the contents of a file.

        ``rig`` replaces the rig that the file names. ``day`` (UTC) is that of the run, for
        warnings of what is not valid on it. ``predict`` adds all that takes time: the simulated
        plant and predictions.
        """

    def execution_task(self, checked: Any, plan: Any) -> Task:
        """Return the task of a campaign or session."""

    def rehearsal_mode(self, checked: Any, *, real_clock: bool) -> ExecutionMode:
        """Return the mode with the simulated plant in the loop's own process."""

    def wired_mode(self, checked: Any, *, emulated: bool) -> ExecutionMode:
        """Return the mode with the devices on the rig's wires, or emulated ones at the far end.

        WiringError lists all reasons why these wires must not be powered.
        """


class Recorded(Protocol):
    """Room `recorded`: the task of a recorded run, for its replay."""

    def recorded_task(self, run: RunInfo) -> RecordedTask:
        """Return a run's campaign or session as a task.

        Raises KeyError if the record lacks a part, ValueError if a part is not valid today.
        """


class HardwareJob(Protocol):
    """Room `hardware.job`: the supervisor's side of a wired rig."""

    def build_job(self, rig: Any) -> "WiredJob":
        """Return I/O processes and device settings of a rig file with `wiring`.

        WiringError lists all reasons why these wires must not be powered.
        """


class Emulation(Protocol):
    """Room `rehearsal.emulation`: emulated devices at the far end of a rig's wires."""

    def emulate_rig(
        self, rig: Any, plant: dict[str, Any], locate_plant: SourceMap
    ) -> tuple[IoProcess, str]:
        """Return the emulated devices of a rig without a task, and their setting for people.

        ConfigError lists all problems of the plant.
        """

    def emulate_task(self, path: Path, rig: Path) -> tuple[BaseRigFile, IoProcess, str]:
        """Return the rig of a campaign or session run on a rig file, its devices, their setting."""

    def build_devices(
        self, rig: Any, config: dict[str, Any], loop: asyncio.AbstractEventLoop
    ) -> "EmulatedDevices":
        """Return the devices of the process with this configuration; none has started yet."""


class Display(Protocol):
    """Room `display`: texts for people, before and during a run.

    ``measured`` is the newest row in a measured window (`power.samples` > 0); empty before.

    A room may also have `log_fields(rig: RigFile) -> rig.log_fields.LogFields`, labels and limits
    of the log fields, which a run records for the page. Its texts should use the same labels.
    """

    def show_report(self, report: Any, *, every_row: bool) -> None:
        """Print the report of `rig check`; ``every_row``: not only the rows nearest to a limit."""

    def plan_position(self, plan: Any, row: LogRow) -> tuple[str, str]:
        """Return a label and the text of the position in the plan."""

    def detail_lines(self, plan: Any, row: LogRow, measured: LogRow) -> list[tuple[str, str]]:
        """Return labels and texts of the rig's motion, for the panel."""

    def short_text(self, plan: Any, row: LogRow, measured: LogRow) -> str:
        """Return a short text of the rig's motion, for a line."""

    def total_duration(self, plan: Any, row: LogRow) -> float:
        """Return the duration of the run, s, as far as the row shows it."""


class Products(Protocol):
    """Room `products`: what `rig run`, `rig show` and `rig plot` make of a run."""

    PROGRESS: str
    """Description of the work of `after_run`, for people who wait."""

    NO_PRODUCTS: RunProducts
    """Products of a run without a tick."""

    def after_run(self, folder: Path, outcome: Outcome) -> RunProducts:
        """Write all products of a finished run of at least one tick into its folder.

        It does not raise for a record that has no results; `RunProducts.trouble` states why.
        """

    def summarise(
        self, run: Path, calibrations: Sequence[CalibrationVersion], *, incomplete_rows: bool
    ) -> RunSummary:
        """Return the summary of a recorded run; ValueError or OSError if there is none."""

    def draw(self, run: Path, options: DrawOptions) -> list[Path]:
        """Write the products of a recorded run, or the selected picture; return their paths."""


class Campaigns(Protocol):
    """Room `campaign`, optional: campaigns of gain matrices."""

    CAMPAIGNS: CampaignKind
    """The kind's part of `rig.campaign`."""


class Manual(Protocol):
    """Room `manual`, optional: manual mode, and set points that people choose within a run."""

    def write_task(self, file: Path, path: Path, drive: str = "", *, clamped: bool = False) -> None:
        """Write the campaign or session for manual mode of a file, which is one, too, or a rig.

        Its rows are never run; its set point is the one to begin with. ``drive``: the loop of the
        drive that a person chose, `velocity` or `torque`; empty: none. ``clamped``: a person says
        that the shaft is clamped. Raises ConfigError with all reasons why there is no manual mode.
        """

    def live_columns(
        self,
        task: Task,
        checked: Any,
        plan: Any,
        file: Path,
        examine: Callable[[Path], Report],
        kept: Path,
    ) -> LiveColumns | None:
        """Return the set points of a run; None if it has no rows.

        ``file``: that of the task, in manual mode the one that a person named; ``examine``: as of
        `Tasks`; ``kept``: file of the rows that people keep. RefusedError with the reason why
        people choose none.
        """


class Commands(Protocol):
    """Room `commands`, optional: the kind's own commands. It must import nothing heavy."""

    COMMANDS: tuple[Command, ...]


class Exports(Protocol):
    """Room `exports`, optional: formats of `rig export` for the tools of one test."""

    FORMATS: "dict[str, KindFormat]"
    """The formats by name (`--as`)."""


PROTOCOLS = {
    "tick": Tick,
    "config": Config,
    "recorded": Recorded,
    "hardware.job": HardwareJob,
    "rehearsal.emulation": Emulation,
    "tasks": Tasks,
    "display": Display,
    "products": Products,
}
"""The protocol of each room that every kind has."""
