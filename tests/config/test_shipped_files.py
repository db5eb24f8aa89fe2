"""Names of shipped campaigns, sessions and rigs, and copies of their files."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rig.config.shipped_files import (
    CAMPAIGNS,
    KINDS,
    RIGS,
    SESSIONS,
    ShippedFile,
    UnknownNameError,
    copy_files,
    find_file,
    find_shipped,
    local_copies,
    referenced_files,
    shipped_files,
    shipped_folder,
    title,
)
from rig.kinds.oswec_bench.sessions.check import check_session
from rig.kinds.wavebot.campaign import check_campaign

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def found(name: str, *kinds: str) -> Path:
    file = find_file(Path(name), *kinds)
    return file.path if isinstance(file, ShippedFile) else file


def test_source_tree_ships_its_configs_folder() -> None:
    assert shipped_folder() == CONFIGS


def test_name_finds_the_shipped_file_of_a_kind() -> None:
    assert found("default", CAMPAIGNS) == CONFIGS / "campaigns" / "default.yaml"
    assert found("irregular", CAMPAIGNS) == CONFIGS / "campaigns" / "irregular.yaml"
    assert found("irregular", SESSIONS) == CONFIGS / "sessions" / "irregular.yaml"
    assert found("wavebot_hil", RIGS) == CONFIGS / "rigs" / "wavebot_hil.yaml"


def test_name_of_two_kinds_needs_its_kind() -> None:
    with pytest.raises(UnknownNameError, match="campaigns/irregular or sessions/irregular"):
        find_file(Path("irregular"), CAMPAIGNS, SESSIONS)
    assert found("sessions/irregular", CAMPAIGNS, SESSIONS) == CONFIGS / "sessions/irregular.yaml"


@pytest.mark.parametrize("path", ["no.yaml", "folder/no", "campaigns/no", "/no", ".", ".."])
def test_path_stays_a_path_even_if_nothing_is_there(path: str) -> None:
    assert find_file(Path(path), CAMPAIGNS) == Path(path)


def test_existing_file_comes_before_a_shipped_name() -> None:
    Path("default").write_text("name: mine\n")
    assert find_file(Path("default"), CAMPAIGNS) == Path("default")


def test_folder_does_not_hide_a_shipped_name() -> None:
    Path("default").mkdir()
    assert found("default", CAMPAIGNS) == CONFIGS / "campaigns" / "default.yaml"


def test_unknown_name_lists_the_names() -> None:
    with pytest.raises(UnknownNameError) as caught:
        find_file(Path("nothing"), CAMPAIGNS)
    text = str(caught.value)
    assert "nothing: no such file here, and no shipped campaign" in text
    assert "shipped campaigns: adaptive, csv_matrix, default, " in text
    assert "sessions" not in text


def test_unknown_name_points_to_the_file_or_kind_that_was_meant() -> None:
    Path("mine.yaml").touch()
    with pytest.raises(UnknownNameError, match=r"mine\.yaml is here: write the whole file name"):
        find_file(Path("mine"), CAMPAIGNS)
    with pytest.raises(UnknownNameError, match="a shipped session sessions/driveline"):
        find_file(Path("driveline"), CAMPAIGNS)


def test_edited_copies_are_noticed() -> None:
    shipped = find_shipped("default", CAMPAIGNS)
    assert local_copies(shipped) == []
    copied = copy_files(shipped.path, Path())
    assert local_copies(shipped) == [copied.main] == [Path("campaigns/default.yaml")]


@pytest.mark.parametrize("shipped", shipped_files(*KINDS), ids=lambda one: one.qualified_name)
def test_every_shipped_file_has_a_title(shipped: ShippedFile) -> None:
    text = title(shipped.path)
    assert len(text) > 10
    assert not text.endswith(".")


@pytest.mark.parametrize(
    "shipped", shipped_files(CAMPAIGNS, SESSIONS), ids=lambda one: one.qualified_name
)
def test_copy_holds_every_input_file(shipped: ShippedFile) -> None:
    """The check of the copy reads the same files as the check of the original, and no other."""
    copied = copy_files(shipped.path, Path("copy"))
    if shipped.kind == CAMPAIGNS:
        report = check_campaign(copied.main)
        files = report.campaign.files if report.campaign else ()
    else:
        session_report = check_session(copied.main)
        files = session_report.checked.files if session_report.checked else ()
    assert files
    for file in files:
        inside = file.path.resolve().relative_to(Path("copy").resolve())
        assert file.path.read_bytes() == (CONFIGS / inside).read_bytes()


def test_copy_brings_rig_limits_plant_and_its_data() -> None:
    copied = copy_files(find_shipped("default", CAMPAIGNS).path, Path("to/here"))
    assert sorted(map(str, copied.written)) == [
        "to/here/campaigns/default.yaml",
        "to/here/limits/wavebot.yaml",
        "to/here/plants/wavebot.yaml",
        "to/here/plants/wavebot_bem.npz",
        "to/here/plants/wavebot_surge_bem.npz",
        "to/here/rigs/wavebot.yaml",
    ]
    assert all(os.access(path, os.W_OK) for path in copied.written)


def test_matrix_and_record_are_referenced() -> None:
    names = {path.name for path in referenced_files(CONFIGS / "campaigns" / "csv_matrix.yaml")}
    assert "csv_matrix.csv" in names
    names = {path.name for path in referenced_files(CONFIGS / "campaigns" / "recorded.yaml")}
    assert "recorded_elevation.csv" in names


def test_copy_overwrites_nothing() -> None:
    default, quick = (find_shipped(name, CAMPAIGNS).path for name in ("default", "quick"))
    copy_files(default, Path())
    limits = Path("limits/wavebot.yaml")
    limits.write_text("edited\n")
    with pytest.raises(FileExistsError, match=r"limits/wavebot\.yaml: exists and differs"):
        copy_files(quick, Path())
    assert not Path("campaigns/quick.yaml").exists()
    copied = copy_files(quick, Path(), keep_existing=True)
    assert copied.written == [Path("campaigns/quick.yaml")]
    assert limits in copied.kept
    assert limits.read_text() == "edited\n"


def test_copy_twice_keeps_identical_files() -> None:
    path = find_shipped("quick", CAMPAIGNS).path
    first = copy_files(path, Path())
    repeated = copy_files(path, Path())
    assert repeated.written == []
    assert repeated.kept == first.written
