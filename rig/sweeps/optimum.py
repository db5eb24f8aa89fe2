"""The best set points of a campaign on its simulated plant, for each power station.

Rows are simulated as those of a sweep: alone, after a lead-in. The search starts from the best row
of the campaign's matrix and goes on by quadratics around the best point (`rig.design.descent`),
over the columns of the laws that the matrix varies, within the ranges of these columns.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from controllers.law import Column as LawColumn
from rig.analysis.rows import COMPLETE
from rig.campaign.simulated_rows import FLAGS
from rig.config.problems import ConfigError
from rig.config.yaml_source import load_mapping
from rig.design.descent import descend
from rig.planning.point import Point
from rig.spectra.periods import Floats
from rig.stations import Station
from rig.sweeps.campaigns import CampaignTask, CampaignTasks

MAX_POINTS = 400  # of the matrix: more take minutes, and the search needs a start only
ITERATIONS = 6  # of the search
PENALTY = 2.0  # times the largest power: cost of a row that cannot be the best
AT_LIMIT = 1e-3  # of the range
FAR = 1.5  # spans of the matrix from the best row of it
MAX_COLUMNS = 5  # each doubles the rows of an iteration
NEAR = 0.15  # of the range of the matrix: distance of the rows around the best one


class Optimum(NamedTuple):
    """The best set point for a station, and the results of its row."""

    station: Station
    values: dict[str, float]  # of the columns searched, by name
    row: dict[str, Any]  # as in the row table
    at_limit: tuple[str, ...]  # columns whose range ends the search
    far: tuple[str, ...]  # columns in which it ended far from the matrix: it may go on

    @property
    def power(self) -> float:
        """Mean power, W; absorbed is negative."""
        return float(self.row[f"power_{self.station.name}"])


class Search:
    """The rows of a campaign as a function of the columns that its matrix varies."""

    def __init__(self, task: CampaignTask, jobs: int) -> None:
        """Raise ValueError for a matrix that varies no column of a law, too many, or others."""
        campaign = task.campaign
        self.task, self._jobs = task, jobs
        self._base = campaign.points[0]
        varied = {
            name
            for name in self._base.values
            if len({point.values[name] for point in campaign.points}) > 1
        }
        self.columns: tuple[LawColumn, ...] = tuple(
            column for column in campaign.file.law_columns() if column.name in varied
        )
        if not self.columns:
            known = ", ".join(column.key for column in campaign.file.law_columns())
            raise ValueError(
                f"{task.name}: the matrix varies no column of a law; give two values or more of "
                f"{known}"
            )
        if len(self.columns) > MAX_COLUMNS:
            raise ValueError(
                f"{task.name}: the matrix varies {len(self.columns)} columns of laws; allowed "
                f"{MAX_COLUMNS}"
            )
        searched = {column.name for column in self.columns}
        others = [c.key for c in campaign.file.columns() if c.name in varied - searched]
        if others:
            raise ValueError(
                f"{task.name}: the matrix varies {', '.join(others)}, which the search would fix; "
                "give one value of each"
            )
        self.values = np.array(
            [[point.values[column.name] for column in self.columns] for point in campaign.points]
        )
        self.low = np.array([column.low for column in self.columns])
        self.high = np.array([column.high for column in self.columns])
        self.span = self.values.max(axis=0) - self.values.min(axis=0)
        self.rows: dict[tuple[float, ...], dict[str, Any]] = {}

    def simulate(self, points: Floats, progress: Callable[[int], None]) -> list[dict[str, Any]]:
        """Return the row of each point (points, columns); none is simulated twice."""
        keys = [tuple(float(value) for value in point) for point in points]
        new = [key for key in dict.fromkeys(keys) if key not in self.rows]
        with ThreadPoolExecutor(self._jobs) as pool:
            for key, row in zip(new, pool.map(self._row, new), strict=True):
                self.rows[key] = row
                progress(len(self.rows))
        return [self.rows[key] for key in keys]

    def _row(self, key: tuple[float, ...]) -> dict[str, Any]:
        changed = {column.name: value for column, value in zip(self.columns, key, strict=True)}
        point = Point(self._base.values | changed, self._base.locations)
        (row,) = self.task.run_point(point, lambda: None).rows
        return row

    def optimum(self, station: Station, progress: Callable[[int], None]) -> Optimum:
        """Return the best set point for a station; ValueError if no row can be."""
        name = f"power_{station.name}"

        def costs(points: Floats) -> Floats:
            rows = self.simulate(points, progress)
            powers = np.array([_power(row, name) for row in rows])
            known = [abs(_power(row, name)) for row in self.rows.values()]
            largest = max(power for power in known if np.isfinite(power))
            return np.where(np.isfinite(powers), powers, PENALTY * largest + 1.0)

        known = [key for key, row in self.rows.items() if np.isfinite(_power(row, name))]
        if not known:
            reasons = {rejection(row) for row in self.rows.values()}
            raise ValueError(f"no row can be the best: {', '.join(sorted(reasons))}")
        first = min(known, key=lambda key: _power(self.rows[key], name))
        found = descend(
            costs,
            np.array(first),
            0.5 * self.span,
            ITERATIONS,
            lambda point: np.clip(point, self.low, self.high),
        )
        best = min([first, tuple(map(float, found))], key=lambda key: _power(self.rows[key], name))
        reach = AT_LIMIT * (self.high - self.low)
        limits = (np.array(best) - self.low < reach) | (self.high - np.array(best) < reach)
        far = np.abs(np.array(best) - np.array(first)) > FAR * self.span
        return Optimum(
            station,
            dict(zip((column.name for column in self.columns), best, strict=True)),
            self.rows[best],
            tuple(c.key for c, at in zip(self.columns, limits, strict=True) if at),
            tuple(c.key for c, each in zip(self.columns, far & ~limits, strict=True) if each),
        )

    @property
    def rejected(self) -> dict[str, int]:
        """The number of simulated rows that cannot be the best, by reason."""
        return dict(Counter(filter(None, map(rejection, self.rows.values()))))

    def around(self, best: Sequence[float]) -> Floats:
        """Return the best point and one to either side in each column, within the ranges."""
        centre = np.array(best)
        steps = NEAR * np.diag(self.span)
        points = np.concatenate([[centre], centre + steps, centre - steps])
        return np.unique(np.clip(points, self.low, self.high), axis=0)


def rejection(row: dict[str, Any]) -> str:
    """Return why a row cannot be the best one; empty if it can."""
    if str(row["state"]) != COMPLETE:
        return str(row["incomplete_reason"])
    return ", ".join(FLAGS[flag] for flag in row["flags"].split())


def _power(row: dict[str, Any], name: str) -> float:
    return float(row[name]) if not rejection(row) and row.get(name) is not None else np.inf


def open_search(tasks: CampaignTasks, path: Path, jobs: int) -> Search:
    """Return the search of a campaign; ConfigError or ValueError if it cannot be simulated.

    ``tasks`` have rows that run alone.
    """
    task = tasks.open(path, load_mapping)
    tasks.check(task, ())
    if len(task.campaign.points) > MAX_POINTS:
        message = f"{len(task.campaign.points)} points; the search takes up to {MAX_POINTS}"
        raise ConfigError([task.campaign.locate.problem(("matrix",), None, message)])
    return Search(task, jobs)


def search(
    opened: Search, stations: Sequence[Station], progress: Callable[[int], None]
) -> list[Optimum]:
    """Return the optimum of each station, the rows of the matrix first."""
    opened.simulate(opened.values, progress)
    return [opened.optimum(station, progress) for station in stations]
