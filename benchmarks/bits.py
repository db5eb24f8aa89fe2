"""A whole campaign both ways: rehearsed with plant and log, and in the compiled loop."""

import json
import math
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray

from benchmarks.start import rig_command
from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Result, figure
from rig.analysis.rows import row_table
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.simulation.simulation import KEPT_FIELDS, CampaignSimulator
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.recording.runs import reader
from rig.recording.runs.folder import run_info
from rig.recording.runs.windows import read_windows
from rig.stations import station_names

CAMPAIGN, SHORT_CAMPAIGN = "default.yaml", "quick.yaml"
MAX_POWER_DIFFERENCE = 0.05  # W: what a lead-in of 15 s may leave in a mean power (docs/sweeps.md)


class RowComparison(NamedTuple):
    """Comparison of the measured ticks of a rehearsal and of the compiled loop."""

    rows: int
    values: int  # compared: fields x ticks
    differing: int  # of them, in any bit
    mismatched_windows: int  # windows that are of another row, or of another length


def run_rig(words: list[str]) -> dict[str, object]:
    """What a command of `rig` says in JSON."""
    done = subprocess.run(
        [*rig_command(), *words, "--json"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    told: dict[str, object] = json.loads(done.stdout)
    return told


def compare(campaign: Path, run: Path) -> RowComparison:
    """Compare each measured row of a run, number by number, with the compiled loop on its plan."""
    report = check_campaign(campaign)
    assert report.campaign is not None, report.text()
    assert report.plan is not None
    ticks = iter(CampaignSimulator(report.campaign, report.plan).simulate(report.plan))
    rows = numbers = differing = unlike = 0
    source = reader.open_files(run)
    plan = run_info(run, source.contents).plan
    for theirs in read_windows(source, list(KEPT_FIELDS), plan):
        ours = next(ticks, None)
        rows += 1
        if ours is None or (ours.row, len(ours.data)) != (theirs.row, len(theirs.data)):
            unlike += 1
            continue
        for name in KEPT_FIELDS:
            a, b = (np.ascontiguousarray(window.data[name]) for window in (ours, theirs))
            numbers += len(a)
            differing += int((a.view(np.int64) != b.view(np.int64)).sum())
    return RowComparison(rows, numbers, differing, unlike + sum(1 for _ in ticks))


def max_power_difference(swept: Path, run: Path) -> float:
    """The greatest difference of a mean power, W, of rows alone from rows in sequence."""
    table = row_table(run)
    with xarray.open_dataset(swept) as alone:
        differences = [
            np.abs(alone[f"power_{name}"].values - table[f"power_{name}"].values)
            for name in station_names(STATIONS)
        ]
    return float(np.max(differences))


def measure(short: bool) -> Result:
    """Rehearse a campaign, run it in the compiled loop, and sweep each of its rows alone."""
    campaign = ROOT / "configs" / "campaigns" / (SHORT_CAMPAIGN if short else CAMPAIGN)
    with tempfile.TemporaryDirectory() as scratch:
        run = Path(str(run_rig(["run", str(campaign), "--runs", f"{scratch}/runs"])["folder"]))
        found = compare(campaign, run)
        swept = Path(scratch) / "sweep.nc"
        run_rig(["sweep", str(campaign), "--sweeps", f"{scratch}/sweeps", "--out", str(swept)])
        most = max_power_difference(swept, run)
    assert math.isfinite(most)
    return Result(
        "bits",
        "a campaign from power-on to its end, rehearsed and in the compiled loop",
        f"{campaign.stem}, {found.rows} rows, once; {len(KEPT_FIELDS)} fields of every measured "
        "tick",
        (
            figure("numbers compared", "1", found.values),
            figure("that differ in any bit", "1", found.differing, at_most=0),
            figure("windows of another row or length", "1", found.mismatched_windows, at_most=0),
            figure(
                "mean power of a row alone, greatest difference",
                "W",
                most,
                at_most=MAX_POWER_DIFFERENCE,
            ),
        ),
    )
