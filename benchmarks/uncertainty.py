"""Coverage of the 95 % intervals of mean powers with errors drawn from an uncertainty budget."""

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.support.campaigns import write_yaml
from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Result, figure
from rig.analysis.scatter import period_means, successive_error
from rig.analysis.uncertainty import Budget, add_expanded, budget_of, type_b
from rig.config.uncertainty import UncertaintySource
from rig.recording.runs import run_info
from rig.recording.runs.reader import open_files
from rig.recording.runs.windows import Window, read_windows

SEEDS, SHORT_SEEDS = 1000, 10
"""The rows of one set of errors share them: the share scatters by 0.7 % with 1,000 sets, by 1.5 %
with 200."""
SCATTER = 0.003  # of the mean power, from period to period
Floats = NDArray[np.float64]


def measure(short: bool = False) -> Result:
    """Rehearse a campaign, give its signals hidden errors, and count the covered true powers."""
    with tempfile.TemporaryDirectory() as folder:
        run = _rehearse(Path(folder))
        source = open_files(run)
        info = run_info(run, source.contents)
        budget = budget_of(info.config, info.row_contents, [leaf.name for leaf in source.leaves])
        assert budget is not None, "the rig file names a budget"
        windows = list(read_windows(source, ["tick", *budget.log_fields], info.plan))
    period = 1.0 / float(info.plan["sea"]["frequency_hz"]) / float(info.plan["dt"])
    seeds = SHORT_SEEDS if short else SEEDS
    covered = {station.name: list[bool]() for station in budget.stations}
    for seed in range(seeds):
        for name, found in _covered(budget, windows, period, np.random.default_rng([seed, 9])):
            covered[name].append(found)
    return Result(
        "uncertainty",
        "Share of mean powers within their 95 % interval, with sensors whose errors are hidden.",
        f"{seeds} sets of errors drawn from configs/uncertainty/wavebot.yaml; {len(windows)} rows",
        tuple(
            figure(
                f"{station.label}: rows within their 95 % interval",
                "%",
                100.0 * float(np.mean(covered[station.name])),
                at_least=93.0,
                at_most=97.0,
            )
            for station in budget.stations
        ),
        (
            "The log of a rehearsal is the truth; scale, offset and alignment of each source and a "
            f"scatter of {100.0 * SCATTER:g} % of the power from period to period are added to it.",
        ),
    )


def _rehearse(folder: Path) -> Path:
    rigs = ROOT / "configs" / "rigs" / "wavebot.yaml"
    budget = ROOT / "configs" / "uncertainty" / "wavebot.yaml"
    rig = write_yaml(folder / "rig.yaml", {"extends": str(rigs), "uncertainty": str(budget)})
    command = ["run", str(ROOT / "configs" / "campaigns" / "quick.yaml"), "--rig", str(rig)]
    command = [sys.executable, "-m", "rig", *command, "--runs", str(folder / "runs"), "--json"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    (run,) = (folder / "runs").iterdir()
    return run


def _covered(
    budget: Budget, windows: list[Window], period: float, dice: np.random.Generator
) -> list[tuple[str, bool]]:
    """Return whether each interval of each row has the true power, by the name of its station."""
    errors = [_draw(source, dice) for source in budget.budget.sources]
    found = []
    for window in windows:
        true = _powers(budget, window.data)
        measured = _with_errors(budget, window.data, errors)
        contributions = budget.contributions(measured)
        row: dict[str, Any] = {"row": 0} | type_b(budget, contributions)
        powers = _powers(budget, measured)
        for name, values in powers.items():
            means = period_means(values, window.data["tick"], period)
            means = means + SCATTER * abs(means.mean()) * dice.standard_normal(len(means))
            scatter = successive_error(means)
            row |= {
                f"power_{name}": means.mean(),
                f"power_{name}_se": scatter.error,
                f"power_{name}_dof": scatter.dof,
            }
        add_expanded(budget, [row], {0: contributions})
        for name, values in true.items():
            error = abs(row[f"power_{name}"] - float(values.mean()))
            found.append((name, bool(error <= row[f"power_{name}_expanded"])))
    return found


def _powers(budget: Budget, data: Any) -> dict[str, Floats]:
    """Return the powers of the WaveBot's stations in the ticks of a window, by their formulas."""
    values = budget.signals.values(data)
    return {
        "mechanical_1": values["lcb"] * values["velocity"],
        "mechanical_2": values["trs"] * values["velocity"],
        "ac": values["ac"],
        "dc": values["dc"],
    }


def _draw(source: UncertaintySource, dice: np.random.Generator) -> tuple[float, float]:
    """Return the hidden errors of scale (relative) and offset of a source."""
    size = source.standard_scale + source.standard_offset
    error = (
        dice.uniform(-np.sqrt(3.0), np.sqrt(3.0)) * size
        if source.distribution == "rectangular"
        else dice.standard_normal() * size
    )
    return (error, 0.0) if source.standard_scale else (0.0, error)


def _with_errors(budget: Budget, data: Any, errors: list[tuple[float, float]]) -> Any:
    """Return a window whose sensors have errors."""
    wrong = data.copy()
    for source, (scale, offset) in zip(budget.budget.sources, errors, strict=True):
        for name in source.signals:
            first, *subtracted = budget.signals.fields[name]
            zero = sum(data[each] for each in subtracted) if subtracted else 0.0
            wrong[first] += scale * (data[first] - zero) + offset
    return wrong
