"""The bench's emulated devices, and a short session on their wires for injected faults."""

import socket
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import pi, radians
from pathlib import Path
from typing import NamedTuple

from benchmarks.support.campaigns import write_yaml
from benchmarks.support.control_client import ControlClient
from benchmarks.support.fault_runs import emulated_devices, free_port
from benchmarks.support.recorded import ROOT
from rig.execution.task import RunResult, View, run_task
from rig.kinds.oswec_bench.rehearsal.emulation import emulator_process
from rig.kinds.oswec_bench.rehearsal.job import problems
from rig.kinds.oswec_bench.sessions.check import check_session
from rig.kinds.oswec_bench.sessions.files import Session
from rig.kinds.oswec_bench.sessions.plan import SessionPlan
from rig.kinds.oswec_bench.tasks import execution_task, wired_mode
from rig.processes.child import Child
from rig.processes.run_types import Task
from rig.realtime.sequence import MEASURE

AMPLITUDE_DEG, PERIOD_S = 10.0, 1.5
MOVING_SPEED = (
    0.5 * radians(AMPLITUDE_DEG) * 2.0 * pi / PERIOD_S
)  # rad/s: half of the highest speed


class EmulatedBench(NamedTuple):
    """Running emulated devices, and a session on their wires."""

    session: Session
    plan: SessionPlan
    control: ControlClient
    devices: Child
    folder: Path
    interpreted: bool = False  # never run the tick compiled

    @property
    def task(self) -> Task:
        """The session as a task."""
        return execution_task(self.session, self.plan)

    @property
    def io_processes(self) -> tuple[str, ...]:
        """Names of the I/O processes."""
        return tuple(one.name for one in wired_mode(self.session, emulated=False).io_processes)

    def is_moving(self, row: Mapping[str, float]) -> bool:
        """Return True if the shaft turns at more than half of its highest speed."""
        return row["plan.phase"] == MEASURE and abs(row["shaft.velocity"]) > MOVING_SPEED

    def run(self, view: View, long: bool = False) -> RunResult:
        """Run the session on the devices in their present state.

        ``long`` has no effect: every fault of the bench is detected in the short session.
        """
        mode = wired_mode(self.session, emulated=False)
        mode = mode._replace(name="hil", interpreted=self.interpreted)
        return run_task(self.task, self.folder, view, mode)


def write_rig_file(folder: Path) -> Path:
    """Write the wired bench with free ports, so that several can run on one host."""
    lines = Path(tempfile.mkdtemp(prefix="wec-", dir=folder))
    with socket.socket(type=socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        cell = receiver.getsockname()[1]
    wiring = {
        "encoders": {"port": str(lines / "encoders")},
        "servo": {"port": str(lines / "servo")},
        "load_cell": {"port": cell},
        "lines": {"outputs": {"port": free_port()}, "io": {"port": free_port()}},
    }
    shipped = str(ROOT / "configs" / "rigs" / "oswec_bench_hil.yaml")
    return write_yaml(folder / "bench_rig.yaml", {"extends": shipped, "wiring": wiring})


@contextmanager
def emulated_bench(folder: Path) -> Iterator[EmulatedBench]:
    """Run emulated devices while the context is open, with a driveline session of some seconds."""
    session = {
        "name": "fault",
        "session": "driveline",
        "rig": str(write_rig_file(folder)),
        "rows": [
            {"amplitude_deg": AMPLITUDE_DEG, "damping_n_m_s_per_rad": 62.5, "period_s": PERIOD_S}
        ],
        "tare": {"duration_s": 0.5},
        "timing": {"rise_s": 1.5, "settle_periods": 0, "periods": 4},
    }
    report = check_session(write_yaml(folder / "session.yaml", session), problems)
    if report.checked is None or report.plan is None:
        raise ValueError(report.text())
    with emulated_devices(emulator_process(report.checked), folder) as (control, devices):
        yield EmulatedBench(report.checked, report.plan, control, devices, folder)
