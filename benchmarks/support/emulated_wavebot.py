"""The WaveBot's emulated devices, and a short campaign on their wires for injected faults."""

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.support.campaigns import open_checked, write_yaml
from benchmarks.support.control_client import ControlClient
from benchmarks.support.fault_runs import emulated_devices, free_port
from benchmarks.support.recorded import ROOT
from rig.execution.task import RunResult, View, run_task
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.hardware import job as hardware
from rig.kinds.wavebot.rehearsal import emulation
from rig.kinds.wavebot.tasks import execution_task
from rig.processes.child import Child
from rig.processes.run_types import ExecutionMode, Task
from rig.processes.wire_locks import wires_in

MOVING_SPEED = 0.05  # m/s of the body in heave
LONG_INTERVAL_S = 40.0  # s of a run whose powers are averaged over 30 s


class EmulatedWaveBot(NamedTuple):
    """Running emulated devices, and a campaign on their wires."""

    campaign: Campaign
    plan: Plan
    long_campaign: tuple[Campaign, Plan]  # the same, measuring for longer
    control: ControlClient
    devices: Child
    folder: Path
    interpreted: bool = False  # never run the tick compiled

    @property
    def task(self) -> Task:
        """The short campaign as a task."""
        return execution_task(self.campaign, self.plan)

    @property
    def io_processes(self) -> tuple[str, ...]:
        """Names of the I/O processes."""
        return tuple(one.name for one in hardware.build_job(self.campaign.rig).io_processes)

    def is_moving(self, row: Mapping[str, float]) -> bool:
        """Return True if the body heaves fast."""
        return abs(row["heave.estimate.velocity"]) > MOVING_SPEED

    def run(self, view: View, long: bool = False) -> RunResult:
        """Run the campaign on the devices in their present state."""
        campaign, plan = self.long_campaign if long else (self.campaign, self.plan)
        job = hardware.build_job(self.campaign.rig)
        wires = wires_in(self.campaign.rig)
        mode = ExecutionMode(
            "hil",
            True,
            "rig.kinds.wavebot.hardware.devices",
            job.devices,
            job.io_processes,
            wires,
            interpreted=self.interpreted,
        )
        return run_task(execution_task(campaign, plan), self.folder, view, mode)


def write_rig_file(folder: Path) -> Path:
    """Write the wired WaveBot with free ports, so that several can run on one host."""
    line = Path(tempfile.mkdtemp(prefix="wec-", dir=folder)) / "amplifiers"
    rig = {
        "extends": str(ROOT / "configs" / "rigs" / "wavebot_hil.yaml"),
        "wiring": {
            "can": {"options": {"port": free_port()}},
            "lines": {
                "analyser": {"port": free_port()},
                "io": {"port": free_port()},
                "amplifiers": {"port": str(line)},
            },
        },
    }
    return write_yaml(folder / "rig.yaml", rig)


def write_ethercat_rig_file(folder: Path) -> Path:
    """Write the WaveBot on EtherCAT with an interface of its own and free ports."""
    rig = {
        "extends": str(ROOT / "configs" / "rigs" / "wavebot_ethercat.yaml"),
        "wiring": {
            "ethercat": {"interface": f"wec{os.getpid()}"},
            "lines": {"analyser": {"port": free_port()}},
        },
    }
    return write_yaml(folder / "rig.yaml", rig)


def write_campaign_file(
    folder: Path, write_rig: Callable[[Path], Path] = write_rig_file, **keys: Any
) -> Path:
    """Write a campaign of a few seconds on a rig; ``keys`` replace keys of the file."""
    campaign = {
        "name": "fault",
        "rig": str(write_rig(folder)),
        "sea": {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
        "tare": {"duration_s": 1},
        "start": {"set_point_s": 0, "lead_in_s": 1},
        "timing": {"settle_s": 1, "interval_s": 5},
        "matrix": {"list": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}]},
        **keys,
    }
    return write_yaml(folder / "campaign.yaml", campaign)


@contextmanager
def emulated_wavebot(
    folder: Path, write_rig: Callable[[Path], Path] = write_rig_file, **keys: Any
) -> Iterator[EmulatedWaveBot]:
    """Run emulated devices while the context is open; ``keys`` replace keys of the campaign."""
    path = write_campaign_file(folder, write_rig, **keys)
    campaign, plan = open_checked(path)
    long_keys = {"extends": str(path), "timing": {"settle_s": 1, "interval_s": LONG_INTERVAL_S}}
    long = open_checked(write_yaml(folder / "long.yaml", long_keys))
    with emulated_devices(emulation.emulator_process(campaign), folder) as (control, devices):
        yield EmulatedWaveBot(campaign, plan, long, control, devices, folder)
