"""A wheel in a virtual environment of its own does everything in an empty folder."""

from __future__ import annotations

import json
import signal
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from installation import ROOT, Installation, command, install, wheel_of
from wired_rig import ended, free_ports, ready

pytestmark = [pytest.mark.slow, pytest.mark.long]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel under test."""
    return wheel_of(tmp_path_factory)


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A virtual environment with the wheel."""
    return install(tmp_path_factory.mktemp("installed") / "venv", wheel)


@pytest.fixture
def installed(environment: Path, tmp_path: Path) -> Iterator[Installation]:
    """The installation; a command that writes into it fails its test."""
    installation = Installation(environment, tmp_path)
    before = installation.files()
    yield installation
    assert installation.files() == before


def test_wheel_holds_the_packages_and_their_data_alone(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    packages = {"controllers", "drivers", "rig", "sim_plant"}
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == packages
    assert {f"{package}/py.typed" for package in packages} <= set(names)
    shipped = {name.removeprefix("rig/") for name in names if name.startswith("rig/configs/")}
    expected = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "configs").rglob("*")
        if path.is_file() and path.suffix != ".pyc"
        if (path.parent.name, path.suffix) != ("plants", ".py")  # scripts that made the data
    }
    assert shipped == expected
    assert "rig/constraints.txt" in names


def test_wheel_names_its_program_and_its_commit(wheel: Path) -> None:
    archive = zipfile.ZipFile(wheel)
    (entry_points,) = (n for n in archive.namelist() if n.endswith("entry_points.txt"))
    assert b"rig = rig.__main__:main" in archive.read(entry_points)
    if (ROOT / ".git").exists():
        head = command("git", "-C", ROOT, "rev-parse", "HEAD").strip()
        assert json.loads(archive.read("rig/source.json"))["git"] == head


def test_names_lists_and_copies(installed: Installation) -> None:
    assert "campaigns" in installed.rig("--help")
    listed = installed.json("campaigns")
    assert Path(listed["folder"]) == installed.site / "rig" / "configs"
    assert {"default", "quick"} <= {one["name"] for one in listed["campaigns"]}
    problems = {
        one["name"]: one["problem"]
        for kind in ("campaigns", "sessions", "rigs", "plants")
        for one in listed[kind]
        if one["problem"]
    }
    assert list(problems) == ["adaptive"]  # which needs an extra
    assert "`pip install wec-rig[adaptive]`" in problems["adaptive"]
    assert installed.json("check", "default")["rows"] == 66
    assert "default" in installed.rig("check", "default")
    assert installed.json("calibration", "list")
    assert installed.rig("laws").startswith("impedance")
    assert installed.json("runs") == []
    assert "nothing: no such file here" in installed.start("run", "nothing").communicate()[1]
    assert list(installed.folder.iterdir()) == []
    for name in ("csv_matrix", "recorded", "mask4_run_139", "irregular_online", "spring_map"):
        copied = installed.json("copy", name, "--to", name)
        assert installed.json("check", copied["file"])["ok"]


def test_own_campaign_names_shipped_files(installed: Installation) -> None:
    own = installed.folder / "own.yaml"
    own.write_text("extends: quick\nname: own\nrig: wavebot\nplant: wavebot_linear\n")
    report = installed.json("check", own)
    assert report["ok"]
    shipped = installed.site / "rig" / "configs"
    files = {file["path"] for file in report["files"]}
    assert str(shipped / "plants" / "wavebot_linear.yaml") in files
    own.write_text("extends: quick\nname: own\nrig: wavebt\n")
    refused = installed.rig("check", own, "--json", code=2)
    assert "shipped rigs: oswec_bench, " in json.loads(refused)["message"]


def test_rehearsal_reports_the_installed_code(installed: Installation) -> None:
    ended_run = installed.json("run", "quick")
    assert ended_run["status"] == "complete"
    folder = installed.folder / ended_run["folder"]
    assert (folder / "surfaces.png").is_file()
    code = json.loads((folder / "code.json").read_text())
    source = json.loads((installed.site / "rig" / "source.json").read_text())
    assert code["installed"]
    assert (code["git"], code["dirty"]) == (source["git"], source["dirty"])
    assert installed.json("show", "last")["optima"]
    assert installed.json("replay", "last")["same"]


