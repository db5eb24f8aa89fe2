"""Special files that a user names in place of a regular file are refused at once with a reason."""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from rig.config.law_settings import IMPEDANCE
from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load
from rig.config.yaml_source import SourceLocation, load_mapping
from rig.identification import bem, comparison
from rig.interop.legacy.table import read_table
from rig.interop.legacy.testlog import read_log
from rig.kinds.oswec_bench.sessions.files import open_session
from rig.kinds.rig_file import load_rig
from rig.kinds.wavebot.config import LimitsFile
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.kinds.wavebot.mask4.import_run import read_signals
from rig.planning import matrix_csv
from rig.recording.calibration import open_calibration
from rig.recording.channel_file import read_recording
from rig.recording.runs import RunError, mcap_file, open_run
from rig.regular_file import (
    MAX_CONFIG_BYTES,
    MAX_RECORD_BYTES,
    MAX_TABLE_BYTES,
    MB,
    open_regular,
    read_regular,
)
from sim_plant.bem import read_bem

Read = Callable[[Path], Any]
NAMED_AT = SourceLocation(Path("campaign.yaml"), 3)


@pytest.fixture(autouse=True)
def time_limit() -> Iterator[None]:
    """Fail a test within 20 s if a reader blocks on a FIFO or reads a device without end."""

    def time_out(*_: object) -> None:
        raise AssertionError("the reader blocks")

    before = signal.signal(signal.SIGALRM, time_out)
    signal.alarm(20)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def load_extending_file(path: Path) -> Any:
    """Load a file that extends the given file."""
    child = path.with_name("child.yaml")
    child.write_text(f"extends: {path.name}\n")
    return load_mapping(child)


READERS: dict[str, tuple[str, Read, int | None]] = {  # suffix, reader, maximum size
    "campaign": (".yaml", load_mapping, MAX_CONFIG_BYTES),
    "extends": (".yaml", load_extending_file, MAX_CONFIG_BYTES),
    "rig": (".yaml", load_rig, MAX_CONFIG_BYTES),
    "limits": (".yaml", lambda path: load(path, LimitsFile), MAX_CONFIG_BYTES),
    "session": (".yaml", open_session, MAX_CONFIG_BYTES),
    "calibration": (".yaml", open_calibration, MAX_CONFIG_BYTES),
    "matrix": (
        ".csv",
        lambda path: matrix_csv.read_matrix_csv(path, NAMED_AT, COLUMNS, IMPEDANCE),
        MAX_CONFIG_BYTES,
    ),
    "elevation": (".csv", read_recording, MAX_RECORD_BYTES),
    "basin record": (".twe", read_recording, MAX_RECORD_BYTES),
    "old matrix": (".csv", read_table, MAX_TABLE_BYTES),
    "old workbook": (".xlsx", read_table, MAX_TABLE_BYTES),
    "old .mat": (".mat", read_table, MAX_TABLE_BYTES),
    "test log": (".xlsx", read_log, MAX_TABLE_BYTES),
    "MASK4 structure": (".mat", lambda path: read_signals(path, None), MAX_RECORD_BYTES),
    "BEM of a device": (".npz", bem.read_bem, MAX_TABLE_BYTES),
    "BEM of a device, netcdf": (".nc", bem.read_bem, MAX_TABLE_BYTES),
    "BEM of the plant": (".npz", read_bem, None),
    "BEM of the plant, netcdf": (".nc", read_bem, None),
    "identification": (".json", comparison.read_identification, MAX_TABLE_BYTES),
    "record of a run": (".mcap", mcap_file.scan, None),
    "run": (".mcap", open_run, None),
}


def fifo(path: Path) -> None:
    os.mkfifo(path)


def zero_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def unix_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as unix:
        working_directory = Path.cwd()
        os.chdir(path.parent)  # the path of a socket has at most 107 bytes
        try:
            unix.bind(path.name)
        finally:
            os.chdir(working_directory)


def folder(path: Path) -> None:
    path.mkdir()


SPECIAL = (
    (fifo, "FIFO"), (zero_device, "device"), (unix_socket, "socket"), (folder, "directory"),
)  # fmt: skip


@pytest.mark.parametrize(("make", "reason"), SPECIAL)
@pytest.mark.parametrize("name", READERS)
def test_special_files_are_refused_at_once(
    name: str, make: Callable[[Path], None], reason: str, tmp_path: Path
) -> None:
    ending, read, _ = READERS[name]
    path = tmp_path / f"odd{ending}"
    make(path)
    if name == "run":
        reason = "no "  # no such run, or a folder without a run
    with pytest.raises((ConfigError, OSError, ValueError, RunError)) as refused:
        read(path)
    message = str(refused.value).lower()
    assert (
        reason.lower() in message or "not a regular file" in message or "no such device" in message
    )
    assert f"odd{ending}" in message


@pytest.mark.parametrize("name", [name for name, entry in READERS.items() if entry[2]])
def test_a_file_that_is_too_large_names_the_limit(name: str, tmp_path: Path) -> None:
    ending, read, max_bytes = READERS[name]
    assert max_bytes is not None
    path = tmp_path / f"large{ending}"
    path.touch()
    os.truncate(path, max_bytes + 1)
    with pytest.raises((ConfigError, OSError, ValueError, RunError)) as refused:
        read(path)
    assert f"allowed at most {max_bytes / MB:g} MB" in str(refused.value)


def test_a_comment_of_60_mb_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "campaign.yaml"
    path.write_text("name: x\n# " + "x" * 60 * MB + "\n")
    with pytest.raises(ConfigError) as refused:
        load_mapping(path)
    (problem,) = refused.value.problems
    assert (problem.file, problem.line, problem.value) == (str(path), 1, str(path))
    assert problem.message.endswith("it has 60 MB or more; allowed at most 4 MB")


def test_problems_of_several_files_are_reported_together(tmp_path: Path) -> None:
    """A rig and a matrix that are special files are both reported, each where it is named."""
    from rig.kinds.wavebot.campaign import check_campaign

    os.mkfifo(tmp_path / "rig.yaml")
    campaign = tmp_path / "campaign.yaml"
    campaign.write_text("name: x\nrig: rig.yaml\nsea: {kind: calm}\nmatrix:\n  csv: /dev/zero\n")
    problems = {problem.key: problem for problem in check_campaign(campaign).problems}
    assert "FIFO" in problems["rig"].message
    assert problems["rig"].line == 2
    assert "device" in problems["matrix.csv"].message
    assert problems["matrix.csv"].line == 5


def test_links_are_followed_and_no_descriptor_stays_open(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"text")
    (tmp_path / "b").symlink_to("a")
    before = len(os.listdir("/proc/self/fd"))
    assert read_regular(tmp_path / "b", 4) == b"text"
    with pytest.raises(OSError, match="at most 3e-06 MB"):
        read_regular(tmp_path / "b", 3)
    with pytest.raises(FileNotFoundError) as error_info:
        open_regular(tmp_path / "c")
    assert error_info.value.filename == str(tmp_path / "c")
    assert len(os.listdir("/proc/self/fd")) == before


def test_a_file_without_a_size_is_read_up_to_the_limit() -> None:
    """Files in /proc report a size of 0."""
    assert read_regular(Path("/proc/self/status"), 100_000).startswith(b"Name:")
    with pytest.raises(OSError, match="at most"):
        read_regular(Path("/proc/self/status"), 100)
