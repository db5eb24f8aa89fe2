"""Rigs on emulated wires with their devices in a separate process, and runs of `rig` on them.

The wires are the only connection between a run and the devices, as on a rig.
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
from benchmarks.support.live_run import (
    LiveRun,
    TimeOutError,
    is_running,
    wait_realtime_free,
    wait_until,
)
from rig.emulation.control_client import ControlClient
from rig.execution.emulated_rig import EmulatedRig
from rig.execution.fault_runs import power_off_time
from rig.kinds.oswec_bench.tick.signals import BenchRow
from rig.kinds.wavebot.tick import WaveBotRow

ENVIRONMENT_MARK = "WEC_RIG_ATTACKED"  # in the environment of every process of a run


class WiredRig(NamedTuple):
    """A rig with running emulated devices, and the command that runs it."""

    name: str  # of its table of faults
    control: ControlClient
    arguments: tuple[str, ...]  # of `rig`
    row_type: type  # of the record
    io_processes: tuple[str, ...]  # names
    damping: float  # s, stop.duration_s of the rig file
    enabled_field: str  # row field: the drive is enabled
    moving_field: str  # row field that changes while the rig is damped

    def has_power(self) -> bool:
        """Return True if a motor has power now."""
        return None in self.control.request("power")["gone"].values()

    def power_off_time(self, timeout: float) -> float | None:
        """Return when the last motor lost its power (s, monotonic); None if one still has power."""
        return power_off_time(self.control, timeout)


def wired_wavebot(emulated: EmulatedRig) -> WiredRig:
    """Return the emulated WaveBot, with a campaign that damps it in waves for some seconds."""
    arguments = ("run", str(emulated.folder / "campaign.yaml"))
    fields = ("heave.sense.enabled", "heave.command.force")
    return WiredRig(
        "wavebot", emulated.control, arguments, WaveBotRow, emulated.io_processes, 2.0, *fields
    )


def wired_bench(emulated: EmulatedRig) -> WiredRig:
    """Return the emulated bench, with a session that oscillates its shaft for some seconds."""
    arguments = ("bench", str(emulated.folder / "session.yaml"))
    fields = ("servo.enabled", "servo.current")
    return WiredRig(
        "oswec_bench", emulated.control, arguments, BenchRow, emulated.io_processes, 1.0, *fields
    )


@contextmanager
def wavebot(folder: Path) -> Iterator[WiredRig]:
    """Emulate the WaveBot."""
    with emulated_wavebot(folder) as emulated:
        yield wired_wavebot(emulated)


@contextmanager
def oswec_bench(folder: Path) -> Iterator[WiredRig]:
    """Emulate the bench."""
    with emulated_bench(folder) as emulated:
        yield wired_bench(emulated)


WIRED_RIGS = {"wavebot": wavebot, "oswec_bench": oswec_bench}


@contextmanager
def start_run(rig: WiredRig, runs: Path) -> Iterator[LiveRun]:
    """Bring the devices to rest and start a run; kill its remaining processes on exit."""
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
    """Wait until a motor has power; raises TimeOutError if the run ends before."""

    def powered() -> bool:
        if run.process.poll() is not None:
            raise TimeOutError(f"no motor had power: {run.last_output_line()}")
        return rig.has_power()

    wait_until(powered, "power on a motor", interval=0.02)


def processes(runs: Path) -> dict[str, int]:
    """Return the process ids of a run by name: supervisor, loop, logger and I/O processes."""
    ids = {}
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
            ids[name or "supervisor"] = int(entry.name)
    return ids


def process_id(runs: Path, name: str) -> int:
    """Wait for one of a run's processes; return its process id."""
    wait_until(lambda: name in processes(runs), f"the process {name}", interval=0.01)
    return processes(runs)[name]


def wait_for_end(runs: Path, *, except_for: tuple[str, ...] = ()) -> None:
    """Wait until all processes of a run have ended, except those named.

    An ending process loses its mark before it releases its locks, so every process that was seen
    once must have ended.
    """
    seen = set[int]()

    def ended() -> bool:
        ids = processes(runs)
        excepted = {ids[name] for name in except_for if name in ids}
        seen.update(ids.values())
        return not any(is_running(pid) for pid in seen - excepted)

    wait_until(ended, f"the end of all processes except {except_for}")