def test_edited_copy_runs_among_files_that_hide_modules(installed: Installation) -> None:
    """The user's own scripts may have the names of modules."""
    for name in ("signal.py", "drivers.py", "logging.py"):
        (installed.folder / name).write_text("raise SystemExit(7)\n")
    installed.rig("copy", "quick")
    campaign = installed.folder / "campaigns" / "quick.yaml"
    campaign.write_text(campaign.read_text().replace("name: quick", "name: mine"))
    ended_run = installed.json("run", "campaigns/quick.yaml")
    assert ended_run["status"] == "complete"
    assert ended_run["folder"].endswith("_mine")


def test_bench_session(installed: Installation) -> None:
    ended_run = installed.json("bench", "driveline_short")
    assert ended_run["status"] == "complete"
    assert (installed.folder / ended_run["folder"] / "calibration.yaml").is_file()


def test_sweep(installed: Installation) -> None:
    result = installed.json("sweep", "default", "--over", "sea.amplitude_m=0.05,0.1")
    assert result["rows"] == {"complete": 132}
    assert (installed.folder / result["result"]).is_file()


def wired_copy(installed: Installation) -> str:
    """Return the name of a rig file on free ports, after a copy of the shipped one."""
    installed.rig("copy", "wavebot_hil")
    ports = free_ports()
    pseudo_terminal = installed.folder / "amplifiers"
    rig = f"""\
        extends: rigs/wavebot_hil.yaml
        name: Wires of a test
        wiring:
          can: {{options: {{host: 127.0.0.1, port: {ports.can}, tcp_tune: true}}}}
          lines:
            analyser: {{port: {ports.analyser}, timeout_s: 0.5}}
            io: {{port: {ports.io}, timeout_s: 0.5}}
            amplifiers: {{port: {pseudo_terminal}}}
        limits: limits/wavebot_hil.yaml
        plant: plants/wavebot.yaml
        """
    (installed.folder / "rig.yaml").write_text(rig)
    return "rig.yaml"


def test_emulated_devices_answer(installed: Installation) -> None:
    rig = wired_copy(installed)
    sim = installed.start("sim", rig, "--json")
    try:
        assert ready(sim)["status"] == "ready"
        assert installed.rig("devices", rig).rstrip().endswith("their settings are correct.")
    finally:
        code, _, errors = ended(sim, signal.SIGINT)
    assert code == 0, errors


@pytest.mark.realtime
def test_campaign_on_emulated_devices(installed: Installation) -> None:
    rig = wired_copy(installed)
    (installed.folder / "one_row.yaml").write_text(
        """\
        name: one_row
        rig: rigs/wavebot.yaml
        sea: {kind: regular, amplitude_m: 0.05, frequency_hz: 0.5}
        start: {lead_in_s: 5}
        timing: {settle_s: 2, interval_s: 6}
        matrix:
          list:
            - {spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0}
        """
    )
    ended_run = installed.json("run", "one_row.yaml", "--rig", rig, "--sim")
    assert ended_run["status"] == "complete"


def test_new_kind_is_installed_and_runs(environment: Path, wheel: Path, tmp_path: Path) -> None:
    """From the wheel to a kind of one's own: `rig new kind`, pip, the commands, its tests."""
    command(environment / "bin" / "rig", "new", "kind", "lift", "--folder", tmp_path)
    package = tmp_path / "wec_lift"
    own = install(tmp_path / "venv", wheel, f"{package}[dev]")
    (tmp_path / "empty").mkdir()
    lab = Installation(own, tmp_path / "empty")
    listed = {each["name"]: each for each in lab.json("kinds")["kinds"]}
    assert (listed["lift"]["origin"], listed["lift"]["package"]) == ("wec-lift 0.1", "wec_lift")
    assert "problem" not in listed["lift"]
    for file in (package / "configs").iterdir():
        (lab.folder / file.name).write_bytes(file.read_bytes())
    lines = lab.rig("check", "holds.yaml").splitlines()
    assert (lines[0], lines[-1]) == ("2 holds in 16.6 s", "the session can be run")
    assert lab.json("run", "holds.yaml")["status"] == "complete"
    assert "row 1:" in lab.rig("show", "last")
    assert lab.json("replay", "last")["same"]
    done = subprocess.run(
        [own / "bin" / "python", "-m", "pytest", package],
        capture_output=True, text=True, check=False, cwd=lab.folder, env=lab.variables,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
