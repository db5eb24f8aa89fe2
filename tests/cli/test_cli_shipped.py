"""Commands on shipped campaigns, sessions and rigs by name, in an empty folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_here import rig

from rig.config.shipped_files import shipped_folder


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_campaigns_lists_rows_and_duration() -> None:
    done = rig("campaigns", "--json")
    assert done.returncode == 0
    listed = json.loads(done.stdout)
    campaigns = {one["name"]: one for one in listed["campaigns"]}
    assert campaigns["default"]["rows"] == 66
    assert campaigns["default"]["duration_s"] == 1465.5
    assert campaigns["default"]["title"].startswith("The default campaign")
    sessions = {one["name"]: one for one in listed["sessions"]}
    assert sessions["driveline"]["rows"] == 15
    rigs = {one["name"]: one["wired"] for one in listed["rigs"]}
    assert rigs["wavebot_hil"]
    assert not rigs["wavebot"]
    assert {"wavebot", "wavebot_linear"} <= {one["name"] for one in listed["plants"]}
    assert not any(one["problem"] for kind in ("campaigns", "sessions", "rigs", "plants")
                   for one in listed[kind])  # fmt: skip


def test_campaigns_prints_a_table() -> None:
    done = rig("campaigns")
    assert done.returncode == 0
    assert "driveline_short" in done.stdout
    assert "24 min 26 s" in done.stdout


def test_check_takes_names_of_campaigns_and_sessions() -> None:
    campaign = json.loads(rig("check", "quick", "--json").stdout)
    assert campaign["ok"]
    assert campaign["rows"] == 4
    session = json.loads(rig("check", "driveline_short", "--json").stdout)
    assert session["ok"]
    assert session["session"] == "driveline"


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "nothing"),
        ("run", "quick", "--rig", "nothing"),
        ("bench", "nothing"),
        ("check", "nothing"),
        ("sweep", "nothing"),
        ("devices", "nothing"),
        ("sim", "nothing"),
        ("doctor", "--rig", "nothing"),
        ("copy", "nothing"),
    ],
    ids=" ".join,
)
def test_unknown_name_lists_the_shipped_ones(arguments: tuple[str, ...]) -> None:
    done = rig(*arguments)
    assert done.returncode == 2
    assert "nothing: no such file here, and no shipped" in done.stderr
    assert "shipped " in done.stderr.splitlines()[-1]
    done = rig(*arguments, "--json")
    assert done.returncode == 2
    assert json.loads(done.stdout)["status"] == "bad input"


def test_copy_of_a_plant() -> None:
    """A name that a rig has, too, is that of the rig, whose copy has the plant."""
    linear = ["plants/wavebot.yaml", "plants/wavebot_bem.npz", "plants/wavebot_linear.yaml"]
    for name, written in (
        ("plants/wavebot_linear", linear),
        ("wavebot_linear", linear),
        ("plants/wavebot", linear[:2]),
        ("wavebot", ["limits/wavebot.yaml", *linear[:2], "rigs/wavebot.yaml"]),
    ):
        done = rig("copy", name, "--to", name, "--json")
        assert done.returncode == 0
        files = {str(Path(each).relative_to(name)) for each in json.loads(done.stdout)["written"]}
        assert files - {"plants/wavebot_surge_bem.npz"} == set(written)


def test_copied_campaign_can_be_edited_and_checked() -> None:
    done = rig("copy", "quick", "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["file"] == "campaigns/quick.yaml"
    limits = Path("limits/wavebot.yaml")
    limits.write_text("nonsense: 1\n")
    checked = json.loads(rig("check", "campaigns/quick.yaml", "--json").stdout)
    assert {problem["file"] for problem in checked["problems"]} == {str(limits)}
    assert json.loads(rig("check", "quick", "--json").stdout)["ok"]


def test_copy_refuses_to_overwrite_and_says_how_to_go_on() -> None:
    assert rig("copy", "quick").returncode == 0
    Path("rigs/wavebot.yaml").write_text("edited\n")
    done = rig("copy", "default")
    assert done.returncode == 2
    assert "rigs/wavebot.yaml: exists and differs" in done.stderr
    assert "--keep-existing" in done.stderr
    assert rig("copy", "default", "--keep-existing").returncode == 0
    assert rig("copy", "default", "--to", "elsewhere").returncode == 0
    assert Path("elsewhere/campaigns/default.yaml").is_file()


def test_shipped_campaign_is_used_with_a_note_of_the_copy() -> None:
    rig("copy", "quick")
    done = rig("check", "quick")
    assert done.returncode == 0
    note = "note: quick is the shipped campaign; for your file write campaigns/quick.yaml"
    assert note in done.stderr


def test_calibrations_default_to_the_shipped_ones() -> None:
    listed = json.loads(rig("calibration", "list", "--json").stdout)
    assert listed[0]["file"].startswith(str(shipped_folder()))
    own = Path("configs/calibrations")
    own.mkdir(parents=True)
    source = shipped_folder() / "calibrations" / "mask4_spring_rate_v1.yaml"
    (own / source.name).write_bytes(source.read_bytes())
    listed = json.loads(rig("calibration", "list", "--json").stdout)
    assert [one["file"] for one in listed] == [f"configs/calibrations/{source.name}"]


def test_missing_calibrations_folder_of_one_own_is_an_error() -> None:
    assert rig("calibration", "list", "--calibrations", "no/folder").returncode == 2
