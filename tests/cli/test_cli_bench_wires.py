"""`rig devices` of the bench against the devices of `rig sim`, on free ports and ptys."""

from __future__ import annotations

import json
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from command_here import rig as rig_here
from rich.console import Console
from ruamel.yaml import YAML
from wired_rig import CONFIGS, rig, running

from rig.cli.devices import render
from rig.cli.output import BAD_INPUT, FAILED, OK
from rig.config.pydantic_errors import load
from rig.host.finding import Host, Verdict
from rig.host.wires import rig_findings
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.hardware.job import build_job
from rig.wires.survey import survey

SESSION = CONFIGS / "sessions" / "driveline_short.yaml"


class Sim(NamedTuple):
    folder: Path
    path: Path  # rig file
    message: dict[str, Any]  # of `rig sim` when ready


def rig_file(folder: Path) -> Path:
    """Write a rig file of the wired bench with free addresses."""
    kinds = (socket.SOCK_STREAM, socket.SOCK_STREAM, socket.SOCK_DGRAM)
    sockets = [socket.socket(type=kind) for kind in kinds]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    outputs, io, cell = (each.getsockname()[1] for each in sockets)
    for each in sockets:
        each.close()
    wiring = {
        "encoders": {"port": str(folder / "encoders")},
        "servo": {"port": str(folder / "servo")},
        "load_cell": {"port": cell},
        "lines": {"outputs": {"port": outputs}, "io": {"port": io}},
    }
    path = folder / "rig.yaml"
    with path.open("w") as file:
        shipped = str(CONFIGS / "rigs" / "oswec_bench_hil.yaml")
        YAML(typ="safe").dump({"extends": shipped, "wiring": wiring}, file)
    return path


@pytest.fixture(scope="module")
def sim(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sim]:
    """Emulated devices for all tests of this file; no test commands them."""
    folder = tmp_path_factory.mktemp("wires")
    path = rig_file(folder)
    with running(path) as message:
        yield Sim(folder, path, message)


@pytest.fixture(autouse=True)
def own_lock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Use a real-time lock of this test: other tests of this host may hold the common one."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def test_sim_lists_every_device_and_its_address(sim: Sim) -> None:
    assert sim.message["status"] == "ready"
    names = [device["name"] for device in sim.message["devices"]]
    assert names == ["encoders", "servo", "load_cell", "analog", "inputs", "brake"]
    addresses = {device["name"]: device["address"] for device in sim.message["devices"]}
    assert addresses["encoders"] == str(sim.folder / "encoders")
    assert addresses["analog"].startswith("127.0.0.1:")


def test_a_second_sim_is_refused_and_names_the_addresses_in_use(sim: Sim) -> None:
    second = rig("sim", sim.path, "--json")
    out, _ = second.communicate(timeout=120)
    assert second.returncode == FAILED
    message = json.loads(out)["message"]
    for name in ("line outputs: ", "line io: ", "load cell: ", "encoders: ", "servo: "):
        assert name in message
    assert (sim.folder / "servo").exists()  # that of the first sim


def test_all_devices_answer(sim: Sim) -> None:
    done = rig_here("devices", sim.path, "--json")
    report = json.loads(done.stdout)
    assert (done.returncode, report["trouble"]) == (OK, [])
    streams = {stream["name"]: stream for stream in report["streams"]}
    assert list(streams) == ["encoders", "servo", "load_cell"]
    assert all(stream["answers"] for stream in streams.values())
    assert streams["servo"]["identity"].startswith("Compax3")
    counts = {value["name"]: value["value"] for value in streams["encoders"]["values"]}
    assert counts == {"motor": 31415, "shaft": 271828}  # configs/plants/oswec_bench.yaml, at rest
    units = {unit["name"]: unit for line in report["lines"] for unit in line["units"]}
    assert set(units) == {"inputs", "brake", "analog"}
    assert [value["value"] for value in units["inputs"]["values"]] == [0.0, 0.0]
    assert units["analog"]["written_by_run"]


def test_a_survey_leaves_the_servo_unpowered(sim: Sim) -> None:
    """The survey reads only the servo drive's name and two records of values."""
    job = build_job(load(sim.path, BenchRigFile)[0])
    for _ in range(2):
        streams = {stream.name: stream for stream in survey(job).streams}
        values = {value.name: value.value for value in streams["servo"].values}
        assert values["powered"] == 0.0


def test_no_text_of_the_view_is_cut(sim: Sim) -> None:
    found = survey(build_job(load(sim.path, BenchRigFile)[0]))
    for width in (80, 120):
        console = Console(width=width, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
        console.print(render("Wires of a test", found, all_objects=False))
        text = console.export_text()
        console.file.close()
        assert "…" not in text
        for expected in ("31415 count", "271828 count", "Compax3", "All devices answer"):
            assert expected in text


def test_missing_devices_are_named(tmp_path: Path) -> None:
    path = rig_file(tmp_path)
    done = rig_here("devices", path, "--json")
    trouble = json.loads(done.stdout)["trouble"]
    assert done.returncode == FAILED
    assert any(text.startswith("encoders at ") and "is not there" in text for text in trouble)
    assert any(text.startswith("servo at ") for text in trouble)
    assert any(text.startswith("load_cell at 127.0.0.1") for text in trouble)
    assert any(text.startswith("line outputs at 127.0.0.1") for text in trouble)


def test_the_doctor_checks_the_wires_of_a_bench(sim: Sim, tmp_path: Path) -> None:
    emulated, _ = load(sim.path, BenchRigFile)
    verdicts = {finding.check: finding.verdict for finding in rig_findings(Host(), emulated)}
    assert verdicts == {
        "encoders": Verdict.GOOD, "servo": Verdict.GOOD, "line outputs": Verdict.GOOD,
        "line io": Verdict.GOOD, "load cell": Verdict.NOTE,
    }  # fmt: skip
    without_devices, _ = load(rig_file(tmp_path), BenchRigFile)
    verdicts = {finding.check: finding.verdict for finding in rig_findings(Host(), without_devices)}
    # Only warnings: `rig sim` may start later.
    assert verdicts["servo"] == verdicts["line io"] == Verdict.WARNING


def test_a_bench_without_wiring_cannot_be_emulated(tmp_path: Path) -> None:
    done = rig_here("bench", SESSION, "--runs", tmp_path, "--sim", "--json")
    assert done.returncode == BAD_INPUT
    assert "has no wiring, so no devices can be emulated" in done.stdout
