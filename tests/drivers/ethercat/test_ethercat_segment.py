"""Loop and service together on an emulated segment: two owners of one wire.

The emulator shares the processor with the loop, so ages have room for a host that stalls.
"""

from __future__ import annotations

import functools
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pysoem", reason="pysoem is not installed (extra `ethercat`)")
pytestmark = pytest.mark.realtime

FOLDER, ROOT = Path(__file__).parent, Path(__file__).resolve().parents[3]
PROBE = ["unshare", "-Urn", "ip", "link", "add", "one", "type", "veth", "peer", "name", "two"]


@functools.cache
def namespace_problem() -> str:
    if shutil.which("unshare") is None or shutil.which("ip") is None:
        return "unshare or ip is not installed"
    return subprocess.run(PROBE, capture_output=True, text=True, check=False).stderr.strip()


def seen_in(scenario: str) -> dict[str, Any]:
    """Run a scenario of `segment_loop.py` in namespaces of its own."""
    if problem := namespace_problem():
        pytest.skip(f"no network namespace without root: {problem}")
    done = subprocess.run(
        ["unshare", "-Urn", sys.executable, FOLDER / "segment_loop.py", scenario],
        capture_output=True, text=True, check=False, timeout=120, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    seen: dict[str, Any] = json.loads(done.stdout)
    return seen


def test_a_segment_is_set_up_and_its_drive_follows_at_1_khz() -> None:
    seen = seen_in("cycle")
    assert seen["names"][1] == "Torque drive"
    assert set(seen["mismatches"]) == {""}
    assert seen["to_op_s"] < 5.0
    assert seen["wired"] == [0b0101, 0b1010]  # outputs wired to inputs, in bits of shared bytes
    assert seen["current"] == pytest.approx(2.0, abs=0.1)  # A
    assert seen["counts"] > 0
    wrong, lost, _ = seen["wrong"]
    assert wrong == 0
    assert lost <= 3  # of 3000 frames, on a shared host
    assert set(seen["status"]) == {8}
    assert seen["age"] < 0.003  # s, the median


def test_after_a_stall_of_the_wire_ages_are_normal_at_once() -> None:
    """A master that trusts indices and working counters would lag for ever."""
    seen = seen_in("stall")
    assert seen["oldest"] > 0.015
    # The emulator needs some milliseconds for the 25 frames that waited, the loop one tick.
    assert seen["ticks_until_normal"] <= 20
    assert seen["median_after"] < 0.003
    assert seen["wrong"] == 0


def test_an_unplugged_drive_loses_its_permission_for_good() -> None:
    seen = seen_in("unplugged")
    assert seen["slaves"] == 1  # those behind it are out of reach, too
    assert seen["wrong"] > 100
    assert seen["lost_age"] > 1.0
    assert (seen["lost_acting"], seen["back_acting"]) == (0, 0)
    assert seen["why"]
