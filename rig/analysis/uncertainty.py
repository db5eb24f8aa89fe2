"""Uncertainty of the mean powers of rows: Type B from a budget, combined with the scatter (Type A).

The mean power of a row depends on the scale and the offset of each signal in its station's formula;
the derivatives of the mean over the ticks of the window give its sensitivities, exactly, because a
formula has products of at most two equal signals. The GUM's law of propagation (JCGM 100:2008,
5.1.2) then gives the contribution of each source of the budget, and the covariance of two stations
from the sources that they share. The interval of 95 % is that of their drawn sum (JCGM 101:2008).
ITTC 7.5-02-07-03.12 and IEC TS 62600-103 ask for this combination in tests of wave energy devices.
"""

import ast
import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.analysis.compared_rows import BATCHES
from rig.config.uncertainty import UncertaintyBudget
from rig.recording.runs.folder import RunInfo
from rig.stations import Station

Floats = NDArray[np.float64]
COVERAGE = 0.95
_OPERATIONS: dict[type, Callable[..., Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply,
    ast.UAdd: np.positive, ast.USub: np.negative,
}  # fmt: skip


class Signals(NamedTuple):
    """The signals of the formulas as log fields."""

    fields: Mapping[str, tuple[str, ...]]  # by signal: a field, and fields that are subtracted

    def values(self, data: Any) -> dict[str, Floats]:
        """Return the signals in the ticks of a window."""
        found = {}
        for name, (first, *subtracted) in self.fields.items():
            values = np.asarray(data[first], np.float64)
            for each in subtracted:
                values = values - data[each]
            found[name] = values
        return found


class Budget(NamedTuple):
    """A budget for the stations of a run."""

    budget: UncertaintyBudget
    stations: tuple[Station, ...]
    signals: Signals

    @property
    def log_fields(self) -> tuple[str, ...]:
        """The log fields that `contributions` needs."""
        return tuple(dict.fromkeys(f for each in self.signals.fields.values() for f in each))

    def contributions(self, data: Any) -> Floats:
        """Return the standard uncertainty of the mean power of a window from each source (W).

        One row a station, one column a source; the sign is that of the sensitivity, so sources
        that stations share give their covariance.
        """
        values = self.signals.values(data)
        found = np.zeros((len(self.stations), len(self.budget.sources)))
        for i, station in enumerate(self.stations):
            tree = ast.parse(station.formula, mode="eval").body
            used = [name for name in values if station.uses(name)]
            by_signal = {name: _sensitivities(tree, values, name) for name in used}
            for j, source in enumerate(self.budget.sources):
                for name in source.signals:
                    scale, offset = by_signal.get(name, (0.0, 0.0))
                    found[i, j] += scale * source.standard_scale + offset * source.standard_offset
        return found

    def describe(self, rows: Sequence[dict[str, Any]], shares: Mapping[int, Floats]) -> str:
        """Return JSON with the sources, and their contributions to the best row of each station.

        ``rows``: complete ones of a row table. ``correlation`` is that of the Type B errors of the
        stations in that row.
        """
        best = {}
        for station in self.stations if rows else ():
            name = f"power_{station.name}"
            number = min(rows, key=lambda row: float(row[name]))["row"]
            found = shares[number]
            covariance = found @ found.T
            scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
            correlation = np.divide(covariance, scale, out=np.eye(len(found)), where=scale > 0.0)
            best[station.name] = {
                "row": number,
                "contributions_w": found[self.stations.index(station)].tolist(),
                "correlation": correlation.tolist(),
            }
        return json.dumps(
            {
                "name": self.budget.name,
                "sources": [source.name for source in self.budget.sources],
                "stations": [station.name for station in self.stations],
                "labels": {station.name: station.short_label for station in self.stations},
                "best": best,
            }
        )


def budget_of(run_facts: RunInfo, available: Sequence[str]) -> Budget | None:
    """Return the budget in the configuration of a run; None without one, or without its signals.

    ``available``: log fields of the run.
    """
    rig = run_facts.config.get("rig")
    record = rig.get("uncertainty") if isinstance(rig, dict) else None
    fields = run_facts.row_contents.signals
    if record is None or not fields:
        return None
    budget = UncertaintyBudget.model_validate(record)
    names = {name for source in budget.sources for name in source.signals}
    needed = {
        name: parts
        for name, parts in fields.items()
        if any(station.uses(name) for station in run_facts.stations)
    }
    stations = tuple(
        station
        for station in run_facts.stations
        if all(set(needed[n]) <= set(available) for n in needed if station.uses(n))
    )
    if not stations or not names & needed.keys():
        return None
    return Budget(budget, stations, Signals(needed))


def _sensitivities(tree: ast.expr, values: Mapping[str, Floats], name: str) -> tuple[float, float]:
    """Return the derivatives of a mean power by the relative scale and the offset of a signal.

    Central differences, which are exact for a polynomial of second order.
    """
    signal, half = values[name], 0.5

    def mean(changed: Floats) -> float:
        return float(np.mean(_evaluate(tree, {**values, name: changed})))

    scale = mean((1.0 + half) * signal) - mean((1.0 - half) * signal)
    offset = mean(signal + half) - mean(signal - half)
    return scale, offset


def _evaluate(node: ast.expr, values: Mapping[str, Floats]) -> Any:
    """Return the value of a formula; ValueError for what `rig.realtime.power` does not allow."""
    match node:
        case ast.Constant(float(number)):
            return number
        case ast.Name(name) if name in values:
            return values[name]
        case ast.BinOp(left, operator, right) if type(operator) in _OPERATIONS:
            return _OPERATIONS[type(operator)](_evaluate(left, values), _evaluate(right, values))
        case ast.UnaryOp(operator, operand) if type(operator) in _OPERATIONS:
            return _OPERATIONS[type(operator)](_evaluate(operand, values))
    raise ValueError(f"{ast.unparse(node)}: no formula of a power station")


UNCERTAIN = ("type_b", "u", "expanded")
"""Ends of the names of the columns of a row table with the uncertainty of a power, W: standard
uncertainty of Type B; combined with the scatter; half width of the 95 % interval."""
BUDGET_ATTRIBUTE = "uncertainty_budget"
"""Attribute of a row table: JSON of `Budget.describe`."""


def type_b(budget: Budget, contributions: Floats) -> dict[str, float]:
    """Return the columns of a row with its uncertainties of Type B; the others are NaN as yet."""
    found: dict[str, float] = {}
    for station, row in zip(budget.stations, contributions, strict=True):
        values = float(np.sqrt(np.sum(row * row))), np.nan, np.nan
        names = (f"power_{station.name}_{part}" for part in UNCERTAIN)
        found |= dict(zip(names, values, strict=True))
    return found


def add_expanded(
    budget: Budget, rows: Sequence[dict[str, Any]], shares: Mapping[int, Floats]
) -> None:
    """Fill the combined and the expanded uncertainty of complete rows of a table.

    ``shares``: `Budget.contributions` by row. Both stay NaN for a row without a standard error.
    """
    drawn = _Draws(budget.budget)
    for row in rows:
        for station, contributions in zip(budget.stations, shares[row["row"]], strict=True):
            name = f"power_{station.name}"
            scatter = float(row[f"{name}_se"])
            if np.isfinite(scatter):
                row[f"{name}_u"] = float(np.hypot(row[f"{name}_type_b"], scatter))
                batches = row.get(BATCHES, 0)
                freedom = batches - 2 if batches else row["periods"] - 1
                row[f"{name}_expanded"] = drawn.half_width(contributions, scatter, freedom)


class _Draws:
    """Draws of all sources of a budget and of a scatter, each of unit standard uncertainty.

    The distribution of a sum of a few rectangular errors is not normal, so its interval is found
    by propagation of distributions (JCGM 101:2008). That the scatter comes from few periods widens
    it by Student's factor for the effective degrees of freedom (Welch and Satterthwaite, GUM G.4);
    a draw of Student's distribution itself would cover 97 % in place of 95. The seed is fixed:
    equal rows have equal intervals.
    """

    _COUNT = 20_000  # with which the half width scatters by 0.7 %

    def __init__(self, budget: UncertaintyBudget) -> None:
        from scipy.stats import norm, t  # noqa: PLC0415 - half a second that other runs save

        self._random = np.random.default_rng(20_261_127)
        self._sources = np.array([self._draw(source.distribution) for source in budget.sources])
        self._scatter, self._student = self._draw("normal"), t.ppf
        self._share = 0.5 * (1.0 + COVERAGE)
        self._normal = float(norm.ppf(self._share))

    def half_width(self, contributions: Floats, scatter: float, freedom: int) -> float:
        """Return the half width of the 95 % interval of a sum of errors around zero.

        ``scatter``: standard error with ``freedom`` degrees of freedom; with none it is that of
        other rows.
        """
        errors = contributions @ self._sources + scatter * self._scatter
        half = float(np.quantile(np.abs(errors), COVERAGE))
        if freedom < 1 or scatter == 0.0:
            return half
        variance = float(contributions @ contributions) + scatter * scatter
        effective = freedom * (variance / (scatter * scatter)) ** 2
        return half * float(self._student(self._share, effective)) / self._normal

    def _draw(self, distribution: str) -> Floats:
        if distribution == "rectangular":
            return self._random.uniform(-np.sqrt(3.0), np.sqrt(3.0), self._COUNT)
        if distribution == "triangular":
            return self._random.triangular(-np.sqrt(6.0), 0.0, np.sqrt(6.0), self._COUNT)
        return self._random.standard_normal(self._COUNT)


def uncertainty_texts(table: Any) -> tuple[str, ...]:
    """Return the best power of each station with its uncertainty as text; none without a budget.

    ``table``: a row table.
    """
    budget = json.loads(table.attrs.get(BUDGET_ATTRIBUTE, "{}"))
    lines = []
    for name, best in budget.get("best", {}).items():
        at, label = table["row"].values.tolist().index(best["row"]), budget["labels"][name]
        power, half, scatter, type_b = (
            float(table[f"power_{name}{part}"].values[at])
            for part in ("", "_expanded", "_se", "_type_b")
        )
        sizes = np.abs(best["contributions_w"])
        if not np.isfinite(half):
            lines.append(f"{label}: {power:.4g} W, Type B ± {type_b:.2g} W (standard), no scatter")
            continue
        parts = dict(zip([*budget["sources"], "scatter"], [*sizes, scatter], strict=True))
        largest = max(parts, key=lambda part: float(parts[part]))
        share = 100.0 * float(parts[largest]) ** 2 / (type_b**2 + scatter**2)
        lines.append(
            f"{label}: {power:.4g} ± {half:.2g} W in row {best['row']}; largest source {largest}, "
            f"{share:.0f} % of the variance"
        )
    return tuple(lines)
