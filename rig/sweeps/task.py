"""Interface of sweeps to the tasks that they simulate: campaigns, and sessions of a bench."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from pydantic import BaseModel

from rig.config.problems import Problem
from rig.config.yaml_source import KeyPath
from rig.planning.input_files import InputFile, MappingLoader
from rig.sweeps.simulator import Simulator

if TYPE_CHECKING:
    import xarray

ALL_ROWS = -1
"""The row of a case that runs all rows in sequence."""
FAILED = "failed"
"""State of the rows of a case that could not be run."""
UNCERTAINTY = "_uncertainty"
"""Ending of the name of a result's uncertainty: the half width of its 95 % interval."""


def file_entries(file: BaseModel, keys: Iterable[str]) -> dict[str, Any]:
    """Return the values at some keys of a task's file by their full keys; lists by entry."""
    contents = file.model_dump(mode="json", by_alias=True)

    def leaves(key: str, value: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(value, dict | list):
            for name, each in value.items() if isinstance(value, dict) else enumerate(value):
                yield from leaves(f"{key}.{name}", each)
        elif value is not None:
            yield key, value

    return dict(each for key in keys for each in leaves(key, contents.get(key)))


def result_names(table: "xarray.Dataset") -> list[str]:
    """Return the names of the results that have an uncertainty, known or not."""
    names = map(str, table.data_vars)
    return [name for name in names if f"{name}{UNCERTAINTY}" in table]


class SweepParameter(NamedTuple):
    """One parameter of a sweep and its values."""

    number: int  # of the option on the command line, from 1
    key: str  # as on the command line
    file: str  # that of the task by its noun, or rig, limits, plant
    path: tuple[str | int, ...]  # in that file
    values: tuple[Any, ...]  # numbers or text


class SimulatedCase(NamedTuple):
    """The results of a case."""

    rows: tuple[dict[str, Any], ...]  # results by name, with the number of the `row`
    seconds: float  # simulated


class TableContents(NamedTuple):
    """The inputs of a sweep's dataset, and the units of its results."""

    settings: dict[str, Any]  # of the task's file, for all cases
    row_settings: dict[str, Sequence[Any]]  # for each row
    planned: dict[str, Sequence[float]]  # results that are inputs unless a parameter changes them
    units: dict[str, str]  # of results, by name
    attributes: dict[str, Any]


class SweepTask(Protocol):
    """A campaign or session with one value of every parameter; its files passed all checks."""

    @property
    def name(self) -> str:
        """The name of campaign or session."""

    @property
    def plant(self) -> Mapping[str, Any]:
        """The plant file as read, with the units of its values."""

    def plant_unit(self, path: KeyPath) -> str:
        """Return the unit of a plain number of the plant file; empty if it has none."""

    @property
    def rows(self) -> Sequence[int]:
        """The numbers of the rows that have results."""

    @property
    def case_rows(self) -> Sequence[int]:
        """The numbers of the rows that are cases of their own, or `ALL_ROWS` alone."""

    @property
    def data(self) -> Sequence[InputFile]:
        """The files that are read whenever the task is opened, and must not change."""

    @property
    def inputs(self) -> Sequence[tuple[str, str]]:
        """Role or name and sha256 of everything that the results depend on, besides the code."""

    @property
    def simulator(self) -> Simulator:
        """The compiled loop with the plant."""

    def run(self, row: int, base: Any, check: Callable[[], None]) -> SimulatedCase:
        """Return the results of a case.

        ``base`` is the task without parameter values, whose plan numbers the rows. ``check`` is
        called many times per second; an exception of it ends the simulation.
        """

    def validity_warnings(self, day: date) -> tuple[Problem, ...]:
        """Return warnings about calibrations that are not valid on a day (UTC)."""


class TaskType(Protocol):
    """The type of a task: how a sweep opens it, and what it makes of its results."""

    noun: str
    """The word for a task: campaign, session."""
    result_noun: str
    """The word for its results: rows, cases."""
    keys: tuple[str, ...]
    """Keys of its file that may be swept."""
    fixed_keys: Mapping[str, str]
    """Reasons why other keys may not."""

    def open(self, path: Path, load: MappingLoader) -> Any:
        """Return the `SweepTask` of a file; ``load`` reads the files and may change their values.

        Raises `ConfigError` with every problem.
        """

    def option_problems(self, given: Sequence[str]) -> list[Problem]:
        """Return a problem for each of the given options that has no meaning for the task."""

    def check(self, task: Any, parameters: Sequence[SweepParameter]) -> None:
        """Raise `ConfigError` if a task cannot be simulated, or not with these parameters."""

    def contents(self, task: Any) -> TableContents:
        """Return the contents of the dataset of a sweep of a task."""

    def write_pictures(
        self, table: "xarray.Dataset", folder: Path, measured: Path | None
    ) -> list[Path]:
        """Write all figures of a result and return their paths; ``measured``: a run to compare."""

    def summary(self, table: "xarray.Dataset") -> dict[str, Any]:
        """Return the results for programs, as JSON values."""

    def summary_lines(self, summary: Mapping[str, Any], task: Any) -> list[str]:
        """Return a summary as lines for people."""
