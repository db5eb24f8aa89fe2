from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.support.emulated_wavebot import EmulatedWaveBot, emulated_wavebot


@pytest.fixture(scope="session")
def on(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedWaveBot]:
    """Start emulated devices for all tests that do not kill them."""
    with emulated_wavebot(tmp_path_factory.mktemp("hil")) as started_stage:
        yield started_stage
