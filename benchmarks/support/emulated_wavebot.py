"""The WaveBot's emulated devices, and a short campaign on their wires for injected faults."""

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.support.campaigns import write_yaml
from benchmarks.support.free_port import free_port
from benchmarks.support.recorded import ROOT
from rig.config.yaml_source import load_mapping
from rig.execution.emulated_rig import EmulatedRig, check_task, emulated_rig
from rig.execution.fault_table import load_table
from rig.kinds.interface import Tasks

TABLE = ROOT / "configs" / "faults" / "wavebot.yaml"


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
    task = load_table(TABLE).task
    campaign = {"extends": str(task), "rig": str(write_rig(folder)), **keys}
    return write_yaml(folder / "campaign.yaml", campaign)


@contextmanager
def emulated_wavebot(
    folder: Path, write_rig: Callable[[Path], Path] = write_rig_file, **keys: Any
) -> Iterator[EmulatedRig]:
    """Run emulated devices while the context is open; ``keys`` replace keys of the campaign."""
    path, table = write_campaign_file(folder, write_rig, **keys), load_table(TABLE)
    timing = load_mapping(table.long_task)[0]["timing"]
    long = write_yaml(folder / "long.yaml", {"extends": str(path), "timing": timing})
    tasks: Tasks = table.kind.room("tasks")
    short_task, long_task = check_task(tasks, path), check_task(tasks, long)
    with emulated_rig(table.kind, short_task, folder, long_task) as rig:
        yield rig
