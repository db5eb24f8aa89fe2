"""Main effects of a designed matrix: what each varied column does to power, and how surely.

Power of a row is fitted by least squares as a constant plus one straight line a column (no
interactions, no curvature). The effect of a column is the change of power from its least to its
greatest value in the matrix, others held: so effects of volts and microseconds compare. Its
interval is of Student's t. The error behind it is, of what the rows tell, the first of:

- scatter of repetitions about their point's mean, pooled; it has what differs from row to row;
- scatter of whole wave periods within each row, with Satterthwaite's degrees of freedom; waves and
  drifts that last longer than a row are not in it;
- what the lines leave unexplained.

The last of these is given beside the others, because neither repetitions nor periods know of
interactions and curvature.

The realisation of a reference is a name and no number: it has no effect of its own, and rows that
differ in it alone are repetitions, whose scatter is what other phases change.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray
from scipy import stats

from rig.analysis.points import Matrix, row_settings, varied
from rig.analysis.rows import COMPLETE
from rig.config.columns import REQUIRED_COLUMNS, Column

Floats = npt.NDArray[np.float64]

CONFIDENCE = 0.95
_LEAST_REPETITIONS = 3  # degrees of freedom: with fewer the periods say more

REPETITIONS, PERIODS, MISFIT = "repetitions", "wave periods", "misfit"
_ALWAYS = {column.name for column in REQUIRED_COLUMNS}
_NAMES = {"realisation"}  # columns whose values have no order


class Error(NamedTuple):
    """Variance of each row's mean."""

    source: str
    variance: Floats  # W^2, shape (rows,)
    dof: Floats  # degrees of freedom of each row's variance, or of all where it is pooled
    pooled: bool


class Effect(NamedTuple):
    """What one column does; NaN where the matrix cannot tell it from another."""

    column: Column
    low: float  # SI, least value in the rows
    high: float
    watts: float  # change of power from low to high; negative: more is absorbed at high
    standard_error: float  # W
    dof: float
    half_width: float  # W, of the interval
    misfit_half_width: float  # W, with the error that the misfit says; NaN where none is left


class Effects(NamedTuple):
    """Main effects on one kind of power."""

    kind: str
    effects: tuple[Effect, ...]  # the largest first
    rows: int
    source: str  # of the error behind the intervals
    scatter: float  # W, root mean square of the rows' standard errors by that source
    misfit: float  # W, standard deviation of what the lines leave
    misfit_dof: int
    lead: float  # W, how much larger the first is than the second; NaN for a single one
    lead_half_width: float  # W, by the error behind the intervals
    lead_misfit_half_width: float  # W, by the misfit; NaN where none is left

    @property
    def surely_first(self) -> bool:
        """Whether the first effect is ahead of the second by more than the larger interval.

        Straight lines leave what interactions and curvature do; where that is more than rows
        scatter, a lead beyond the scatter alone says too much.
        """
        known = [h for h in (self.lead_half_width, self.lead_misfit_half_width) if np.isfinite(h)]
        return bool(known and self.lead > max(known))


class Fit(NamedTuple):
    """A least-squares fit of straight lines, columns scaled to 0 .. 1."""

    effects: Floats  # W, shape (columns,); NaN where not estimable
    weights: Floats  # of each row in each effect, shape (columns, rows)
    misfit: float  # W, NaN without a degree of freedom
    misfit_dof: int


def fit(levels: Floats, response: Floats) -> Fit:
    """Lines through ``response`` (rows,) over ``levels`` (rows, columns), each column varying."""
    low = levels.min(axis=0)
    unit = (levels - low) / (levels.max(axis=0) - low)
    design = np.column_stack([np.ones(len(response)), unit])
    weights, _, rank, _ = np.linalg.lstsq(design, np.eye(len(response)), rcond=None)
    found = weights @ response
    left = response - design @ found
    dof = len(response) - int(rank)
    # A column that others add up to is spread over them: its weights are then no unit response.
    alone = np.abs(weights @ design - np.eye(design.shape[1])).max(axis=1) < 1e-6
    return Fit(
        np.where(alone, found, np.nan)[1:],
        weights[1:],
        float(np.sqrt(left @ left / dof)) if dof > 0 else float("nan"),
        dof,
    )


def spread(weights: Floats, error: Error) -> tuple[float, float]:
    """Standard error (W) and degrees of freedom of a weighted sum of rows."""
    parts = weights * weights * error.variance
    variance = float(parts.sum())
    if error.pooled or variance == 0.0:
        return float(np.sqrt(variance)), float(error.dof if error.pooled else error.dof.sum())
    return float(np.sqrt(variance)), float(variance**2 / np.sum(parts * parts / error.dof))


def half_width(standard_error: float, dof: float, confidence: float = CONFIDENCE) -> float:
    """Half of Student's interval; NaN without a degree of freedom."""
    if not dof > 0.0:
        return float("nan")
    return float(stats.t.ppf(0.5 + 0.5 * confidence, dof) * standard_error)


