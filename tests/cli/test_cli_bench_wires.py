"""`rig sim` and `rig devices` of the bench against each other, on ports and ptys of their own."""

from __future__ import annotations

import json
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from rich.console import Console
from ruamel.yaml import YAML
from wired_rig import CONFIGS, rig, running

from rig.cli import BAD_INPUT, FAILED, OK
from rig.cli.bench import BenchOptions
from rig.cli.bench import main as bench
from rig.cli.bench_devices_view import drawn
from rig.cli.devices import main as devices
from rig.config import load
from rig.config.bench_rig_file import BenchRigFile
from rig.execution.hardware.bench_job import job_of_bench
from rig.execution.hardware.bench_survey import survey_bench
from rig.host.finding import Host, Verdict
from rig.host.rig_wires import findings

SESSION = CONFIGS / "sessions" / "driveline_short.yaml"


class Sim(NamedTuple):
    folder: Path
    path: Path  # rig file
    told: dict[str, Any]


def rig_file(folder: Path) -> Path:
    """The bench on wires, elsewhere."""
    kinds = (socket.SOCK_STREAM, socket.SOCK_STREAM, socket.SOCK_DGRAM)
    held = [socket.socket(type=kind) for kind in kinds]
    for one in held:
        one.bind(("127.0.0.1", 0))
    outputs, io, cell = (one.getsockname()[1] for one in held)
    for one in held:
        one.close()
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
    """Emulated devices for all tests of this file; nobody commands them."""
    folder = tmp_path_factory.mktemp("wires")
    path = rig_file(folder)
    with running(path) as told:
        yield Sim(folder, path, told)


@pytest.fixture(autouse=True)
def own_lock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lock on the real clock of its own: other tests of this host may hold the one there is."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def test_sim_tells_every_address_and_what_hangs_there(sim: Sim) -> None:
    assert sim.told["status"] == "ready"
    found = [one["name"] for one in sim.told["devices"]]
    assert found == ["encoders", "servo", "load_cell", "analog", "inputs", "brake"]
    addresses = {one["name"]: one["address"] for one in sim.told["devices"]}
    assert addresses["encoders"] == str(sim.folder / "encoders")
    assert addresses["analog"].startswith("127.0.0.1:")


def test_a_second_sim_is_refused_and_names_what_is_taken(sim: Sim) -> None:
    second = rig("sim", sim.path, "--json")
    out, _ = second.communicate(timeout=120)
    assert second.returncode == FAILED
    said = json.loads(out)["message"]
    for name in ("line outputs: ", "line io: ", "load cell: ", "encoders: ", "servo: "):
        assert name in said
    assert (sim.folder / "servo").exists()  # the first one's is left alone


def test_all_devices_answer(sim: Sim, capsys: pytest.CaptureFixture[str]) -> None:
    code = devices(sim.path, only_listen=False, objects=False, as_json=True)
    told = json.loads(capsys.readouterr().out)
    assert (code, told["trouble"]) == (OK, [])
    streams = {one["name"]: one for one in told["streams"]}
    assert list(streams) == ["encoders", "servo", "load_cell"]
    assert all(one["answers"] for one in streams.values())
    assert streams["servo"]["identity"].startswith("Compax3")
    counts = {value["name"]: value["value"] for value in streams["encoders"]["values"]}
    assert counts == {"motor": 31415, "shaft": 271828}  # configs/plants/oswec_bench.yaml, at rest
    units = {unit["name"]: unit for line in told["lines"] for unit in line["units"]}
    assert set(units) == {"inputs", "brake", "analog"}
    assert [value["value"] for value in units["inputs"]["values"]] == [0.0, 0.0]
    assert units["analog"]["told"]


def test_looking_powers_nothing_and_writes_nothing(sim: Sim) -> None:
    """The servo drive is asked for its name and two records of values, and no more."""
    job = job_of_bench(load(sim.path, BenchRigFile)[0])
    for _ in range(2):
        found = {one.name: one for one in survey_bench(job).streams}
        values = {value.name: value.value for value in found["servo"].values}
        assert values["powered"] == 0.0


def test_what_is_drawn_is_never_cut(sim: Sim) -> None:
    found = survey_bench(job_of_bench(load(sim.path, BenchRigFile)[0]))
    for width in (80, 120):
        console = Console(width=width, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
        console.print(drawn("Wires of a test", found))
        text = console.export_text()
        console.file.close()
        assert "…" not in text
        for words in ("31415 count", "271828 count", "Compax3", "All answer"):
            assert words in text


def test_who_is_not_there_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = rig_file(tmp_path)
    code = devices(path, only_listen=False, objects=False, as_json=True)
    trouble = json.loads(capsys.readouterr().out)["trouble"]
    assert code == FAILED
    assert any(one.startswith("encoders at ") and "is not there" in one for one in trouble)
    assert any(one.startswith("servo at ") for one in trouble)
    assert any(one.startswith("load_cell at 127.0.0.1") for one in trouble)
    assert any(one.startswith("line outputs at 127.0.0.1") for one in trouble)


def test_the_doctor_looks_at_a_benchs_wires(sim: Sim, tmp_path: Path) -> None:
    rig_there, _ = load(sim.path, BenchRigFile)
    found = {one.what: one.verdict for one in findings(Host(), rig_there)}
    assert found == {
        "encoder bridge": Verdict.GOOD, "servo drive": Verdict.GOOD, "line outputs": Verdict.GOOD,
        "line io": Verdict.GOOD, "load cell": Verdict.NOTE,
    }  # fmt: skip
    nobody, _ = load(rig_file(tmp_path), BenchRigFile)
    found = {one.what: one.verdict for one in findings(Host(), nobody)}
    assert found["servo drive"] == found["line io"] == Verdict.WARNING  # `rig sim` may come


def test_a_bench_without_wires_has_nothing_to_emulate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bench(SESSION, tmp_path, BenchOptions(None, False, True), as_json=True) == BAD_INPUT
    assert "no wiring to hang emulated devices on" in capsys.readouterr().out
