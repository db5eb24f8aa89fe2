"""Campaigns whose rows end as measured, against rows of a fixed length: hours, errors, coverage."""

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from benchmarks.support.campaigns import write_yaml
from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Result, figure
from rig.analysis.rows import row_table
from rig.analysis.scatter import successive_error
from rig.realtime import assessment, sequence
from rig.realtime.sequence import MEASURE

CAMPAIGN = ROOT / "configs" / "campaigns" / "default.yaml"
ASSESSED: dict[str, Any] = {
    "start": {"lead_in": "measured"},
    "timing": {
        "settle": "measured",
        "end": {"precision_w": 0.2, "worse_rows": True, "least_periods": 2},
    },
}
MAX_HOURS = 0.5  # of those of the fixed rows
SEEDS, SHORT_SEEDS = 200, 20
SCATTER_W = (0.1, 0.5, 2.0)  # standard deviations of the mean power of a period
CORRELATION = 0.3  # of neighbouring periods, in the second half of the campaigns
TICKS = 2  # of a simulated period: the assessment sees its mean only
LEAST, MOST, FIXED = 2, 12, 7  # periods of a row


class Campaign(NamedTuple):
    """A simulated campaign."""

    periods: int  # of all rows
    covered: int  # rows whose interval has the true power
    regret: float  # W, true power of the row with the least measured one, above the true least
    best_dropped: bool  # the truly best row ended as one that is worse


def measure(short: bool = False) -> Result:
    """Rehearse the campaign both ways; then draw campaigns with scatter and count."""
    with tempfile.TemporaryDirectory() as folder:
        fixed = _rehearse(Path(folder), "fixed", {})
        ended = _rehearse(Path(folder), "assessed", ASSESSED)
    true = fixed["power_dc"].values
    least = int(np.argmin(ended["power_dc"].values))
    figures = [
        figure("basin time, fixed rows", "s", _seconds(fixed)),
        figure("basin time, rows that end as measured", "s", _seconds(ended)),
        figure("measured / fixed", "ratio", _seconds(ended) / _seconds(fixed), at_most=MAX_HOURS),
        figure(
            "largest difference of a row's DC power",
            "W",
            float(np.abs(ended["power_dc"].values - true).max()),
        ),
        figure("DC power given away at the best row", "W", float(true[least] - true.min())),
    ]
    seeds = SHORT_SEEDS if short else SEEDS
    for scatter in SCATTER_W:
        for correlation in (0.0, CORRELATION):
            drawn = [
                draw_campaign(true, scatter, correlation, np.random.default_rng([seed, 7]))
                for seed in range(seeds)
            ]
            even = [
                _fixed_campaign(true, scatter, correlation, np.random.default_rng([seed, 7]))
                for seed in range(seeds)
            ]
            name = f"scatter {scatter:g} W" + (
                f", correlated {correlation:g}" if correlation else ""
            )
            rows = len(true) * seeds
            coverage = 100.0 * sum(each.covered for each in drawn) / rows
            limits = {} if correlation else {"at_least": 93.0, "at_most": 97.0}
            figures += [
                figure(f"{name}: rows within their 95 % interval", "%", coverage, **limits),
                figure(f"{name}: the same with {FIXED} periods each", "%",
                       100.0 * sum(each.covered for each in even) / rows),
                figure(f"{name}: periods of a campaign / {FIXED} each", "ratio",
                       [each.periods / (FIXED * len(true)) for each in drawn]),
                figure(f"{name}: best row ended too early", "%",
                       100.0 * sum(each.best_dropped for each in drawn) / seeds),
                figure(f"{name}: power given away, rms", "W", _rms(drawn)),
                figure(f"{name}: the same with {FIXED} periods each", "W", _rms(even)),
            ]  # fmt: skip
    return Result(
        "row_ends",
        "Rows that settle and end as measured, against fixed rows: basin time and errors.",
        f"{CAMPAIGN.name} rehearsed both ways; {seeds} campaigns drawn for each scatter of the "
        f"power of periods, with the true DC powers of its {len(true)} rows",
        tuple(figures),
        (
            "The simulated plant's power scatters by less than 1 mW from period to period; the "
            "drawn scatter stands for a basin's.",
            "A row ends with a standard error of 0.2 W, or once it cannot be the best any more, "
            f"after {LEAST} to {MOST} periods. Its interval is that of its own periods (Student).",
        ),
    )


def _rehearse(folder: Path, name: str, changes: dict[str, Any]) -> Any:
    path = write_yaml(folder / f"{name}.yaml", {"extends": str(CAMPAIGN), "name": name, **changes})
    command = [sys.executable, "-m", "rig", "run", str(path), "--runs", str(folder / name)]
    subprocess.run([*command, "--json"], check=True, stdout=subprocess.DEVNULL)
    (run,) = (folder / name).iterdir()
    return row_table(run)


def _seconds(table: Any) -> float:
    """Return the time from the start to the end of the last row, s."""
    return float(table["start"].values[-1] + 1e-3 * table["samples"].values[-1])


def _rms(campaigns: list[Campaign]) -> float:
    return float(np.sqrt(np.mean([each.regret**2 for each in campaigns])))


def draw_campaign(
    true: NDArray[np.float64], scatter: float, correlation: float, dice: np.random.Generator
) -> Campaign:
    """Return a campaign whose rows end as the loop ends them; powers in W."""
    params = assessment.Params(
        float(TICKS), 0, LEAST, MOST, ASSESSED["timing"]["end"]["precision_w"], 0.0, 1
    )
    state, tick, means = assessment.start(), 0, list[float]()
    periods = covered = 0
    dropped, best = False, int(np.argmin(true))
    for row, power in enumerate(true):
        values = power + _noise(scatter, correlation, dice)
        plan, count = sequence.State(row, tick, 0, 0), 0
        while count < MOST:
            for _ in range(TICKS):
                state = assessment.step(
                    params, state, plan, MEASURE, tick, 1, ((float(values[count]),), 0.0)
                )
                tick += 1
            count += 1
            if state.flags:
                break
        measured = values[:count]
        means.append(float(measured.mean()))
        periods += count
        covered += _covers(measured, power)
        precise = np.sqrt(measured.var(ddof=1) / count) <= params.precision
        dropped |= row == best and count < MOST and not precise and means[row] > min(means)
    return Campaign(periods, covered, float(true[np.argmin(means)] - true.min()), dropped)


def _fixed_campaign(
    true: NDArray[np.float64], scatter: float, correlation: float, dice: np.random.Generator
) -> Campaign:
    rows = [power + _noise(scatter, correlation, dice)[:FIXED] for power in true]
    covered = sum(_covers(row, power) for row, power in zip(rows, true, strict=True))
    chosen = int(np.argmin([row.mean() for row in rows]))
    return Campaign(FIXED * len(true), covered, float(true[chosen] - true.min()), False)


def _noise(scatter: float, correlation: float, dice: np.random.Generator) -> NDArray[np.float64]:
    """Return the scatter of `MOST` periods, a process of first order."""
    white = dice.standard_normal(MOST)
    noise = white.copy()
    for i in range(1, MOST):
        noise[i] = correlation * noise[i - 1] + np.sqrt(1.0 - correlation**2) * white[i]
    return scatter * noise


def _covers(measured: NDArray[np.float64], power: float) -> bool:
    scatter = successive_error(measured)
    half = stats.t.ppf(0.975, scatter.dof) * scatter.error
    return bool(abs(measured.mean() - power) <= half)
