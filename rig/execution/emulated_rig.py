"""A rig whose emulated devices outlive its runs: the same devices serve many runs of a short task.

`rig run --sim` starts the devices with each run instead. The devices are brought to rest and
switched on by their control port (`rig.emulation.control`).
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from rig.config.wiring import wiring_of
from rig.emulation.control_client import ControlClient
from rig.execution.fault_table import Motion
from rig.execution.task import RunResult, View, run_task
from rig.kinds.interface import Tasks
from rig.kinds.registry import RigKind
from rig.processes.io_processes import IoProcess, IoProcesses
from rig.processes.run_types import Task
from rig.realtime.sequence import MEASURE

_START_TIMEOUT_S = 120.0  # the plant is compiled first, on a busy host
_NAME = "emulation"  # of the process: not that of the devices of a single run
_END_TIMEOUT_S = 5.0


class CheckedTask(NamedTuple):
    """A campaign or session without problems, and its plan."""

    checked: Any  # `rig.kinds.interface.Checked`
    plan: Any  # `rig.kinds.interface.CheckedPlan`


class EmulatedRig(NamedTuple):
    """A rig with running emulated devices, and a task on its wires."""

    tasks: Tasks  # room of the kind of rig
    short: CheckedTask
    long: CheckedTask  # for faults whose detection is slow
    control: ControlClient
    folder: Path  # of the runs
    motion: Motion | None = None
    interpreted: bool = False  # never run the tick compiled

    @property
    def task(self) -> Task:
        """The short task."""
        return self.tasks.execution_task(*self.short)

    @property
    def io_processes(self) -> tuple[str, ...]:
        """Names of the I/O processes."""
        mode = self.tasks.wired_mode(self.short.checked, emulated=False)
        return tuple(each.name for each in mode.io_processes)

    def is_moving(self, row: Mapping[str, float]) -> bool:
        """Return True if the row of the record fulfils the table's condition of motion."""
        motion = self.motion
        return (
            motion is not None
            and row["plan.phase"] == MEASURE
            and abs(row[motion.field]) > motion.above
        )

    def run(self, view: View, long: bool = False) -> RunResult:
        """Run the short or the long task on the devices in their present state."""
        chosen = self.long if long else self.short
        mode = self.tasks.wired_mode(chosen.checked, emulated=False)
        mode = mode._replace(name="hil", interpreted=self.interpreted)
        return run_task(self.tasks.execution_task(*chosen), self.folder, view, mode)


def check_task(tasks: Tasks, path: Path, rig: Path | None = None) -> CheckedTask:
    """Return a campaign or session; ``rig`` replaces the rig that it names.

    Raises ValueError with the problems of its files, WiringError if its rig has no wiring.
    """
    report = tasks.examine(path, rig)
    if report.checked is None or report.plan is None:
        raise ValueError(report.text())
    wiring_of(report.checked.rig)
    return CheckedTask(report.checked, report.plan)


@contextmanager
def emulated_rig(
    kind: RigKind,
    short: CheckedTask,
    folder: Path,
    long: CheckedTask | None = None,
    motion: Motion | None = None,
) -> Iterator[EmulatedRig]:
    """Run the emulated devices of a task while the context is open; runs are in ``folder``.

    Raises WiringError if the wires must not be powered, IoProcessError with the reason if the
    devices do not start. The log must have the field of ``motion``.
    """
    tasks: Tasks = kind.room("tasks")
    with running_devices(emulator_process(tasks, short), folder) as control:
        yield EmulatedRig(tasks, short, long or short, control, folder, motion)


def emulator_process(tasks: Tasks, task: CheckedTask) -> IoProcess:
    """Return the process of a task's emulated devices; WiringError as of `emulated_rig`."""
    processes = tasks.wired_mode(task.checked, emulated=True).io_processes
    (emulator,) = (each for each in processes if each.starts_first)
    return emulator


@contextmanager
def running_devices(emulator: IoProcess, folder: Path) -> Iterator[ControlClient]:
    """Run emulated devices while the context is open; yield the client of their control port.

    Their standard error is `emulation.stderr` in ``folder``. Raises IoProcessError with the reason
    if they do not start.
    """
    process = emulator._replace(name=_NAME, ready_timeout_s=_START_TIMEOUT_S)
    devices = IoProcesses((process,), folder)
    try:
        devices.start()
        with ControlClient(str(devices.facts[_NAME]["control"])) as control:
            yield control
    finally:
        devices.end(_END_TIMEOUT_S)
