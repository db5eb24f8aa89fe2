"""Sessions as the tasks of a sweep: a case is a whole session, simulated and analysed."""

from collections.abc import Callable, Mapping, Sequence
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.analysis.rows import COMPLETE
from rig.config.problems import Problem
from rig.config.yaml_source import KeyPath
from rig.planning.input_files import InputFile, MappingLoader
from rig.presentation.phrases import unit_text
from rig.sweeps.simulator import SessionSimulation, SessionSimulator
from rig.sweeps.task import (
    ALL_ROWS,
    SimulatedCase,
    SweepParameter,
    TableContents,
    file_entries,
    result_names,
)

if TYPE_CHECKING:
    import xarray

_ROW = 0  # number of the only entry of a session in the table


class SessionTask:
    """A session with one value of every parameter."""

    rows, case_rows = (_ROW,), (ALL_ROWS,)
    data: tuple[InputFile, ...] = ()  # a session has text files only, which are read once

    def __init__(self, session: Any, simulation: SessionSimulation) -> None:
        self.session, self.simulation = session, simulation
        self.name, self.plant = str(session.file.name), session.plant

    def plant_unit(self, path: KeyPath) -> str:
        """Return an empty text: the plant file of a bench has the unit of each number."""
        return ""

    @property
    def inputs(self) -> list[tuple[str, str]]:
        """All files."""
        return [(file.role, file.sha256) for file in self.session.files]

    @cached_property
    def simulator(self) -> SessionSimulator:
        """The compiled loop with the plant."""
        return self.simulation.open_simulator(self.session)

    def run(self, row: int, base: "SessionTask", check: Callable[[], None]) -> SimulatedCase:
        """Return the results of the session."""
        results, seconds = self.simulator.results(check)
        return SimulatedCase(({**results, "row": _ROW},), seconds)

    def validity_warnings(self, day: date) -> tuple[Problem, ...]:
        """Return no warning: constants of a bench do not expire."""
        return ()


class SessionTasks:
    """The sessions of a kind of rig."""

    noun, result_noun = "session", "cases"
    fixed_keys: Mapping[str, str] = {}

    def __init__(self, simulation: SessionSimulation) -> None:
        self._simulation = simulation
        self.keys = simulation.SESSION_KEYS

    def open(self, path: Path, load: MappingLoader) -> SessionTask:
        """Return a session, checked with its simulated plant."""
        return SessionTask(self._simulation.open_session(path, load), self._simulation)

    def option_problems(self, given: Sequence[str]) -> list[Problem]:
        """Return a problem for each option, as all are for rows of campaigns."""
        message = "a session runs all its rows in sequence, with its own times; leave it out"
        return [Problem(option, 1, "", None, message) for option in given]

    def check(self, task: SessionTask, parameters: Sequence[SweepParameter]) -> None:
        """Raise nothing: every valid session can be simulated."""

    def contents(self, task: SessionTask) -> TableContents:
        """Return the session's settings."""
        attributes = {"config": self._simulation.resolved_session(task.session)}
        return TableContents(file_entries(task.session.file, self.keys), {}, {}, {}, attributes)

    def write_pictures(
        self, table: "xarray.Dataset", folder: Path, measured: Path | None
    ) -> list[Path]:
        """Write the results over each parameter."""
        from rig.sweeps.session_pictures import write_pictures  # noqa: PLC0415  (half a second)

        return write_pictures(table, folder)

    def summary(self, table: "xarray.Dataset") -> dict[str, Any]:
        """Return unit, least and largest value of each result in complete cases."""
        results = {}
        for name in result_names(table):
            values = table[name].where(table["state"] == COMPLETE).values
            if np.isfinite(values).any():
                low, high = float(np.nanmin(values)), float(np.nanmax(values))
                unit = table[name].attrs.get("units", "")
                results[name] = {"unit": unit, "least": low, "largest": high}
        return {"results": results}

    def summary_lines(self, summary: Mapping[str, Any], task: SessionTask) -> list[str]:
        """Return a line for each result."""
        results = summary["results"]
        width = max(map(len, results), default=0)
        lines = [f"Results of complete cases{'' if results else ': none'}"]
        for name, each in results.items():
            span = " .. ".join(dict.fromkeys(f"{each[key]:.6g}" for key in ("least", "largest")))
            lines.append(f"  {name:<{width}}  {span} {unit_text(each['unit'])}".rstrip())
        return lines
