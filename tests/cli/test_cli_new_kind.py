"""`rig new kind`: names, files that exist, and texts that a linter accepts under any name."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from command_here import rig

from rig.kinds.new_kind import MAX_LENGTH, kind_files

ROOT = Path(__file__).resolve().parents[2]


def test_files_and_next_commands_are_reported(tmp_path: Path) -> None:
    report = json.loads(rig("new", "kind", "lift", "--folder", tmp_path, "--json").stdout)
    package = tmp_path / "wec_lift"
    assert set(map(Path, report["written"])) == {p for p in package.rglob("*") if p.is_file()}
    assert report["commands"][0] == f"pip install -e {package}"
    project = tomllib.loads((package / "pyproject.toml").read_text())["project"]
    assert project["entry-points"] == {
        "wec_rig.kinds": {"lift": "wec_lift"},
        "wec_rig.laws": {"lift": "wec_lift.law"},
    }
    assert (package / ".github" / "workflows" / "tests.yml").is_file()
    assert all("winch" not in path.read_text() for path in map(Path, report["written"]))
    shown = rig("new", "kind", "other", "--folder", tmp_path).stdout
    assert f"  rig run {tmp_path / 'wec_other' / 'configs' / 'holds.yaml'}\n" in shown


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Lift", "'Lift' cannot be the name of a kind; allowed [a-z][a-z0-9_]*, at most 24"),
        ("my-lift", "cannot be the name"),
        ("x" * (MAX_LENGTH + 1), "cannot be the name"),
        ("class", "'class' has another meaning in Python or YAML"),
        ("null", "'null' has another meaning in Python or YAML"),
        ("wavebot", "has a kind of rig 'wavebot' (rig.kinds.wavebot)"),
        ("latching", "has a law 'latching' (controllers.latching)"),
        ("rig", "a distribution wec-rig is installed"),
    ],
)
def test_names_that_cannot_be_used_are_refused(name: str, reason: str, tmp_path: Path) -> None:
    done = rig("new", "kind", name, "--folder", tmp_path)
    assert done.returncode == 2
    assert reason in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_importable_package_is_not_hidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "site" / "wec_taken").mkdir(parents=True)
    (tmp_path / "site" / "wec_taken" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path / "site")
    done = rig("new", "kind", "taken", "--folder", tmp_path)
    assert done.returncode == 2
    assert f"a package wec_taken exists ({tmp_path / 'site' / 'wec_taken'}" in done.stderr


def test_all_reasons_are_listed_and_no_file_is_overwritten(tmp_path: Path) -> None:
    mine = tmp_path / "wec_latching" / "README.md"
    mine.parent.mkdir()
    mine.write_text("mine")
    done = rig("new", "kind", "latching", "--folder", tmp_path, "--json")
    assert done.returncode == 2
    first, second = json.loads(done.stdout)["message"].splitlines()
    assert "has a law 'latching'" in first
    assert second == f"{mine}: exists; nothing is overwritten"
    assert mine.read_text() == "mine"
    assert list(mine.parent.iterdir()) == [mine]


@pytest.mark.parametrize("name", ["ab", "a_name_of_24_characters_"])
def test_files_pass_their_own_linter_under_any_name(name: str, tmp_path: Path) -> None:
    assert rig("new", "kind", name, "--folder", tmp_path).returncode == 0
    for command in (["check"], ["format", "--check"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, "--no-cache", "."],
            capture_output=True, text=True, check=False, cwd=tmp_path / f"wec_{name}",
        )  # fmt: skip
        assert done.returncode == 0, done.stdout


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no git checkout")
def test_every_file_of_the_example_is_in_the_new_package() -> None:
    root = ROOT / "rig" / "templates" / "kind"
    listed = subprocess.check_output(["git", "ls-files"], cwd=root, text=True).split()
    written = {path.as_posix() for path in kind_files("winch")}
    assert {f"wec_winch/{name}" for name in listed} <= written
