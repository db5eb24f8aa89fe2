"""Main effects of a designed matrix: change of power due to each column, with intervals.

A least-squares fit describes the power of a row as a constant plus one linear term per column,
without interactions and curvature. The effect of a column is the change of power from its minimum
to its maximum in the matrix at constant other columns, so effects of volts and of microseconds are
comparable. The intervals use Student's t. Their standard error comes from the first of the
following sources that the rows provide:

- the pooled scatter of repetitions about the mean of their point, which contains all row-to-row
  variation;
- the scatter of whole wave periods within each row, with Satterthwaite's degrees of freedom, which
  contains no waves and drifts longer than a row;
- the misfit: the residual of the linear fit.

The misfit is always reported as well, because neither repetitions nor periods contain interactions
and curvature.

An effect is a weighted sum of rows. Errors of a budget (Type B) are the same in all rows of a run,
so the contribution of each source to the effect is that sum of its signed contributions to the
rows, and is part of the interval (GUM 5.2.2): an error of scale changes an effect by its
percentage, an offset hardly at all.

A categorical column, such as the realisation of a reference, has no effect of its own. Rows that
differ in nothing else are repetitions; their scatter is, say, the effect of the phases.
"""

import json
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray

from rig.analysis import labels
from rig.analysis.intervals import CONFIDENCE, combined_half_width
from rig.analysis.law_differences import tables_by_law
from rig.analysis.points import Matrix, degrees_of_freedom, row_settings, varied_columns
from rig.analysis.rows import COMPLETE, columns_of, stations_of
from rig.analysis.uncertainty import BUDGET_ATTRIBUTE, CONTRIBUTIONS
from rig.presentation import phrases
from rig.recording.table_file import write_table
from rig.row_contents import CATEGORICAL, Column, main_columns
from rig.spectra.periods import Floats
from rig.stations import Station, find, shown

_MIN_REPETITION_DOF = 3  # with fewer degrees of freedom, periods are the better source

REPETITIONS, PERIODS, MISFIT = "repetitions", "wave periods", "misfit"


class RowVariances(NamedTuple):
    """Variance of the mean power of each row."""

    source: str
    variance: Floats  # W^2, shape (rows,)
    dof: Floats  # degrees of freedom of each row's variance, or of all where it is pooled
    pooled: bool


class Effect(NamedTuple):
    """Main effect of one column; NaN where it is confounded with another column."""

    column: Column
    low: float  # SI, minimum over the rows
    high: float
    watts: float  # change of power from low to high; negative: more is absorbed at high
    standard_error: float  # W
    dof: float
    type_b: float  # W, standard uncertainty by the budget; 0 without one
    half_width: float  # W, of the interval by both
    misfit_half_width: float  # W, by the misfit; NaN without residual degrees of freedom

    @property
    def range_text(self) -> str:
        """The range of the column as text: ``50 .. 200 µs``."""
        low = labels.format_number(self.column, self.low)
        return f"{low} .. {labels.format_quantity(self.column, self.high)}"

    @property
    def text(self) -> str:
        """The effect (W) with the half width of its interval as text without the unit."""
        if not np.isfinite(self.watts):
            return "confounded"
        return phrases.format_power(self.watts, self.half_width).removesuffix(" W")


class Effects(NamedTuple):
    """Main effects on the power at one station."""

    station: Station
    effects: tuple[Effect, ...]  # the largest first
    rows: int
    source: str  # of the standard errors of the intervals
    has_budget: bool  # which the intervals contain
    scatter: float  # W, root mean square of the rows' standard errors by that source
    misfit: float  # W, residual standard deviation of the linear fit
    misfit_dof: int
    lead: float  # W, size of the first effect less that of the second; NaN for a single one
    lead_half_width: float  # W, by the source of the intervals
    lead_misfit_half_width: float  # W, by the misfit; NaN without residual degrees of freedom
    law: str = ""  # whose rows these are; empty in a campaign of one law

    def text_of(self, column: Column) -> str:
        """Return the effect of a column as text."""
        return next(each.text for each in self.effects if each.column.name == column.name)

    @property
    def lead_is_significant(self) -> bool:
        """Whether the first effect exceeds the second by more than the larger half width.

        The misfit counts as well: where interactions and curvature exceed the scatter of the rows,
        the scatter alone would overstate the significance.
        """
        known = [h for h in (self.lead_half_width, self.lead_misfit_half_width) if np.isfinite(h)]
        return bool(known and self.lead > max(known))


