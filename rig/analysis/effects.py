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

The realisation of a reference is a categorical label: it has no effect of its own. Rows that differ
only in realisation are repetitions, and their scatter is the effect of the phases.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray
from scipy import stats

from rig.analysis.points import Matrix, row_settings, stations_of, varied_columns
from rig.analysis.rows import COMPLETE
from rig.analysis.run_columns import table_columns
from rig.config.columns import REQUIRED_COLUMNS, Column
from rig.stations import Station, find

Floats = npt.NDArray[np.float64]

CONFIDENCE = 0.95
_MIN_REPETITION_DOF = 3  # with fewer degrees of freedom, periods are the better source

REPETITIONS, PERIODS, MISFIT = "repetitions", "wave periods", "misfit"
_STANDARD_COLUMNS = {column.name for column in REQUIRED_COLUMNS}
_CATEGORICAL = {"realisation"}  # columns whose values have no order


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
    half_width: float  # W, of the interval
    misfit_half_width: float  # W, by the misfit; NaN without residual degrees of freedom


class Effects(NamedTuple):
    """Main effects on the power at one station."""

    station: Station
    effects: tuple[Effect, ...]  # the largest first
    rows: int
    source: str  # of the standard errors of the intervals
    scatter: float  # W, root mean square of the rows' standard errors by that source
    misfit: float  # W, residual standard deviation of the linear fit
    misfit_dof: int
    lead: float  # W, size of the first effect less that of the second; NaN for a single one
    lead_half_width: float  # W, by the source of the intervals
    lead_misfit_half_width: float  # W, by the misfit; NaN without residual degrees of freedom

    @property
    def lead_is_significant(self) -> bool:
        """Whether the first effect exceeds the second by more than the larger half width.

        The misfit counts as well: where interactions and curvature exceed the scatter of the rows,
        the scatter alone would overstate the significance.
        """
        known = [h for h in (self.lead_half_width, self.lead_misfit_half_width) if np.isfinite(h)]
        return bool(known and self.lead > max(known))


class LinearFit(NamedTuple):
    """A least-squares linear fit with columns scaled to 0 .. 1."""

    effects: Floats  # W, shape (columns,); NaN where not estimable
    weights: Floats  # weight of each row in each effect, shape (columns, rows)
    misfit: float  # W, NaN without a degree of freedom
    misfit_dof: int


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


def half_width(standard_error: float, dof: float, confidence: float = CONFIDENCE) -> float:
    """Return the half width of Student's interval; NaN without a degree of freedom."""
    if not dof > 0.0:
        return float("nan")
    return float(stats.t.ppf(0.5 + 0.5 * confidence, dof) * standard_error)


def row_variances(
    response: Floats, points: list[int], errors: Floats, periods: Floats, fit: LinearFit
) -> RowVariances:
    """Return the row variances from the first available source; see the module docstring.

    For each row: ``points`` is the number of its point, ``errors`` its standard error (W) from wave
    periods, ``periods`` the number of periods (fewer than 2: no standard error).
    """
    groups = np.array(points)
    means = np.array([response[groups == one].mean() for one in groups])
    dof = len(groups) - len(set(points))
    pooled = float(np.sum((response - means) ** 2) / dof) if dof else float("nan")
    ones = np.ones(len(response))
    has_period_errors = bool(np.all(periods >= 2) and np.all(np.isfinite(errors)))
    if dof >= _MIN_REPETITION_DOF or (dof and not has_period_errors):
        return RowVariances(REPETITIONS, pooled * ones, np.array(float(dof)), True)
    if has_period_errors:
        return RowVariances(PERIODS, errors**2, periods - 1.0, False)
    return RowVariances(MISFIT, fit.misfit**2 * ones, np.array(float(fit.misfit_dof)), True)


