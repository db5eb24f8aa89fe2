"""Files that a file names: shipped names and paths of every form, for all keys of a campaign."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from mode_plants import CYLINDER

from rig.config.problems import ConfigError
from rig.config.shipped_files import KINDS, shipped_files
from rig.config.yaml_source import load_mapping
from rig.kinds.wavebot.tasks import examine
from rig.planning.input_files import ConfigSource, load_named_source

CONFIGS = Path(__file__).parents[2] / "configs"
PLANTS = CONFIGS / "plants"
SEA = "sea: {kind: regular, amplitude_m: 0.05, frequency_hz: 0.5}\n"
ROW = "matrix: {list: [{spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0}]}\n"
OWN = f"name: own\nrig: wavebot\n{SEA}{ROW}"


@pytest.fixture(autouse=True)
def _home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty working folder that is not that of the files, and a home folder."""
    for name in ("home", "elsewhere", "files"):
        (tmp_path / name).mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path / "elsewhere")


@pytest.fixture(name="write")
def of_write(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes a file beside the others and returns its path."""

    def write(text: str, name: str = "campaign.yaml") -> Path:
        path = tmp_path / "files" / name
        path.write_text(text)
        return path

    return write


def inputs(path: Path) -> dict[str, list[Path]]:
    """Return the input files of a campaign without problems, by role."""
    report = examine(path)
    assert report.ok, report.text()
    assert report.campaign is not None
    files: dict[str, list[Path]] = {}
    for each in report.campaign.files:
        files.setdefault(each.role, []).append(each.path)
    return files


def problem(path: Path) -> tuple[str, int, str, str]:
    """Return file, line, key and message of the only problem of a campaign."""
    try:
        (found,) = examine(path).problems
    except ConfigError as error:
        (found,) = error.problems
    return Path(found.file).name, found.line, found.key, found.message


def test_names_of_shipped_files(write: Callable[..., Path]) -> None:
    files = inputs(write(OWN + "plant: wavebot_linear\n"))
    assert files["rig"] == [CONFIGS / "rigs" / "wavebot.yaml"]
    assert files["plant"] == [PLANTS / "wavebot_linear.yaml", PLANTS / "wavebot.yaml"]
    files = inputs(write(OWN.replace(SEA, "sea: pink_0p254m\n")))
    assert files["sea"] == [CONFIGS / "seas" / "pink_0p254m.yaml"]


def test_a_file_extends_the_shipped_file_of_its_own_sort(write: Callable[..., Path]) -> None:
    """Campaign, rig, limits, plant and sea: four of the five are called wavebot."""
    limits = write("extends: wavebot\nheave: {position_warn_m: 0.2}\n", "limits.yaml")
    plant = write("extends: wavebot\nname: mine\n", "plant.yaml")
    rig = write("extends: wavebot\nlimits: limits.yaml\nplant: plant.yaml\n", "rig.yaml")
    sea = write("extends: pink_0p254m\nhm0_m: 0.1\n", "sea.yaml")
    write("extends: default\nname: mine\nrig: rig.yaml\nsea: sea.yaml\n")
    files = inputs(write("extends: default\nname: mine\nrig: rig.yaml\nsea: sea.yaml\n"))
    assert files["campaign"][1] == CONFIGS / "campaigns" / "default.yaml"
    for role, own in (("rig", rig), ("limits", limits), ("plant", plant)):
        assert files[role] == [own, CONFIGS / f"{role.removesuffix('s')}s" / "wavebot.yaml"]
    assert files["sea"] == [sea, CONFIGS / "seas" / "pink_0p254m.yaml"]
    replaced = examine(CONFIGS / "campaigns" / "default.yaml", rig)
    assert replaced.ok, replaced.text()


def test_an_existing_file_comes_before_a_shipped_name(write: Callable[..., Path]) -> None:
    own = write("extends: ../../configs/none.yaml\n", "wavebot")
    assert problem(write(OWN))[0] == own.name
    own.write_text((CONFIGS / "rigs" / "wavebot.yaml").read_text())
    own.write_text(f"extends: {CONFIGS}/rigs/wavebot.yaml\nname: mine\n")
    assert inputs(write(OWN))["rig"][0] == own
    own.unlink()
    own.mkdir()  # a folder is no such file
    assert inputs(write(OWN))["rig"] == [CONFIGS / "rigs" / "wavebot.yaml"]


@pytest.mark.parametrize("name", ["rig.yaml", "../other/rig.yaml", "ABSOLUTE", "~/rig.yaml"])
def test_every_form_of_a_path(write: Callable[..., Path], tmp_path: Path, name: str) -> None:
    """Relative to the file with the key, absolute, and from the home folder."""
    folder = {"rig.yaml": "files", "../other/rig.yaml": "other", "~/rig.yaml": "home"}
    place = tmp_path / folder.get(name, "absolute")
    place.mkdir(exist_ok=True)
    named = name.replace("ABSOLUTE", str(place / "rig.yaml"))
    (place / "rig.yaml").write_text("extends: wavebot\nname: mine\n")
    assert inputs(write(OWN.replace("wavebot", named)))["rig"][0] == place / "rig.yaml"
    (place / "base.yaml").write_text(OWN)
    base = named.replace("rig.yaml", "base.yaml")
    assert inputs(write(f"extends: {base}\n"))["campaign"][1] == place / "base.yaml"
    (place / "sea.yaml").write_text("kind: regular\namplitude_m: 0.05\nfrequency_hz: 0.5\n")
    sea = named.replace("rig.yaml", "sea.yaml")
    assert inputs(write(OWN.replace(SEA, f"sea: {sea}\n")))["sea"] == [place / "sea.yaml"]
    (place / "m.csv").write_text("spring_n_per_m,kp_n_s_per_m,ki_n_per_m\n490.9,-2000,0\n")
    matrix = f"matrix: {{csv: {named.replace('rig.yaml', 'm.csv')}}}\n"
    assert inputs(write(OWN.replace(ROW, matrix)))["matrix"] == [place / "m.csv"]
    for suffix in ("npz", "nc"):
        shutil.copy(PLANTS / f"wavebot_bem.{suffix}", place)
        bem = named.replace("rig.yaml", f"wavebot_bem.{suffix}")
        plant = write(f"extends: wavebot\nbem: {bem}\n", "plant.yaml")
        assert inputs(write(OWN + "plant: plant.yaml\n"))["plant"][0] == plant


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("rig", OWN.replace("wavebot", "NAME")),
        ("plant", OWN + "plant: NAME\n"),
        ("sea", OWN.replace(SEA, "sea: NAME\n")),
        ("extends", OWN + "extends: NAME\n"),
    ],
)
def test_names_of_nothing_are_refused(write: Callable[..., Path], key: str, text: str) -> None:
    line = next(i for i, each in enumerate(text.splitlines(), 1) if "NAME" in each)
    kind = {"rig": "rigs", "plant": "plants", "sea": "seas", "extends": "campaigns"}[key]
    *_, message = found = problem(write(text.replace("NAME", "nothing")))
    assert found[:3] == ("campaign.yaml", line, key)
    assert f"shipped {kind}: {', '.join(one.name for one in shipped_files(kind))}" in message
    for name, reason in (("none/x.yaml", "No such file"), ("../files", "Is a directory")):
        *_, message = found = problem(write(text.replace("NAME", name)))
        assert found[:3] == ("campaign.yaml", line, key)
        assert reason in message
        assert "relative to this one, or the name of a shipped" in message
    for name, reason in (('"a\\0b"', "no such file"), ("x" * 5000, "no such file")):
        *_, message = found = problem(write(text.replace("NAME", name)))
        assert found[:3] == ("campaign.yaml", line, key)
        assert reason in message
    for name in ("5", "[a]"):
        assert problem(write(text.replace("NAME", name)))[:3] == ("campaign.yaml", line, key)


@pytest.mark.parametrize(
    ("bem", "reason"),
    [
        ("none.npz", "none.npz: No such file or directory; allowed the path of a file"),
        (".", "Is a directory"),
        ("plant.yaml", "expected .npz or .nc"),
        ("5", "5 is not text"),
        (str(CYLINDER), "has 3 modes; expected heave alone"),
    ],
)
@pytest.mark.parametrize("key", ["bem", "surge.bem"])
def test_bem_files_that_cannot_be_used(
    write: Callable[..., Path], key: str, bem: str, reason: str
) -> None:
    text = f"bem: {bem}" if key == "bem" else f"surge: {{bem: {bem}}}"
    write(f"extends: wavebot\n{text}\n", "plant.yaml")
    *place, message = problem(write(OWN + "plant: plant.yaml\n"))
    assert place == ["plant.yaml", 2, key]
    assert reason in message


def test_a_file_that_lacks_its_ending_is_pointed_out(write: Callable[..., Path]) -> None:
    write("kind: calm\n", "mine.yaml")
    *_, message = problem(write(OWN.replace(SEA, "sea: mine\n")))
    assert message.startswith("mine.yaml is in this folder: write the whole file name")


def test_every_kind_of_shipped_file_can_be_named(tmp_path: Path) -> None:
    """Each key that may name a shipped file finds all files of its folder."""
    for key, kind in (("rig", "rigs"), ("plant", "plants"), ("limits", "limits"), ("sea", "seas")):
        assert kind in KINDS
        for one in shipped_files(kind):
            path = tmp_path / "names.yaml"
            path.write_text(f"{key}: {one.name}\n")
            source = load_named_source(ConfigSource(*load_mapping(path)), (key,))
            assert source is not None
            assert source.locate.path == one.path