class SharedErrors(NamedTuple):
    """The Type B errors that all rows of a run share."""

    contributions: Floats  # W, signed, shape (rows, sources)
    distributions: tuple[str, ...]  # of the sources; empty without a budget

    def of_sum(self, weights: Floats) -> Floats:
        """Return the contributions of the sources to a weighted sum of rows, W."""
        return weights @ self.contributions if self.distributions else np.zeros(0)

    def half_width(self, error: float, dof: float, weights: Floats) -> float:
        """Return the half width of the interval of a weighted sum, W, by these and a scatter."""
        return combined_half_width(error, dof, self.of_sum(weights), self.distributions)


NO_BUDGET = SharedErrors(np.zeros((0, 0)), ())


class LinearFit(NamedTuple):
    """A least-squares linear fit with columns scaled to 0 .. 1."""

    effects: Floats  # W, shape (columns,); NaN where not estimable
    weights: Floats  # weight of each row in each effect, shape (columns, rows)
    misfit: float  # W, NaN without a degree of freedom
    misfit_dof: int

    @property
    def variances(self) -> RowVariances:
        """The variance of the rows by the misfit."""
        rows = self.weights.shape[1]
        dof = np.array(float(self.misfit_dof))
        return RowVariances(MISFIT, np.full(rows, self.misfit**2), dof, True)


def fit_lines(levels: Floats, response: Floats) -> LinearFit:
    """Return the linear fit of ``response`` (rows,) over ``levels`` (rows, columns).

    Every column must vary.
    """
    lowest = levels.min(axis=0)
    scaled = (levels - lowest) / (levels.max(axis=0) - lowest)
    design = np.column_stack([np.ones(len(response)), scaled])
    weights, _, rank, _ = np.linalg.lstsq(design, np.eye(len(response)), rcond=None)
    coefficients = weights @ response
    residual = response - design @ coefficients
    dof = len(response) - int(rank)
    # lstsq spreads a linearly dependent column over the others: its unit response is then not 1.
    estimable = np.abs(weights @ design - np.eye(design.shape[1])).max(axis=1) < 1e-6
    return LinearFit(
        np.where(estimable, coefficients, np.nan)[1:],
        weights[1:],
        float(np.sqrt(residual @ residual / dof)) if dof > 0 else float("nan"),
        dof,
    )


def weighted_sum_error(weights: Floats, variances: RowVariances) -> tuple[float, float]:
    """Return the standard error (W) and degrees of freedom of a weighted sum of rows."""
    parts = weights * weights * variances.variance
    variance = float(parts.sum())
    if variances.pooled or variance == 0.0:
        return float(np.sqrt(variance)), float(
            variances.dof if variances.pooled else variances.dof.sum()
        )
    return float(np.sqrt(variance)), float(variance**2 / np.sum(parts * parts / variances.dof))


def row_variances(
    response: Floats, points: list[int], errors: Floats, dofs: Floats, fit: LinearFit
) -> RowVariances:
    """Return the row variances from the first available source; see the module docstring.

    For each row: ``points`` is the number of its point, ``errors`` its standard error (W) from wave
    periods, ``dofs`` its degrees of freedom (less than 1: no standard error).
    """
    groups = np.array(points)
    means = np.array([response[groups == one].mean() for one in groups])
    dof = len(groups) - len(set(points))
    pooled = float(np.sum((response - means) ** 2) / dof) if dof else float("nan")
    has_period_errors = bool(np.all(dofs >= 1.0) and np.all(np.isfinite(errors)))
    if dof >= _MIN_REPETITION_DOF or (dof and not has_period_errors):
        variance = np.full(len(response), pooled)
        return RowVariances(REPETITIONS, variance, np.array(float(dof)), True)
    if has_period_errors:
        return RowVariances(PERIODS, errors**2, dofs, False)
    return fit.variances


