"""Adaptive campaigns against the whole matrix: basin time, and the power that they give away."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray

from benchmarks.support.campaigns import write_yaml
from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Figure, Result, figure
from rig.analysis.rows import COMPLETE, row_table
from rig.campaign.choosing import Candidates
from rig.realtime.sequence import NO_ROW
from rig.recording.runs import RunInfo, run_info

CAMPAIGNS = ROOT / "configs" / "campaigns"
FIXED, ADAPTIVE = CAMPAIGNS / "default.yaml", CAMPAIGNS / "adaptive.yaml"
OTHER_PLANT = ROOT / "configs" / "plants" / "wavebot_as_measured.yaml"
MAX_HOURS = 0.15  # of those of the whole matrix
SEEDS, SHORT_SEEDS = 100, 5
ERROR_W = 0.2  # standard error with which rows end

Floats = NDArray[np.float64]


class Drawn(NamedTuple):
    """A campaign that was drawn."""

    rows: int
    seconds: float
    lost: float  # W, true power of the recommended row above the true lowest
    expected: float  # W, what it was expected to give away


def measure(short: bool = False) -> Result:
    """Rehearse the campaign whole and adaptive; then draw campaigns with errors of the powers."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        whole = _rehearse(folder, "whole", FIXED, {})
        true = _dc(row_table(whole))
        seconds = _seconds(row_table(whole))
        figures = [figure("basin time, whole matrix", "s", seconds)]
        for start in ("predicted", "nothing"):
            run = _rehearse(folder, start, ADAPTIVE, {"adaptive": {"start": start}})
            figures += _rehearsed(row_table(run), true, seconds, start)
        info = run_info(run)  # that starts from nothing
        per_row = _row_seconds(row_table(run))
        other = _dc(row_table(_rehearse(folder, "other", FIXED, {"plant": str(OTHER_PLANT)})))
        predicted = _predicted(FIXED)
        cases = {
            "start from nothing": (true, {}),
            "start from the prediction": (true, {"dc": predicted}),
            "start from the prediction of another plant": (other, {"dc": predicted}),
        }
        for name, (powers, prior) in cases.items():
            figures.append(_loss_of_whole_matrix(name, powers))
            campaigns = [
                draw_campaign(info, powers, prior, per_row, np.random.default_rng([seed, 5]))
                for seed in range(SHORT_SEEDS if short else SEEDS)
            ]
            figures += _figures(name, campaigns, seconds)
    return Result(
        "adaptive",
        "Campaigns that choose their rows, against the whole matrix: basin time and loss.",
        f"{FIXED.name} and {ADAPTIVE.name} rehearsed; {SHORT_SEEDS if short else SEEDS} campaigns "
        f"drawn for each start, with a standard error of {ERROR_W:g} W of each row",
        tuple(figures),
        (
            "Loss: true DC power of the row that the campaign recommends, above the lowest of all "
            f"{len(true)}.",
            f"Drawn rows last {per_row:.1f} s, the mean of the rehearsed ones with their moves. "
            "The other plant is the WaveBot as measured.",
        ),
    )


def _rehearse(folder: Path, name: str, campaign: Path, changes: dict[str, Any]) -> Path:
    path = write_yaml(folder / f"{name}.yaml", {"extends": str(campaign), "name": name, **changes})
    command = [sys.executable, "-m", "rig", "run", str(path), "--runs", str(folder / name)]
    subprocess.run([*command, "--json"], check=True, stdout=subprocess.DEVNULL)
    (run,) = (folder / name).iterdir()
    return run


def _predicted(campaign: Path) -> list[float]:
    command = [sys.executable, "-m", "rig", "check", str(campaign), "--json"]
    checked = subprocess.run(command, check=True, capture_output=True, text=True)
    return [float(row["power_dc"]) for row in json.loads(checked.stdout)["predictions"]]


def _dc(table: xarray.Dataset) -> Floats:
    values: Floats = table["power_dc"].values
    return values


def _seconds(table: xarray.Dataset) -> float:
    """Return the time from the start of the run to the end of its last row, s."""
    ends = table["start"].values + 1e-3 * table["samples"].values
    return float(np.nanmax(ends))


def _row_seconds(table: xarray.Dataset) -> float:
    """Return the mean time from row to row, s."""
    starts = np.sort(table["start"].values[table["state"].values == COMPLETE])
    return float(np.diff(starts).mean())


def _rehearsed(table: xarray.Dataset, true: Floats, seconds: float, start: str) -> list[Figure]:
    done = np.flatnonzero(table["state"].values == COMPLETE)
    best = done[np.argmin(_dc(table)[done])]
    name = f"rehearsed, start {start}"
    return [
        figure(f"{name}: rows", "1", float(len(done))),
        figure(f"{name}: basin time", "s", _seconds(table)),
        figure(f"{name}: basin time / whole matrix", "ratio", _seconds(table) / seconds,
               at_most=MAX_HOURS),
        figure(f"{name}: loss", "W", float(true[best] - true.min())),
    ]  # fmt: skip


def draw_campaign(
    info: RunInfo,
    true: Floats,
    predicted: dict[str, list[float]],
    row_s: float,
    dice: np.random.Generator,
) -> Drawn:
    """Return a campaign with the candidates of a run, whose rows have powers with errors.

    ``true``: powers of all candidates, W; ``row_s``: duration of a row, s.
    """
    plan = dict(info.plan)
    plan["adaptive"] = plan["adaptive"] | {"predicted": predicted}
    info = info._replace(plan=plan)
    number = len(true)
    states = np.full(number, "not run", object)
    powers, errors, starts = (np.full(number, np.nan) for _ in range(3))
    at = 0
    while True:
        table = xarray.Dataset(
            {
                "row": ("row", np.arange(number)),
                "state": ("row", states),
                "start": ("row", starts),
                "power_dc": ("row", powers),
                "power_dc_se": ("row", errors),
            }
        )
        decision = Candidates(info, table).decide(np.inf, at, row_s)
        measured = int((states == COMPLETE).sum())
        if decision.row == NO_ROW:
            lost = float(true[decision.best] - true.min())
            return Drawn(measured, measured * row_s, lost, decision.regret)
        at = decision.row
        states[at], starts[at], errors[at] = COMPLETE, float(measured), ERROR_W
        powers[at] = true[at] + ERROR_W * dice.standard_normal()


def _loss_of_whole_matrix(name: str, true: Floats) -> Figure:
    """Return the mean loss if all rows are measured with the same errors."""
    dice = np.random.default_rng(7)
    measured = true + ERROR_W * dice.standard_normal((10_000, len(true)))
    lost = true[np.argmin(measured, axis=1)] - true.min()
    return figure(f"{name}: loss of the whole matrix, mean", "W", float(lost.mean()))


def _figures(name: str, drawn: list[Drawn], seconds: float) -> list[Figure]:
    lost = np.array([each.lost for each in drawn])
    return [
        figure(f"{name}: rows", "1", [float(each.rows) for each in drawn]),
        figure(f"{name}: time of the rows / whole matrix", "ratio",
               [each.seconds / seconds for each in drawn], at_most=MAX_HOURS),
        figure(f"{name}: loss, mean", "W", float(lost.mean())),
        figure(f"{name}: expected loss at the end, mean", "W",
               float(np.mean([each.expected for each in drawn]))),
        figure(f"{name}: loss above 1 W", "%", 100.0 * float((lost > 1.0).mean())),
    ]  # fmt: skip
