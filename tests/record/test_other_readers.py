"""Independent tools open a run and read the same numbers."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import record_files as files
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rig.kinds.wavebot.tick import WaveBotRow
from rig.recording import row_layout

DATA = files.rows(1200)
NAMES = [leaf.name for leaf in row_layout.leaves(WaveBotRow)]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return files.write(tmp_path_factory.mktemp("run") / "run.mcap", DATA)


def numbers(message: Any) -> Iterator[float | int]:
    for name in NAMES:
        value = message
        for part in name.split("."):
            value = getattr(value, part)
        yield value


def assert_equal(messages: list[Any]) -> None:
    found = np.array([tuple(numbers(message)) for message in messages], files.DTYPE)
    assert np.array_equal(found, DATA)


def test_mcap_ros2_support(path: Path) -> None:
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert_equal([decoded for _, _, _, decoded in reader.iter_decoded_messages()])


def test_rosbags(path: Path) -> None:
    reader = McapReader(path)
    reader.open()
    (schema,) = reader.schemas.values()
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema.data, schema.name))
    messages = reader.messages(reader.connections, None, None)
    assert_equal([store.deserialize_cdr(data, schema.name) for _, _, data in messages])
    reader.close()


def rerun(home: Path, *arguments: str) -> str:
    tool = Path(sys.executable).with_name("rerun")
    environment = {**os.environ, "HOME": str(home), "NO_COLOR": "1"}
    done = subprocess.run(
        [tool, *arguments], env=environment, capture_output=True, text=True, check=True, timeout=60
    )
    return done.stdout


def test_rerun(path: Path, tmp_path: Path) -> None:
    checked = rerun(tmp_path, "mcap", "check", "--full", str(path))
    assert "ok" in checked
    assert "/row" in checked
    recording = tmp_path / "run.rrd"
    rerun(tmp_path, "mcap", "convert", str(path), "-o", str(recording))
    statistics = rerun(tmp_path, "rrd", "stats", str(recording))
    assert "wec_rig.msg.WaveBotRow:message" in statistics  # decoded, not raw bytes
    printed = rerun(tmp_path, "rrd", "print", "-vvv", "--entity", "/row", str(recording))
    last = DATA[-1]
    shown = (
        f"tick: {last['tick']}, time: {last['time']}, timing: {{lateness: {last['timing.lateness']}"
    )
    assert shown in printed