def main_effects(
    station: Station,
    columns: list[Column],
    levels: Floats,
    response: Floats,
    points: list[int],
    errors: Floats,
    dofs: Floats,
    shared: SharedErrors = NO_BUDGET,
) -> Effects:
    """Return the effects of ``columns`` on ``response`` (W, by row).

    ``levels`` (rows, columns) are the values of the columns, ``shared`` the errors that all rows
    share. The other arguments are those of `row_variances`.
    """
    fit = fit_lines(levels, response)
    variances = row_variances(response, points, errors, dofs, fit)
    unknown = float("nan"), float("nan")
    estimates = []
    for column, watts, weights, values in zip(
        columns, fit.effects.tolist(), fit.weights, levels.T, strict=True
    ):
        error, by_misfit = (
            weighted_sum_error(weights, source) if np.isfinite(watts) else unknown
            for source in (variances, fit.variances)
        )
        estimates.append(
            Effect(
                column,
                float(values.min()),
                float(values.max()),
                watts,
                *error,
                float(np.linalg.norm(shared.of_sum(weights))),
                shared.half_width(*error, weights),
                shared.half_width(*by_misfit, weights),
            )
        )
    order = np.argsort(-np.nan_to_num(np.abs(fit.effects), nan=-1.0), kind="stable").tolist()
    return Effects(
        station,
        tuple(estimates[i] for i in order),
        len(response),
        variances.source,
        bool(shared.distributions),
        float(np.sqrt(variances.variance.mean())),
        fit.misfit,
        fit.misfit_dof,
        *_lead(fit, variances, order, shared),
    )


def _lead(
    fit: LinearFit, variances: RowVariances, order: list[int], shared: SharedErrors
) -> tuple[float, float, float]:
    """Return the lead of the first effect over the second and its half width by both errors."""
    if len(order) < 2 or not np.isfinite(fit.effects[order[:2]]).all():
        return float("nan"), float("nan"), float("nan")
    sign = np.sign(fit.effects[order[:2]])
    weights = sign[0] * fit.weights[order[0]] - sign[1] * fit.weights[order[1]]
    lead = float(np.abs(fit.effects[order[0]]) - np.abs(fit.effects[order[1]]))
    by_scatter, by_misfit = (
        shared.half_width(*weighted_sum_error(weights, source), weights)
        for source in (variances, fit.variances)
    )
    return lead, by_scatter, by_misfit


def compute_effects(table: xarray.Dataset, name: str) -> Effects | None:
    """Return the main effects of every varied column on a station's power, over complete rows.

    None if nothing varies among them, or if there are too few rows for a linear fit.
    """
    if "state" not in table or table.sizes["row"] == 0:
        return None
    power = table[f"power_{name}"].values
    complete = np.flatnonzero((table["state"].values == COMPLETE) & np.isfinite(power))
    ordered = tuple(c for c in columns_of(table) if c.role != CATEGORICAL)
    names, settings = {c.name for c in ordered}, row_settings(table)
    settings_used = tuple({n: v for n, v in settings[i].items() if n in names} for i in complete)
    columns = [
        c
        for c in varied_columns(Matrix((), settings_used, ordered))
        if all(c.name in each for each in settings_used)
    ]
    if not columns or len(complete) < len(columns) + 1:
        return None
    keys = [tuple(each.items()) for each in settings_used]
    point_ids = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    # Not of errors by repetitions, which come first.
    by_periods = table["periods"].values[complete] >= 2
    dofs = np.where(by_periods, degrees_of_freedom(table, name)[complete], 0.0)
    return main_effects(
        find(stations_of(table), name),
        columns,
        np.array([[each[c.name] for c in columns] for each in settings_used]),
        power[complete],
        [point_ids[key] for key in keys],
        table[f"power_{name}_se"].values[complete],
        dofs,
        _shared_errors(table, name, complete),
    )


