"""What the loop's process holds in memory: none of the heavy or foreign packages, ever."""

from __future__ import annotations

import json

from core_process import output

FOREIGN = {
    "sim_plant", "numba", "yaml", "ruamel", "matplotlib", "pydantic", "xarray", "scipy", "numpy",
    "filterpy", "rich", "typer", "h5py", "mcap",
}  # fmt: skip

# A whole run of a bench, with everything the loop process imports and a WaveBot's rows beside.
RUN = """
import json, sys
import rig.processes.loop_process, rig.kinds.wavebot, rig.kinds
from core_kinds import BENCH
from core_runs import bench, bench_params, run
made = run(BENCH, bench_params(), bench())
assert made.error is None
print(json.dumps({"ticks": made.end.ticks, "modules": sorted(sys.modules)}))
"""


def test_the_running_loop_has_nothing_foreign_in_memory() -> None:
    said = json.loads(output(RUN))
    assert said["ticks"] > 400
    modules = set(said["modules"])
    assert {
        "rig.realtime.loop",
        "rig.realtime.cycle",
        "rig.recording.ring",
        "rig.processes.mailbox",
        "rig.realtime.clock",
        "rig.realtime.safety",
    } <= modules
    assert {name.split(".")[0] for name in modules} & FOREIGN == set()
    prepared = ("rig.config", "rig.planning", "rig.kinds.wavebot.build")  # before the loop starts
    assert {name for name in modules if name.startswith(prepared)} == set()


def test_the_look_finds_what_it_looks_for() -> None:
    """The same look at a process that designs an estimator sees filterpy and numpy."""
    code = (
        "import json, sys; from rig.design.estimator import designed; "
        "designed(2.5e-5, 0.5, 0.5, 0.001); print(json.dumps(sorted(sys.modules)))"
    )
    roots = {name.split(".")[0] for name in json.loads(output(code))}
    assert {"numpy", "filterpy", "scipy"} <= roots & FOREIGN
