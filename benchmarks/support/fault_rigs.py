"""Rigs with a table of faults, and the paths of their results and pages."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

from benchmarks.support.emulated_bench import emulated_bench
from benchmarks.support.emulated_wavebot import emulated_wavebot
from benchmarks.support.fault_runs import EmulatedRig
from benchmarks.support.fault_table import TABLES, FaultRow, read_rows
from benchmarks.support.recorded import ROOT


class FaultRig(NamedTuple):
    """One rig on emulated wires, and its table."""

    name: str  # of its table
    title: str
    emulate: Callable[[Path], AbstractContextManager[EmulatedRig]]
    page: Path  # of the documentation
    safe_state: str  # when it is safe, for people
    stop_action: str  # what a stop of category 1 does first
    motion: str  # motion of the rig when a fault comes
    test_file: str  # file of the test that runs the table
    results: Path  # results
    table: Path

    def rows(self) -> list[FaultRow]:
        """All rows of its table."""
        return read_rows(self.table)


def _rig(
    name: str,
    title: str,
    stage: Callable[[Path], AbstractContextManager[EmulatedRig]],
    page: str,
    without: str,
    stop: str,
    motion: str,
    test: str,
) -> FaultRig:
    measured = ROOT / "benchmarks" / "results" / f"faults_measured_{name}.json"
    table = TABLES / f"{name}.yaml"
    return FaultRig(
        name, title, stage, ROOT / "docs" / page, without, stop, motion, test, measured, table
    )


RIGS = {
    one.name: one
    for one in (
        _rig(
            "wavebot",
            "Faults: reactions of the rig",
            emulated_wavebot,
            "faults.md",
            "neither motor has power, at the drives",
            "damps the body for 2 s",
            "Faults come 1.5 s after power on, in waves.",
            "test_hil_faults.py",
        ),
        _rig(
            "oswec_bench",
            "Faults of the OSWEC bench: reactions of the rig",
            emulated_bench,
            "bench_faults.md",
            "the servo has no power, at the drive",
            "brings the shaft to rest for 1 s",
            "Faults come 1.5 s after power on, while the shaft still stands; those in motion come "
            "while it turns at more than half of its highest speed, 0.7 rad/s.",
            "test_hil_bench_faults.py",
        ),
    )
}