def _shared_errors(table: xarray.Dataset, name: str, rows: NDArray[np.int64]) -> SharedErrors:
    """Return the Type B errors of a station's power in some rows of a table."""
    contributions = table.get(f"power_{name}_{CONTRIBUTIONS}")
    if contributions is None:
        return NO_BUDGET
    distributions = json.loads(table.attrs[BUDGET_ATTRIBUTE])["distributions"]
    return SharedErrors(contributions.values[rows], tuple(distributions))


def is_designed(matrix: Matrix) -> bool:
    """Return whether other than the main columns vary: effects then show more than surfaces."""
    main = main_columns(matrix.columns)
    return any(c not in main and c.role != CATEGORICAL for c in varied_columns(matrix))


def all_effects(table: xarray.Dataset) -> tuple[Effects, ...]:
    """Return the main effects on the powers shown in pictures; empty if nothing varies.

    The last station in the flow of power is first: it determines the ranks on the summary page.
    Each law of a campaign with several has effects of its own, in the order of the campaign.
    """
    if "state" not in table or table.sizes["row"] == 0:
        return ()
    found = (
        (law, compute_effects(rows, station.name))
        for law, rows in tables_by_law(table)
        for station in reversed(shown(stations_of(table)))
    )
    return tuple(effects._replace(law=law) for law, effects in found if effects is not None)


def effect_notes(effects: Effects) -> list[str]:
    """Return notes on the intervals, on the misfit, and on the lead of the first effect."""
    percent = f"{100.0 * CONFIDENCE:g} %"
    dofs = [each.dof for each in effects.effects if np.isfinite(each.dof)]
    name = effects.station.short_label
    if effects.source == MISFIT:
        source = f"the misfit of the linear fit ({effects.misfit_dof} dof)"
    else:
        dof_text = f"at least {min(dofs):.0f} dof" if dofs else "no dof"
        source = f"scatter of {effects.source} ({dof_text})"
    notes = [f"± is the {percent} interval by {source}{' and Type B' * effects.has_budget}"]
    if effects.misfit_dof > 0:
        misfit, scatter = _format_magnitude(effects.misfit), _format_magnitude(effects.scatter)
        line = (
            f"misfit of the linear fit of {name} power {misfit} W ({effects.misfit_dof} dof), "
            f"scatter of rows {scatter} W"
        )
        first = effects.effects[0]
        if effects.source != MISFIT and first.misfit_half_width > first.half_width:
            half = _format_magnitude(first.misfit_half_width)
            line += f"; by misfit, {first.column.label} is ± {half} W"
        notes.append(line)
    if np.isfinite(effects.lead):
        first, second = effects.effects[:2]
        line = f"the effect of {first.column.label} on {name} power exceeds that of "
        line += f"{second.column.label} by {_format_magnitude(effects.lead)} W"
        notes.append(line + _format_lead(effects))
    confounded = [e.column.label for e in effects.effects if not np.isfinite(e.watts)]
    if confounded:
        notes.append(f"this matrix cannot separate {', '.join(confounded)} (confounded)")
    return notes


def _format_lead(effects: Effects) -> str:
    """Return the half widths of the lead by each error, and whether it is not significant."""
    errors = []
    if effects.source != MISFIT:
        errors.append((effects.lead_half_width, f" by {effects.source}"))
    errors.append((effects.lead_misfit_half_width, " by misfit"))
    parts = [
        f"± {_format_magnitude(half)} W{source}" for half, source in errors if np.isfinite(half)
    ]
    if not parts:
        return ""
    return f" ({', '.join(parts)}{'' if effects.lead_is_significant else ': not significant'})"


