"""Rigs with a table of faults, and the paths of their results."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.support.emulated_bench import emulated_bench
from benchmarks.support.emulated_wavebot import emulated_wavebot, write_ethercat_rig_file
from benchmarks.support.recorded import ROOT
from rig.execution.emulated_rig import EmulatedRig
from rig.execution.fault_table import FaultRow, load_table


class FaultRig(NamedTuple):
    """One rig on emulated wires, and its table."""

    name: str  # of the table
    title: str
    emulate: Callable[[Path], AbstractContextManager[EmulatedRig]]
    safe_state: str  # condition at the end of the measured time
    stop_action: str  # the first action of a stop of category 1
    motion: str  # motion of the rig when a fault is injected
    test_file: str  # file of the test that runs the table
    results: Path  # results
    table: Path
    limits: str = ""  # name of the limits file without `_hil`; empty: that of the table

    def rows(self) -> list[FaultRow]:
        """Return all rows of the table."""
        return list(load_table(self.table).rows)


def _rig(name: str, **fields: Any) -> FaultRig:
    return FaultRig(
        name=name,
        results=ROOT / "benchmarks" / "results" / f"faults_measured_{name}.json",
        table=ROOT / "configs" / "faults" / f"{name}.yaml",
        **fields,
    )


RIGS = {
    "wavebot": _rig(
        "wavebot",
        title="Faults: reactions of the rig",
        emulate=emulated_wavebot,
        safe_state="neither motor has power, at the drives",
        stop_action="damps the body for 2 s",
        motion="Faults come 1.5 s after power on, in waves.",
        test_file="test_hil_faults.py",
    ),
    "wavebot_ethercat": _rig(
        "wavebot_ethercat",
        title="Faults of an EtherCAT segment: reactions of the rig",
        emulate=partial(emulated_wavebot, write_rig=write_ethercat_rig_file),
        safe_state="neither motor has power, at the drives",
        stop_action="damps the body for 2 s",
        motion="Faults come 1.5 s after power on, in waves.",
        test_file="test_hil_ethercat_faults.py",
        limits="wavebot",
    ),
    "oswec_bench": _rig(
        "oswec_bench",
        title="Faults of the OSWEC bench: reactions of the rig",
        emulate=emulated_bench,
        safe_state="the servo has no power, at the drive",
        stop_action="brings the shaft to rest for 1 s",
        motion="Faults come 1.5 s after power on, while the shaft still stands; those in motion "
        "come while it turns at more than half of its highest speed, 0.7 rad/s.",
        test_file="test_hil_bench_faults.py",
    ),
}
