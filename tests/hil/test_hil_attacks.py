"""Processes of runs on real wires killed and suspended at random times; see `wired_attacks`.

In each case the motors lose power within the stated time, and every row that the loop wrote is in
the record, or `rig recover` states which are not.
"""

from __future__ import annotations

import os
import random
import secrets
from pathlib import Path

import pytest

from benchmarks.support.wired_attacks import draw_attacks, run_attack
from benchmarks.support.wired_rigs import WiredRig

pytestmark = [pytest.mark.realtime, pytest.mark.long]

SEED = int(os.environ.get("ATTACK_SEED") or secrets.randbits(32))
PARTS = 5  # of one attack on each rig; the long form is `python -m benchmarks crash`


@pytest.mark.parametrize("part", range(PARTS))
def test_any_process_may_be_lost_at_any_moment(
    wired_rig: WiredRig, part: int, tmp_path: Path
) -> None:
    print(f"ATTACK_SEED={SEED}")  # shown if it fails
    attack = draw_attacks(random.Random(SEED), wired_rig, PARTS, 3.0)[part]
    outcome = run_attack(wired_rig, tmp_path / "run", attack)
    print(f"{attack}: power off {outcome.power_off_after} s later; {outcome.rows_put} rows")
    assert outcome.failures == ()
