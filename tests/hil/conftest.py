from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.support.emulated_wavebot import Stage, stage


@pytest.fixture(scope="session")
def on(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    """Start emulated devices for all tests that do not kill them."""
    with stage(tmp_path_factory.mktemp("hil")) as started_stage:
        yield started_stage
