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


# The loop of a wired modular rig: its composed cycle, and a tick of its devices on a silent bus.
MODULAR = """
import json, sys, time
import rig.processes.loop_process
from controllers.signals import AxisCommand
from rig.kinds.modular.hardware.devices import ModularDevices, SensorSource
from rig.kinds.modular.tick import Composition, SensorPart, compose, find_kind
from rig.processes import mailbox
from rig.processes.mailbox import Mailbox
from rig.realtime import cycle
from rig.realtime.tick_memory import FlatMemory
from rig.wires.can_axes import CanAxes, CanAxesSettings
from rig.wires.drive_axes import HealthLimits
from rig.wires.messages import NodeHealth, message_fields, open_mailboxes
from drivers.cia402 import scaling, state_machine
from drivers.canopen.torque_axis import TorqueAxisSettings
from drivers.cia402.torque_drive import TorqueDriveSettings

class Bus:
    has_backlog = False
    def now(self): return time.monotonic()
    def drain(self): return []
    def send(self, frames): return ()
    def close(self): pass

default = Composition.default()
composition = default._replace(sensors=(SensorPart("dc_power", "W", False),))
cycle.make(find_kind(composition.to_text()))
fields = {"heave_health": message_fields(NodeHealth), "meter": (("dc", "W"), ("stamp", "s")),
          "inputs": (("e_stop", "flag"), ("limit_switch", "flag"), ("stamp", "s"))}
slots = open_mailboxes({name: (mailbox.create(), each) for name, each in fields.items()})
slots["meter"].post((7.0, time.monotonic()))
slots["inputs"].post((0, 0, time.monotonic()))
limits = state_machine.Deadlines(*[100] * len(state_machine.Deadlines._fields))
machine = state_machine.Params(0.2, 1, 1, 0, 20, limits)
drive = TorqueDriveSettings(machine, scaling.CurrentScale(100.0, 0.01, 4000), 1.0)
axis = TorqueAxisSettings(5, drive)
settings = CanAxesSettings(127, 0.05, HealthLimits(0.5, 0.5), 10, {"heave": axis}, {})
can = CanAxes(settings, Bus(), slots)
source = SensorSource("dc_power", "meter", 0, 2.0, 1.0)
devices = ModularDevices(can, slots, composition, [source], 20)
sense = devices.read(0.0)
assert sense.dc_power.value == 15.0 and 0.0 <= sense.dc_power.age < 5.0
command = compose(composition).Command(AxisCommand(0.0, 0.0, 0, 0), 0)
memory = FlatMemory(sense=sense, command=command)
place = memory.bytes_of("sense")
place[:] = bytes(b"\\x77" * len(place))
devices.use(memory); devices.read_in_place(0.0)  # no number of an earlier tick is left over
assert 0x7777777777777777 not in place.cast("q").tolist()
devices.write(command); devices.stop(0); devices.close()
print(json.dumps(sorted(sys.modules)))
"""


def test_the_loop_of_a_wired_modular_rig_imports_no_heavy_package() -> None:
    modules = set(json.loads(output(MODULAR)))
    assert {name.split(".")[0] for name in modules} & FOREIGN == set()
    prepared = ("rig.config", "rig.planning", "rig.kinds.modular.build", "rig.kinds.modular.config")
    assert {name for name in modules if name.startswith(prepared)} == set()


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