def main_effects(
    station: Station,
    columns: list[Column],
    levels: Floats,
    response: Floats,
    points: list[int],
    errors: Floats,
    periods: Floats,
    confidence: float = CONFIDENCE,
) -> Effects:
    """Return the effects of ``columns`` on ``response`` (W, by row).

    ``levels`` (rows, columns) are the values of the columns. The other arguments are those of
    `row_variances`.
    """
    fit = fit_lines(levels, response)
    variances = row_variances(response, points, errors, periods, fit)
    residual_variances = RowVariances(
        MISFIT,
        np.full(len(response), fit.misfit**2),
        np.array(float(fit.misfit_dof)),
        True,
    )
    estimates = []
    for i, column in enumerate(columns):
        watts, weights = float(fit.effects[i]), fit.weights[i]
        estimable = bool(np.isfinite(watts))
        deviation, dof = (
            weighted_sum_error(weights, variances) if estimable else (float("nan"), float("nan"))
        )
        by_misfit = (
            half_width(*weighted_sum_error(weights, residual_variances), confidence)
            if estimable
            else float("nan")
        )
        low, high = float(levels[:, i].min()), float(levels[:, i].max())
        half_width_w = half_width(deviation, dof, confidence)
        estimates.append(Effect(column, low, high, watts, deviation, dof, half_width_w, by_misfit))
    order = sorted(
        range(len(estimates)), key=lambda i: -np.nan_to_num(abs(estimates[i].watts), nan=-1.0)
    )
    lead, lead_half, lead_misfit = _lead(fit, variances, residual_variances, order, confidence)
    scatter = float(np.sqrt(variances.variance.mean()))
    return Effects(
        station,
        tuple(estimates[i] for i in order),
        len(response),
        variances.source,
        scatter,
        fit.misfit,
        fit.misfit_dof,
        lead,
        lead_half,
        lead_misfit,
    )


def _lead(
    fit: LinearFit,
    variances: RowVariances,
    residual_variances: RowVariances,
    order: list[int],
    confidence: float,
) -> tuple[float, float, float]:
    """Return the lead of the first effect over the second and its half width by both errors."""
    if len(order) < 2 or not np.isfinite(fit.effects[order[:2]]).all():
        return float("nan"), float("nan"), float("nan")
    sign = np.sign(fit.effects[order[:2]])
    weights = sign[0] * fit.weights[order[0]] - sign[1] * fit.weights[order[1]]
    lead = float(np.abs(fit.effects[order[0]]) - np.abs(fit.effects[order[1]]))
    by_scatter, by_misfit = (
        half_width(*weighted_sum_error(weights, variances_), confidence)
        for variances_ in (variances, residual_variances)
    )
    return lead, by_scatter, by_misfit


def compute_effects(
    table: xarray.Dataset, name: str, confidence: float = CONFIDENCE
) -> Effects | None:
    """Return the main effects of every varied column on a station's power, over complete rows.

    None if nothing varies among them, or if there are too few rows for a linear fit.
    """
    if "state" not in table or table.sizes["row"] == 0:
        return None
    power = table[f"power_{name}"].values
    complete = np.flatnonzero((table["state"].values == COMPLETE) & np.isfinite(power))
    settings = row_settings(table)
    settings_used = tuple(
        {n: value for n, value in settings[i].items() if n not in _CATEGORICAL} for i in complete
    )
    columns = [
        c
        for c in varied_columns(Matrix((), settings_used, columns=table_columns(table)))
        if all(c.name in each for each in settings_used)
    ]
    if not columns or len(complete) < len(columns) + 1:
        return None
    keys = [tuple(each.items()) for each in settings_used]
    point_ids = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    return main_effects(
        find(stations_of(table), name),
        columns,
        np.array([[each[c.name] for c in columns] for each in settings_used]),
        power[complete],
        [point_ids[key] for key in keys],
        table[f"power_{name}_se"].values[complete],
        table["periods"].values[complete].astype(np.float64),
        confidence,
    )


def is_designed(matrix: Matrix) -> bool:
    """Return whether columns other than spring rate, Kp and Ki vary.

    Main effects then show more than surfaces.
    """
    return bool({c.name for c in varied_columns(matrix)} - _STANDARD_COLUMNS - _CATEGORICAL)