def error_of(
    response: Floats, points: list[int], errors: Floats, periods: Floats, fitted: Fit
) -> Error:
    """The error behind the intervals, as the module's text says.

    By row: the number of its point, the standard error (W) that its periods gave, how many they
    were (fewer than 2: they gave none).
    """
    groups = np.array(points)
    means = np.array([response[groups == one].mean() for one in groups])
    dof = len(groups) - len(set(points))
    pooled = float(np.sum((response - means) ** 2) / dof) if dof else float("nan")
    same = np.ones(len(response))
    known = bool(np.all(periods >= 2) and np.all(np.isfinite(errors)))
    if dof >= _LEAST_REPETITIONS or (dof and not known):
        return Error(REPETITIONS, pooled * same, np.array(float(dof)), True)
    if known:
        return Error(PERIODS, errors**2, periods - 1.0, False)
    return Error(MISFIT, fitted.misfit**2 * same, np.array(float(fitted.misfit_dof)), True)


def main_effects(
    kind: str,
    columns: list[Column],
    levels: Floats,
    response: Floats,
    points: list[int],
    errors: Floats,
    periods: Floats,
    confidence: float = CONFIDENCE,
) -> Effects:
    """Effects of ``columns``, whose values by row are ``levels`` (rows, columns), on ``response``.

    The other arguments are as in `error_of`.
    """
    fitted = fit(levels, response)
    error = error_of(response, points, errors, periods, fitted)
    left = Error(
        MISFIT,
        np.full(len(response), fitted.misfit**2),
        np.array(float(fitted.misfit_dof)),
        True,
    )
    found = []
    for i, column in enumerate(columns):
        watts, weights = float(fitted.effects[i]), fitted.weights[i]
        known = bool(np.isfinite(watts))
        deviation, dof = spread(weights, error) if known else (float("nan"), float("nan"))
        by_misfit = half_width(*spread(weights, left), confidence) if known else float("nan")
        low, high = float(levels[:, i].min()), float(levels[:, i].max())
        half = half_width(deviation, dof, confidence)
        found.append(Effect(column, low, high, watts, deviation, dof, half, by_misfit))
    order = sorted(range(len(found)), key=lambda i: -np.nan_to_num(abs(found[i].watts), nan=-1.0))
    lead, lead_half, lead_misfit = _lead(fitted, error, left, order, confidence)
    scatter = float(np.sqrt(error.variance.mean()))
    return Effects(
        kind,
        tuple(found[i] for i in order),
        len(response),
        error.source,
        scatter,
        fitted.misfit,
        fitted.misfit_dof,
        lead,
        lead_half,
        lead_misfit,
    )


def _lead(
    fitted: Fit, error: Error, left: Error, order: list[int], confidence: float
) -> tuple[float, float, float]:
    """How much larger the first effect is than the second, and half widths by either error."""
    if len(order) < 2 or not np.isfinite(fitted.effects[order[:2]]).all():
        return float("nan"), float("nan"), float("nan")
    sign = np.sign(fitted.effects[order[:2]])
    weights = sign[0] * fitted.weights[order[0]] - sign[1] * fitted.weights[order[1]]
    lead = float(np.abs(fitted.effects[order[0]]) - np.abs(fitted.effects[order[1]]))
    by_scatter, by_misfit = (half_width(*spread(weights, one), confidence) for one in (error, left))
    return lead, by_scatter, by_misfit


def effects(table: xarray.Dataset, kind: str, confidence: float = CONFIDENCE) -> Effects | None:
    """Main effects of every varied column on one kind of power, of the complete rows.

    None where nothing varies among them, or they are too few for a line a column.
    """
    if "state" not in table or table.sizes["row"] == 0:
        return None
    power = table[f"power_{kind}"].values
    good = np.flatnonzero((table["state"].values == COMPLETE) & np.isfinite(power))
    settings = row_settings(table)
    here = tuple(
        {name: value for name, value in settings[i].items() if name not in _NAMES} for i in good
    )
    columns = [c for c in varied(Matrix((), here)) if all(c.name in each for each in here)]
    if not columns or len(good) < len(columns) + 1:
        return None
    keys = [tuple(each.items()) for each in here]
    number = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    return main_effects(
        kind,
        columns,
        np.array([[each[c.name] for c in columns] for each in here]),
        power[good],
        [number[key] for key in keys],
        table[f"power_{kind}_se"].values[good],
        table["periods"].values[good].astype(np.float64),
        confidence,
    )


def is_designed(matrix: Matrix) -> bool:
    """Whether more than spring rate, Kp and Ki varies, so that effects say more than surfaces."""
    return bool({c.name for c in varied(matrix)} - _ALWAYS - _NAMES)
