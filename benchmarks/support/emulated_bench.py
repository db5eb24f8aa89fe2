"""The bench's emulated devices, and a short session on their wires for injected faults."""

import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.support.campaigns import write_yaml
from benchmarks.support.free_port import free_port
from benchmarks.support.recorded import ROOT
from rig.execution.emulated_rig import EmulatedRig, check_task, emulated_rig
from rig.execution.fault_table import load_table


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
def emulated_bench(folder: Path) -> Iterator[EmulatedRig]:
    """Run emulated devices while the context is open, with a driveline session of some seconds."""
    table = load_table(ROOT / "configs" / "faults" / "oswec_bench.yaml")
    session = {"extends": str(table.task), "rig": str(write_rig_file(folder))}
    task = check_task(table.kind.room("tasks"), write_yaml(folder / "session.yaml", session))
    with emulated_rig(table.kind, task, folder, motion=table.motion) as rig:
        yield rig