def _format_magnitude(value: float) -> str:
    return f"{value:.1f}" if value >= 0.095 else f"{value:.2f}" if value >= 0.005 else "<0.01"


def effects_text(by_station: tuple[Effects, ...]) -> list[str]:
    """Return the effects as lines for a terminal, ranked by the first station; empty if none.

    Laws have a table each.
    """
    by_law = [[*group] for _, group in groupby(by_station, key=lambda effects: effects.law)]
    return [line for group in by_law for line in _law_text(group)]


def _law_text(by_station: Sequence[Effects]) -> list[str]:
    first = by_station[0]
    headings = [f"{effects.station.short_label}, W" for effects in by_station]
    width = max(20, *(len(heading) + 2 for heading in headings))
    of_law = f" with the law {first.law}" if first.law else ""
    lines = [
        f"Main effects{of_law} (change of power over the range of a column; negative absorbs more)",
        f"  {'':<20} {'range':<24}" + "".join(f"{heading:>{width}}" for heading in headings),
    ]
    for i, effect in enumerate(first.effects):
        cells = "".join(f"{effects.text_of(effect.column):>{width}}" for effects in by_station)
        lines.append(f"  {i + 1}. {effect.column.label:<17} {effect.range_text:<24}{cells}")
    return [*lines, *(f"  {note}" for note in effect_notes(first))]


def effects_json(by_station: tuple[Effects, ...]) -> list[dict[str, Any]]:
    """Return the effects as JSON data: powers in W, columns in SI, unknown values NaN."""
    return [
        {
            "power": effects.station.name,
            **({"law": effects.law} if effects.law else {}),
            "rows": effects.rows,
            "confidence": CONFIDENCE,
            "error_by": effects.source,
            "type_b_included": effects.has_budget,
            "row_scatter_w": effects.scatter,
            "misfit_w": effects.misfit,
            "misfit_dof": effects.misfit_dof,
            "first_over_second_w": effects.lead,
            "first_over_second_half_width_w": effects.lead_half_width,
            "first_over_second_half_width_by_misfit_w": effects.lead_misfit_half_width,
            "first_surely_first": effects.lead_is_significant,
            "effects": [
                {
                    "rank": i + 1,
                    "column": e.column.name,
                    "unit": e.column.unit,
                    "from": e.low,
                    "to": e.high,
                    "effect_w": e.watts,
                    "standard_error_w": e.standard_error,
                    "dof": e.dof,
                    "type_b_w": e.type_b,
                    "half_width_w": e.half_width,
                    "half_width_by_misfit_w": e.misfit_half_width,
                }
                for i, e in enumerate(effects.effects)
            ],
        }
        for effects in by_station
    ]


def effect_lines(by_station: tuple[Effects, ...]) -> list[dict[str, Any]]:
    """Return a line for each station and column; W, columns in SI, 95 % intervals."""
    return [
        {
            "power": effects.station.name,
            **({"law": effects.law} if effects.law else {}),
            "rank": i + 1,
            "column": e.column.name,
            "unit": e.column.unit,
            "from": e.low,
            "to": e.high,
            "effect [W]": e.watts,
            "standard error [W]": e.standard_error,
            "dof": e.dof,
            "type B [W]": e.type_b,
            "interval from [W]": e.watts - e.half_width,
            "interval to [W]": e.watts + e.half_width,
            "error by": effects.source,
            "interval by misfit from [W]": e.watts - e.misfit_half_width,
            "interval by misfit to [W]": e.watts + e.misfit_half_width,
            "misfit [W]": effects.misfit,
            "misfit dof": effects.misfit_dof,
            "rows": effects.rows,
        }
        for effects in by_station
        for i, e in enumerate(effects.effects)
    ]


def write_effects(by_station: tuple[Effects, ...], path: Path) -> Path:
    """Write the `effect_lines` as CSV."""
    lines = effect_lines(by_station)
    return write_table({key: [line[key] for line in lines] for key in lines[0]}, path)
