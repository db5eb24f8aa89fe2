"""The example in docs/how_to/add_a_device.md passes the conformance test."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from conformance import FAULTS, check_conformance
from stream_subjects import StreamSubject

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how_to" / "add_a_device.md"


class Peer:
    """The far end: its temperature is its time."""

    def power_cycle(self, now: float) -> None:
        self.rest = b""

    def tick(self, now: float) -> list[bytes]:
        return []

    def receive(self, data: bytes, now: float) -> list[bytes]:
        body = b"%d %.4f" % (int(data[1:-1]), now)
        return [body + b" %02x\n" % (sum(body) & 0xFF)]


def example() -> dict[str, Any]:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    names: dict[str, Any] = {}
    exec(code, names)
    return names


class Subject(StreamSubject):
    name = "the page's thermometer"

    def __init__(self) -> None:
        super().__init__(example()["Thermometer"]("bath"), Peer())

    def sample(self) -> tuple[float, float]:
        value, age = self.conversation.read(self.now)  # type: ignore[attr-defined]
        return age, value if age < 1e6 else -1e9


@pytest.mark.parametrize("fault", FAULTS)
def test_the_example_conforms(fault: str) -> None:
    check_conformance(Subject(), fault)


def test_every_file_that_the_page_names_is_there() -> None:
    root = PAGE.parents[2]
    named = re.findall(
        r"`((?:drivers|tests|rig)/[\w/.]+\.py|(?:modbus|compax3)/\w+\.py)`", PAGE.read_text()
    )
    assert len(named) >= 7
    for name in named:
        assert (root / name).exists() or (root / "drivers" / name).exists(), name
