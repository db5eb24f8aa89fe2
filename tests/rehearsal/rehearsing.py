"""Functions for tests that run small campaigns end to end, through supervisor, loop and logger.

As a program (`python rehearsing.py CAMPAIGN RUNS EXECUTION`) the module is a supervisor without the
steps of `rig run` before and after the run; it prints the run's status.
"""

from __future__ import annotations

import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from ruamel.yaml import YAML

from rig.analysis.rows import COMPLETE, row_table
from rig.compilation.tick_code import compile_tick
from rig.execution.task import RunResult, run_task
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.tasks import execution_task, rehearsal_mode
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.processes.run_types import Snapshot
from rig.processes.tick_compiler import compile_job, source_of
from rig.stations import station_names
from rig.sweeps import sweep
from rig.sweeps.executors import thread_executor

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


class SilentView:
    """A view that draws nothing; ``on_snapshot`` may act on each snapshot."""

    def __init__(self, on_snapshot: Any = None) -> None:
        self.notice = ""
        self._on_snapshot = on_snapshot

    def __call__(self, snapshot: Snapshot) -> None:
        if self._on_snapshot is not None:
            self._on_snapshot(snapshot)


def write_yaml(path: Path, mapping: dict[str, Any]) -> Path:
    """Write a mapping as YAML and return the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        YAML(typ="safe").dump(mapping, file)
    return path


def write_campaign(folder: Path, **keys: Any) -> Path:
    """Write a campaign on the WaveBot of the shipped configuration and return the path."""
    content = {"name": "test", "rig": str(CONFIGS / "rigs" / "wavebot.yaml"), **keys}
    return write_yaml(folder / "campaign.yaml", content)


def write_repeated_row(folder: Path, repeat: int) -> Path:
    """Write a campaign of ``repeat`` rows of 6 s, which begin after 10 s of rig time."""
    return write_campaign(
        folder,
        sea={"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
        tare={"duration_s": 1},
        start={"lead_in_s": 8},
        timing={"settle_s": 2, "interval_s": 6},
        matrix={
            "list": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}],
        },
        repeat=repeat,
    )


def rehearse(
    path: Path,
    runs: Path,
    on_snapshot: Any = None,
    *,
    real_clock: bool = False,
    interpreted: bool | None = None,
) -> RunResult:
    """Rehearse a campaign file and return the result.

    By default a run is interpreted if ``on_snapshot`` may interfere with it: compiled, a minute of
    rig time has passed before the second snapshot.
    """
    report = check_campaign(path)
    assert report.ok, report.text()
    assert report.campaign is not None
    assert report.plan is not None
    mode = rehearsal_mode(report.campaign, real_clock=real_clock)
    plain = on_snapshot is not None if interpreted is None else interpreted
    mode = mode._replace(interpreted=plain)
    return run_task(
        execution_task(report.campaign, report.plan), runs, SilentView(on_snapshot), mode
    )


class Execution(NamedTuple):
    """An execution of the ticks of a rehearsal, for tests that interfere with one in its middle."""

    name: str

    @property
    def interpreted(self) -> bool:
        return self.name == "interpreted"

    @property
    def options(self) -> tuple[str, ...]:
        """Options of `rig run`."""
        return ("--interpreted",) if self.interpreted else ()

    @property
    def pace(self) -> int:
        """A factor of rig time: compiled, so much more of it passes in the same real time."""
        return 1 if self.interpreted else 20

    def write_repeated_row(self, folder: Path, repeat: int) -> Path:
        """Write the campaign with ``repeat`` times `pace` rows; its code is in the cache."""
        if not self.interpreted:
            compile_wavebot()
        return write_repeated_row(folder, repeat * self.pace)

    def rehearse(self, path: Path, runs: Path, on_snapshot: Any = None) -> RunResult:
        """Rehearse a campaign file, compiled from its first ticks on, or all of it interpreted."""
        result = rehearse(path, runs, on_snapshot, interpreted=self.interpreted)
        if result.outcome.status != "crashed":  # without a report of the loop
            assert result.outcome.compiled_from == (-1 if self.interpreted else 1)
        return result


@cache
def compile_wavebot() -> None:
    """Compile the ticks of the shipped WaveBot, alone and coupled with its plant."""
    with tempfile.TemporaryDirectory() as folder:
        report = check_campaign(write_repeated_row(Path(folder), 1))
    assert report.campaign is not None
    assert report.plan is not None
    task = execution_task(report.campaign, report.plan)
    mode = rehearsal_mode(report.campaign, real_clock=False)
    for job in (compile_job(task), compile_job(task, mode)):
        compile_tick(source_of(task.tick, job))


def sweep_sequentially(path: Path) -> Any:
    """Return the row table of a campaign whose rows the compiled loop runs one after the other.

    It has the bits of a rehearsal (tests/batch/test_batch_bits) and takes a hundredth of its time.
    """
    options = sweep.open_sweep(path, [], path.parent / "sweeps", sequential=True, lead_in=0.0)
    return sweep.run(options, thread_executor(1), lambda _: None)


def load_rows(result: RunResult) -> Any:
    """Return the row table of a run."""
    return row_table(result.folder)


def assert_same_rows(rehearsed: Any, swept: Any) -> None:
    """Assert that a rehearsal and the compiled loop measured the same rows, all complete.

    The tolerance is 1e-12: the sums have the same bits but another order.
    """
    assert set(rehearsed.state.values.tolist()) == set(swept.state.values.tolist()) == {COMPLETE}
    for name in ("samples", "start", *(f"power_{kind}" for kind in station_names(STATIONS))):
        np.testing.assert_allclose(rehearsed[name], swept[name], rtol=1e-12, err_msg=name)


if __name__ == "__main__":
    campaign, runs = map(Path, sys.argv[1:3])
    print(Execution(sys.argv[3]).rehearse(campaign, runs).outcome.status)
