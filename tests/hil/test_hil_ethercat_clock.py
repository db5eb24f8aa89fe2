"""A run whose loop follows the clock of its segment, which runs fast against that of the host."""

from __future__ import annotations

import json
import os
import statistics
from pathlib import Path

import pytest

from benchmarks.support.campaigns import SilentView, write_yaml
from benchmarks.support.emulated_wavebot import emulated_wavebot, write_ethercat_rig_file
from rig.emulation.cable import cable_problem
from rig.execution.fault_runs import run_when_free

pytest.importorskip("pysoem")
if problem := cable_problem("wectest"):
    pytest.skip(problem, allow_module_level=True)

pytestmark = [pytest.mark.realtime, pytest.mark.long]
PPM = 300.0


def write_rig(folder: Path) -> Path:
    base = write_ethercat_rig_file(folder).rename(folder / "base.yaml")
    segment = {"clock": "distributed", "interface": f"wek{os.getpid()}"}
    return write_yaml(folder / "rig.yaml", {"extends": str(base), "wiring": {"ethercat": segment}})


def test_the_loop_takes_up_the_drift_of_the_reference_clock(tmp_path: Path) -> None:
    timing = {"settle_s": 1, "interval_s": 20}
    with emulated_wavebot(tmp_path, write_rig, timing=timing) as started:
        started.control.switch("heave", "dc_drift", value=PPM)
        result = run_when_free(lambda: started.run(SilentView()))
    assert result.outcome.status == "complete"
    report = json.loads((Path(result.folder) / "wires.json").read_text())
    assert report["ethercat"]["wrong_working_counter"] == 0
    rows = report["clock"]["rows"][3:]  # three seconds to settle
    assert len(rows) > 15
    drift = statistics.mean(row[2] for row in rows)
    offset = statistics.median(abs(row[1]) for row in rows)
    print(f"drift {drift:.0f} ppm, offset {offset / 1000:.0f} us")
    # The reference is fast, so the loop's ticks must come earlier. A single drift scatters by
    # 100 ppm with frames that are 50 us late.
    assert -drift == pytest.approx(PPM, abs=100.0)
    assert offset < 200_000
