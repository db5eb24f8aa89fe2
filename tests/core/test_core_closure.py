"""The loop's process never imports a heavy or foreign package."""

from __future__ import annotations

import json

from core_process import output

FOREIGN = {
    "sim_plant", "numba", "yaml", "ruamel", "matplotlib", "pydantic", "xarray", "scipy", "numpy",
    "filterpy", "rich", "typer", "h5py", "mcap",
}  # fmt: skip

# A whole run of a bench, with all imports of the loop process and of a WaveBot's rows.
RUN = """
import json, sys
import rig.processes.loop_process, rig.kinds.wavebot.tick, rig.kinds
from core_kinds import BENCH
from core_runs import bench, bench_params, run
result = run(BENCH, bench_params(), bench())
assert result.error is None
print(json.dumps({"ticks": result.end.ticks, "modules": sorted(sys.modules)}))
"""


def test_the_running_loop_imports_no_heavy_package() -> None:
    report = json.loads(output(RUN))
    assert report["ticks"] > 400
    modules = set(report["modules"])
    assert {
        "rig.realtime.loop",
        "rig.realtime.cycle",
        "rig.recording.ring",
        "rig.processes.mailbox",
        "rig.realtime.clock",
        "rig.realtime.safety",
    } <= modules
    assert {name.split(".")[0] for name in modules} & FOREIGN == set()
    prepared = (
        "rig.config",
        "rig.planning",
        "rig.kinds.wavebot.build",
    )  # used before the loop starts
    assert {name for name in modules if name.startswith(prepared)} == set()


def test_the_import_check_detects_heavy_packages() -> None:
    """The same check finds filterpy and numpy in a process that designs an estimator."""
    code = (
        "import json, sys; from rig.design.estimator import design_with_filterpy; "
        "design_with_filterpy(2.5e-5, 0.5, 0.5, 0.001); print(json.dumps(sorted(sys.modules)))"
    )
    roots = {name.split(".")[0] for name in json.loads(output(code))}
    assert {"numpy", "filterpy", "scipy"} <= roots & FOREIGN
