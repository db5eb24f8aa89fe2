"""Running small campaigns end to end, through supervisor, loop and logger, for the tests.

As a program (`python rehearsing.py CAMPAIGN RUNS`) it is a supervisor of its own, without what
`rig run` does before and after; it says how the run ended.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from rig.analysis.rows import COMPLETE, POWERS, row_table
from rig.execution.campaign import Ended, carry_out, rehearsal
from rig.planning.campaign import check_campaign
from rig.processes.run_types import Snapshot
from rig.sweep import sweep
from rig.sweep.executors import threads

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


class Watcher:
    """A view that keeps nothing; ``see`` may act on each snapshot."""

    def __init__(self, see: Any = None) -> None:
        self.notice = ""
        self._see = see

    def __call__(self, snapshot: Snapshot) -> None:
        if self._see is not None:
            self._see(snapshot)


def yaml_file(path: Path, mapping: dict[str, Any]) -> Path:
    """Write a mapping as YAML; gives the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        YAML(typ="safe").dump(mapping, file)
    return path


def campaign_file(folder: Path, **keys: Any) -> Path:
    """Write a campaign on the WaveBot of the shipped configuration."""
    whole = {"name": "test", "rig": str(CONFIGS / "rigs" / "wavebot.yaml"), **keys}
    return yaml_file(folder / "campaign.yaml", whole)


def rows(folder: Path, repeat: int) -> Path:
    """A campaign of as many rows of 6 s, after 10 s of rig time."""
    return campaign_file(
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


def run(path: Path, runs: Path, see: Any = None, *, real_clock: bool = False) -> Ended:
    """Rehearse a campaign file."""
    report = check_campaign(path)
    assert report.ok, report.text()
    assert report.campaign is not None
    assert report.plan is not None
    mode = rehearsal(report.campaign, real_clock=real_clock)
    return carry_out(report.campaign, report.plan, runs, Watcher(see), mode)


def sequentially_swept(path: Path) -> Any:
    """The rows of a campaign walked one after the other by the compiled loop, a line each.

    It has the bits of a rehearsal (tests/batch/test_batch_bits) and takes a hundredth of its time.
    """
    asked = sweep.open_sweep(path, [], path.parent / "sweeps", sequential=True, lead_in=0.0)
    return sweep.run(asked, threads(1), lambda _: None)


def table_of(ended: Ended) -> Any:
    """Row table of a run."""
    return row_table(ended.folder)


def assert_same_rows(rehearsed: Any, swept: Any) -> None:
    """A rehearsal and the compiled loop measured the same rows, all of them whole.

    To 1e-12: sums of the same bits, taken in another order.
    """
    assert set(rehearsed.state.values.tolist()) == set(swept.state.values.tolist()) == {COMPLETE}
    for name in ("samples", "start", *(f"power_{kind}" for kind in POWERS)):
        np.testing.assert_allclose(rehearsed[name], swept[name], rtol=1e-12, err_msg=name)


if __name__ == "__main__":
    print(run(Path(sys.argv[1]), Path(sys.argv[2])).outcome.status)
