from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.support.emulated_bench import emulated_bench
from benchmarks.support.emulated_wavebot import emulated_wavebot
from benchmarks.support.wired_rigs import WIRED_RIGS, WiredRig, wired_bench, wired_wavebot
from rig.execution.emulated_rig import EmulatedRig


@pytest.fixture(scope="session")
def on(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedRig]:
    """Start emulated devices for all tests that do not kill them."""
    with emulated_wavebot(tmp_path_factory.mktemp("hil")) as started_stage:
        yield started_stage


@pytest.fixture(scope="module")
def on_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedRig]:
    """Start emulated devices of the bench, for one module: idle, they take a third of a core."""
    with emulated_bench(tmp_path_factory.mktemp("hil_bench")) as started_stage:
        yield started_stage


@pytest.fixture(params=WIRED_RIGS)
def wired_rig(request: pytest.FixtureRequest) -> WiredRig:
    """Each rig with its emulated devices, for runs of the command `rig`."""
    if request.param == "wavebot":
        return wired_wavebot(request.getfixturevalue("on"))
    return wired_bench(request.getfixturevalue("on_bench"))
