"""A sea in its own file: merging, changes, replacement, and problems with file and line."""

from __future__ import annotations

from pathlib import Path

import pytest

from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load
from rig.config.sea import PinkSea
from rig.config.yaml_source import SourceLocation, load_mapping
from rig.kinds.wavebot.config.campaign_file import CampaignFile

SEA = "kind: pink\nhm0_m: 0.2\nseed: 4\n"
HEAD = "name: x\nrig: rig.yaml\ndevice: absent\n"


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def reported_problems(path: Path) -> list[tuple[str, int, str, str]]:
    with pytest.raises(ConfigError) as error_info:
        load(path, CampaignFile)
    return [(Path(p.file).name, p.line, p.key, p.message) for p in error_info.value.problems]


def test_a_sea_can_be_the_name_of_a_file(tmp_path: Path) -> None:
    sea = write(tmp_path, "seas/pink.yaml", SEA)
    top = write(tmp_path, "campaigns/a.yaml", HEAD + "sea: ../seas/pink.yaml\n")
    file, locate = load(top, CampaignFile)
    assert isinstance(file.sea, PinkSea)
    assert (file.sea.hm0_m, file.sea_seed(1)) == (0.2, 4)
    assert locate(("sea", "hm0_m")) == SourceLocation(sea, 2)
    assert locate(("sea", "missing")) == SourceLocation(sea, 1)
    assert locate(("rig",)) == SourceLocation(top, 2)
    assert (locate.files, locate.inlined) == ((top, sea), {sea: "sea"})
    assert locate.resolve_path(("sea", "kind"), "record.csv") == tmp_path / "seas" / "record.csv"


def test_problems_of_a_sea_are_reported_in_its_file(tmp_path: Path) -> None:
    write(tmp_path, "pink.yaml", "kind: pink\nhm0_m: 2\nsead: 4\n")
    problems = reported_problems(write(tmp_path, "a.yaml", HEAD + "order: never\nsea: pink.yaml\n"))
    assert [(file, line, key) for file, line, key, _ in problems] == [
        ("a.yaml", 4, "order"),
        ("pink.yaml", 2, "sea.hm0_m"),
        ("pink.yaml", 3, "sea.sead"),
    ]
    assert "allowed 0.001 .. 1 m" in problems[1][3]
    write(tmp_path, "pink.yaml", "kind: pink\n")
    assert reported_problems(tmp_path / "a.yaml")[0][:3] == ("a.yaml", 4, "order")
    write(tmp_path, "pink.yaml", "kind: [pink\n")
    assert reported_problems(tmp_path / "a.yaml")[0][0] == "pink.yaml"


def test_a_missing_sea_file_is_reported(tmp_path: Path) -> None:
    top = write(tmp_path, "a.yaml", HEAD + "sea: seas/pink.yaml\n")
    ((file, line, key, message),) = reported_problems(top)
    assert (file, line, key) == ("a.yaml", 4, "sea")
    assert message.endswith(
        "seas/pink.yaml: No such file or directory; allowed a mapping or the path of a file, "
        "relative to this one, or the name of a shipped sea"
    )


def test_a_sea_file_may_extend_another(tmp_path: Path) -> None:
    base = write(tmp_path, "seas/pink.yaml", SEA)
    other = write(tmp_path, "seas/high.yaml", "extends: pink.yaml\nhm0_m: 0.3\n")
    top = write(tmp_path, "a.yaml", HEAD + "sea: seas/high.yaml\n")
    file, locate = load(top, CampaignFile)
    assert isinstance(file.sea, PinkSea)
    assert (file.sea.hm0_m, file.sea.seed) == (0.3, 4)
    assert locate(("sea", "hm0_m")) == SourceLocation(other, 2)
    assert locate(("sea", "seed")) == SourceLocation(base, 3)
    assert locate.files == (top, other, base)
    other.write_text("extends: ../a.yaml\n")
    assert "files extend in a circle" in reported_problems(top)[0][3]


def test_one_key_of_an_inherited_sea_file_can_be_changed(tmp_path: Path) -> None:
    sea = write(tmp_path, "seas/pink.yaml", SEA)
    base = write(tmp_path, "base/a.yaml", HEAD + "sea: ../seas/pink.yaml\n")
    top = write(tmp_path, "b.yaml", "extends: base/a.yaml\nsea: {realisation: 2}\n")
    file, locate = load(top, CampaignFile)
    assert isinstance(file.sea, PinkSea)
    assert (file.sea.hm0_m, file.sea.seed, file.sea.realisation) == (0.2, 4, 2)
    assert locate(("sea", "realisation")) == SourceLocation(top, 2)
    assert locate(("sea", "seed")) == SourceLocation(sea, 3)
    assert (locate.files, locate.inlined) == ((top, base, sea), {sea: "sea"})


def test_another_file_replaces_an_inherited_sea_entirely(tmp_path: Path) -> None:
    write(tmp_path, "pink.yaml", SEA)
    other = write(tmp_path, "other.yaml", "kind: pink\nhm0_m: 0.1\n")
    base = write(tmp_path, "base.yaml", HEAD + "sea: pink.yaml\n")
    top = write(tmp_path, "top.yaml", "extends: base.yaml\nsea: other.yaml\n")
    mapping, locate = load_mapping(top, inline=("sea",))
    assert mapping["sea"] == {"kind": "pink", "hm0_m": 0.1}  # without the seed of the replaced file
    assert (locate.files, locate.inlined) == ((top, other, base), {other: "sea"})
    written = write(tmp_path, "written.yaml", "extends: base.yaml\nsea: {kind: calm}\n")
    mapping, locate = load_mapping(written, inline=("sea",))
    assert mapping["sea"] == {"kind": "calm"}
    assert locate.files == (written, base)


def test_only_a_sea_may_be_the_name_of_a_file(tmp_path: Path) -> None:
    write(tmp_path, "matrix.yaml", "csv: x.csv\n")
    text = "name: x\nrig: rig.yaml\nsea: {kind: calm}\nmatrix: matrix.yaml\n"
    assert reported_problems(write(tmp_path, "a.yaml", text))[0][1:3] == (4, "matrix")
