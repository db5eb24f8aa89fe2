"""Rigs on emulated wires, their devices a process apart, and runs on them as a person starts them.

Nothing that is done to a run reaches the devices but by the wires, as on a rig.
"""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from benchmarks.support.emulated_bench import emulated_bench
from benchmarks.support.emulated_wavebot import emulated_wavebot
from benchmarks.support.fault_runs import power_off_time
from benchmarks.support.live_run import (
    LiveRun,
    TimeOutError,
    is_running,
    wait_realtime_free,
    wait_until,
)
from rig.emulation.control_client import ControlClient
from rig.kinds.oswec_bench.tick import BenchRow
from rig.kinds.wavebot.tick import WaveBotRow

ENVIRONMENT_MARK = "WEC_RIG_ATTACKED"  # in the environment of every process of a run


class WiredRig(NamedTuple):
    """A rig whose devices are there, and what can be run on it."""

    name: str  # of its table of faults
    control: ControlClient
    arguments: tuple[str, ...]  # of the command that runs it
    row_type: type  # of its record
    io_processes: tuple[str, ...]  # by name
    damping: float  # s, stop.duration_s of its rig file
    enabled_field: str  # field: its drive is on
    moving_field: str  # field that changes while it is damped

    def has_power(self) -> bool:
        """Whether a motor has power now."""
        return None in self.control.request("power")["gone"].values()

    def power_off_time(self, timeout: float) -> float | None:
        """When the last motor lost its power (s, monotonic); None if one still has it."""
        return power_off_time(self, timeout)


@contextmanager
def wavebot(folder: Path) -> Iterator[WiredRig]:
    """The WaveBot, damping in waves for some seconds."""
    with emulated_wavebot(folder) as made:
        words = ("run", str(folder / "campaign.yaml"))
        fields = ("heave.sense.enabled", "heave.command.force")
        yield WiredRig("wavebot", made.control, words, WaveBotRow, made.io_processes, 2.0, *fields)


@contextmanager
def oswec_bench(folder: Path) -> Iterator[WiredRig]:
    """The bench, its shaft turned to and fro for some seconds."""
    with emulated_bench(folder) as made:
        words = ("bench", str(folder / "session.yaml"))
        fields = ("servo.enabled", "servo.current")
        yield WiredRig(
            "oswec_bench", made.control, words, BenchRow, made.io_processes, 1.0, *fields
        )


WIRED_RIGS = {"wavebot": wavebot, "oswec_bench": oswec_bench}


@contextmanager
def start_run(rig: WiredRig, runs: Path) -> Iterator[LiveRun]:
    """A run on a rig whose devices are put to rest before; no process of it is left afterwards."""
    rig.control.request("restart")
    wait_realtime_free()
    command = [sys.executable, "-m", "rig", *rig.arguments, "--runs", str(runs), "--json"]
    with LiveRun(command, runs, {ENVIRONMENT_MARK: str(runs)}) as run:
        try:
            yield run
        finally:
            for pid in processes(runs).values():
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)


def wait_for_power(rig: WiredRig, run: LiveRun) -> None:
    """Wait until a motor has power; TimeOutError if the run ends before."""

    def look() -> bool:
        if run.process.poll() is not None:
            raise TimeOutError(f"no motor had power: {run.last_output_line()}")
        return rig.has_power()

    wait_until(look, "power on a motor", interval=0.02)


def processes(runs: Path) -> dict[str, int]:
    """Living processes of a run by name: supervisor, loop, logger, and its I/O processes."""
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            marked = f"{ENVIRONMENT_MARK}={runs}".encode() in (
                entry / "environ"
            ).read_bytes().split(b"\0")
            errors = Path(os.readlink(entry / "fd" / "2"))
        except OSError:
            continue
        if marked and is_running(int(entry.name)):
            name = errors.name.removesuffix(".stderr") if errors.suffix == ".stderr" else ""
            found[name or "supervisor"] = int(entry.name)
    return found


def process_id(runs: Path, name: str) -> int:
    """Process id of one of a run's processes, once it is there."""
    wait_until(lambda: name in processes(runs), f"the process {name}", interval=0.01)
    return processes(runs)[name]


def wait_for_end(runs: Path, *, except_for: tuple[str, ...] = ()) -> None:
    """Wait until no process of a run is left, but those named.

    One that is ending loses its mark before it gives back its locks, so those seen once count.
    """
    seen = set[int]()

    def gone() -> bool:
        found = processes(runs)
        kept = {found[name] for name in except_for if name in found}
        seen.update(found.values())
        return not any(is_running(pid) for pid in seen - kept)

    wait_until(gone, f"the end of all processes but {except_for}")
