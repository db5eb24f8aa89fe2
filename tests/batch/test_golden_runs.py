"""Golden runs: what the loop decided when they were stored is what today's cycle decides.

All that the cycle makes is compared (60 fields: estimates, demands, commands, limits, modes, power,
zeros), bit by bit. That holds on every processor: the cycle has no function of the C library but
the square root, which IEEE 754 fixes, and designed gains are rounded above the BLAS's last bits.
The one exception is an open-loop reference, made by numpy's Fourier transform, whose last bits are
the processor's: 1e-9 (A, N) is far above them and far below what any change of a law does.
"""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from golden_runs import IN_WAVES, KINDS, MOST_BYTES, facts_without, record
from rig_command import rig_here

from rig.analysis.rows import row_table
from rig.execution import replay as replays
from rig.execution.replay import replay
from rig.recording.runs import open_run


@pytest.mark.parametrize("kind", KINDS)
def test_a_golden_run_comes_out_again(kind: str) -> None:
    found = replay(record(kind))
    allowed = 1e-9 if kind == "open_loop" else 0.0
    far = [each for each in found.differences if not each.largest <= allowed]
    assert far == [], (
        f"the cycle decides otherwise than when the golden run was stored: {far}; "
        "where that is meant, make them anew (tests/batch/golden_runs.py)"
    )
    assert found.requests == ()
    assert found.absent == ()
    assert found.ticks >= 900
    assert found.fields >= 60
    assert record(kind).stat().st_size <= MOST_BYTES


LATER = ("heave.current_difference_", "surge.current_difference_", "power.")


def test_a_run_recorded_before_a_check_has_it_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """As runs did before current, force and power were compared with what was commanded."""
    monkeypatch.setattr(replays, "facts", facts_without(*LATER))
    subject = replays._wavebot_target(replays.run_info(record("cots")))
    assert subject.params.rig.heave.limits.current_difference_stop == 500.0
    assert replay(record("cots")).identical


@pytest.mark.parametrize("kind", IN_WAVES)
def test_a_golden_run_in_waves_absorbs_power(kind: str) -> None:
    rows = row_table(record(kind))
    assert rows["state"].values.tolist() == ["complete", "complete"]
    assert (rows["power_mechanical_1"].values < -1.0).all()  # W: it absorbs
    assert rows["kp"].values.tolist() == [-2000.0, -2500.0]


def test_no_golden_run_is_one_at_rest() -> None:
    pushed = open_run(
        record("open_loop"), fields=["heave.command.current", "heave.estimate.position"]
    )
    assert float(abs(pushed["heave.command.current"]).max()) > 10.0  # A
    assert float(abs(pushed["heave.estimate.position"]).max()) > 0.05  # m
    hoisted = open_run(record("hoist"), fields=["heave.estimate.position", "load.stator_a"])
    travel = float(
        hoisted["heave.estimate.position"].max() - hoisted["heave.estimate.position"].min()
    )
    assert travel > 0.05  # m
    assert float(hoisted["load.stator_a"].max() - hoisted["load.stator_a"].min()) > 100.0  # N
    empty = open_run(record("calibration"), fields=["probes.probe_1", "heave.command.current"])
    assert float(abs(empty["probes.probe_1"]).max()) > 0.1  # m
    assert float(abs(empty["heave.command.current"]).max()) == 0.0


@pytest.mark.parametrize("kind", IN_WAVES)
def test_one_bit_of_one_tick_is_found(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if today's code estimated one velocity, in tick 700, by the next float."""
    sound, tick = replays.KIND.observe, iter(range(10_000))

    def observe(*given: Any) -> Any:
        heave, surge = sound(*given)
        if next(tick) == 700:
            heave = heave._replace(velocity=math.nextafter(heave.velocity, math.inf))
        return heave, surge

    monkeypatch.setattr(replays, "KIND", replays.KIND._replace(observe=observe))
    code, said, _ = rig_here("replay", record(kind), "--json")
    assert code == 1
    told = json.loads(said)
    assert told["same"] is False
    first = told["differences"][0]
    assert (first["field"], first["first"]) == ("heave.estimate.velocity", 700)
    assert 0.0 < first["largest"] < 1e-15  # m/s
    tick = iter(range(10_000))
    code, said, _ = rig_here("replay", record(kind))
    assert said.startswith("first difference in tick 700: heave.estimate.velocity was ")
