"""A whole campaign, rehearsed interpreted with its log, and the compiled loop, to the bit."""

import json
import math
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray

from benchmarks.start import rig_command
from benchmarks.support.campaigns import open_checked
from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Result, figure
from rig.analysis.rows import row_table
from rig.kinds.wavebot.simulation.simulation import KEPT_FIELDS, CampaignSimulator
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.recording.runs import reader, run_info
from rig.recording.runs.windows import read_windows
from rig.stations import station_names

CAMPAIGN, SHORT_CAMPAIGN = "default.yaml", "quick.yaml"
MAX_POWER_DIFFERENCE = 0.05  # W, of a mean power, after a lead-in of 15 s (docs/how_to/sweep.md)


class RowComparison(NamedTuple):
    """Comparison of the measured ticks of a rehearsal and of the compiled loop."""

    rows: int
    values: int  # compared: fields x ticks
    differing: int  # of them, in any bit
    mismatched_windows: int  # windows of another row or another length


def run_rig(arguments: list[str]) -> dict[str, object]:
    """Run a command of `rig`; return its JSON output."""
    done = subprocess.run(
        [*rig_command(), *arguments, "--json"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    output: dict[str, object] = json.loads(done.stdout)
    return output


def compare(campaign: Path, run: Path) -> RowComparison:
    """Compare each measured row of a run, value by value, with the compiled loop on its plan."""
    opened, plan = open_checked(campaign)
    windows = iter(CampaignSimulator(opened, plan).simulate(plan))
    rows = values = differing = mismatched = 0
    source = reader.open_files(run)
    logged_plan = run_info(run, source.contents).plan
    for logged in read_windows(source, list(KEPT_FIELDS), logged_plan):
        compiled = next(windows, None)
        rows += 1
        if compiled is None or (compiled.row, len(compiled.data)) != (logged.row, len(logged.data)):
            mismatched += 1
            continue
        for name in KEPT_FIELDS:
            a, b = (np.ascontiguousarray(window.data[name]) for window in (compiled, logged))
            values += len(a)
            differing += int((a.view(np.int64) != b.view(np.int64)).sum())
    return RowComparison(rows, values, differing, mismatched + sum(1 for _ in windows))


def max_power_difference(sweep: Path, run: Path) -> float:
    """Return the largest difference of a mean power (W) between single rows and the sequence."""
    table = row_table(run)
    with xarray.open_dataset(sweep) as single:
        differences = [
            np.abs(single[f"power_{name}"].values - table[f"power_{name}"].values)
            for name in station_names(STATIONS)
        ]
    return float(np.max(differences))


def measure(short: bool) -> Result:
    """Rehearse a campaign, run it in the compiled loop, and sweep each of its rows alone."""
    campaign = ROOT / "configs" / "campaigns" / (SHORT_CAMPAIGN if short else CAMPAIGN)
    with tempfile.TemporaryDirectory() as scratch:
        arguments = ["run", str(campaign), "--interpreted", "--runs", f"{scratch}/runs"]
        run = Path(str(run_rig(arguments)["folder"]))
        comparison = compare(campaign, run)
        sweep = Path(scratch) / "sweep.nc"
        run_rig(["sweep", str(campaign), "--sweeps", f"{scratch}/sweeps", "--out", str(sweep)])
        difference = max_power_difference(sweep, run)
    assert math.isfinite(difference)
    return Result(
        "bits",
        "a campaign from power-on to its end, rehearsed interpreted and in the compiled loop",
        f"{campaign.stem}, {comparison.rows} rows, once; {len(KEPT_FIELDS)} fields of every "
        "measured tick",
        (
            figure("numbers compared", "1", comparison.values),
            figure("that differ in any bit", "1", comparison.differing, at_most=0),
            figure(
                "windows of another row or length", "1", comparison.mismatched_windows, at_most=0
            ),
            figure(
                "mean power of a row alone, greatest difference",
                "W",
                difference,
                at_most=MAX_POWER_DIFFERENCE,
            ),
        ),
    )
