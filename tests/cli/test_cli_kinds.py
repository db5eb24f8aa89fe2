"""Kinds of rig: their rooms, their commands, and the kind of a campaign's or session's file."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from command_here import rig

from rig.kinds import registry
from rig.kinds.interface import PROTOCOLS
from rig.kinds.rig_file import kind_of_task

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def test_every_room_has_a_protocol_with_its_names() -> None:
    described = {
        room: {name for name in (*vars(protocol), *protocol.__annotations__) if name[0] != "_"}
        for room, protocol in PROTOCOLS.items()
    }
    assert described == {room: set(names) for room, names in registry.ROOMS.items()}


@pytest.mark.parametrize("name", registry.OWN_PACKAGES)
def test_own_kinds_have_every_room(name: str) -> None:
    assert registry.interface_problem(registry.find(name)) == ""


def plug_in(folder: Path, room: str) -> dict[str, str]:
    """Install a kind of another distribution with a room `commands`; return the environment."""
    package = folder / "my_rig"
    package.mkdir()
    (package / "__init__.py").write_text('"""A rig of mine."""\n')
    (package / "commands.py").write_text(room)
    (package / "polish.py").write_text(
        "def command(times: int = 2) -> int:\n"
        '    """Polish the rig."""\n'
        '    print(f"polished {times} times")\n'
        "    return 1\n"
    )
    info = folder / "my_rig-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-rig\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{registry.GROUP}]\nmy rig = my_rig\n")
    return os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}


def run(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "rig", *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_a_kind_adds_its_commands(tmp_path: Path) -> None:
    table = 'COMMANDS = (Command("polish", "my_rig.polish", "Polish the rig."),)\n'
    environment = plug_in(tmp_path, f"from rig.kinds.registry import Command\n{table}")
    assert "Polish the rig." in run(environment, "--help").stdout
    done = run(environment, "polish", "--times", "3")
    assert (done.returncode, done.stdout) == (1, "polished 3 times\n")


def test_a_broken_kind_breaks_no_command(tmp_path: Path) -> None:
    environment = plug_in(tmp_path, "raise ImportError('not here')\n")
    done = run(environment, "--help")
    assert done.returncode == 0
    assert "spring-map" in done.stdout
    assert "my_rig.tick" in run(environment, "kinds").stdout  # a missing room


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("rig: {configs}/rigs/oswec_bench.yaml\n", "oswec bench"),
        ("rig: {configs}/rigs/wavebot.yaml\n", "wavebot"),
        ("session: driveline\nname: x\nperiods: 2\n", "oswec bench"),  # by its keys
        ("name: x\nsea: {{kind: calm}}\nmatrix: {{}}\n", "wavebot"),
        ("rig: [no, name]\nsession: driveline\n", "oswec bench"),
    ],
)
def test_the_kind_of_a_file(text: str, kind: str, tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    path.write_text(text.format(configs=CONFIGS))
    assert kind_of_task(path).name == kind
    bench = CONFIGS / "rigs" / "oswec_bench.yaml"
    assert kind_of_task(path, bench).name == "oswec bench"


MODULAR_CAMPAIGN = "name: x\nrig: rig.yaml\nsea: {kind: calm}\nmatrix: {grid: [{kp: 1}]}\n"


@pytest.mark.parametrize("command", ["check", "run", "sweep"])
@pytest.mark.parametrize(
    ("rig_text", "problem"),
    [
        ("kind: nope\n", "rig.yaml:1: kind: 'nope' is not known; allowed {known}"),
        ("kind: [modular]\n", "rig.yaml:1: kind: a list is not known; allowed {known}"),
        ("name: x\n", "rig.yaml:1: kind: missing; allowed {known}"),
        ("kind: modular\naxes: [1\n", "rig.yaml:3: YAML syntax: expected"),
        ("- kind: modular\n", "rig.yaml:1: "),
        (None, "file.yaml:2: rig: "),
    ],
)
def test_a_rig_file_without_a_usable_kind_is_the_only_problem(
    command: str, rig_text: str | None, problem: str, tmp_path: Path
) -> None:
    """The columns and keys of the campaign are those of no kind."""
    path = tmp_path / "file.yaml"
    path.write_text(MODULAR_CAMPAIGN)
    if rig_text is not None:
        (tmp_path / "rig.yaml").write_text(rig_text)
    done = rig(command, path)
    text = problem.format(known=", ".join(registry.known()))
    assert done.returncode == 2
    assert done.stdout == ""
    assert text in done.stderr
    _, *further = done.stderr.splitlines()
    assert all(line.startswith("more checks follow") for line in further)


def test_json_of_a_rig_file_without_a_usable_kind(tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    path.write_text(MODULAR_CAMPAIGN)
    (tmp_path / "rig.yaml").write_text("kind: nope\n")
    report = json.loads(rig("check", path, "--json").stdout)
    (problem,) = report["problems"]
    assert (report["ok"], problem["key"], problem["value"]) == (False, "kind", "nope")


def test_a_run_of_a_missing_file_is_refused(tmp_path: Path) -> None:
    done = rig("run", tmp_path / "none.yaml", "--json")
    assert done.returncode == 2
    assert '"status": "bad input"' in done.stdout
