"""Golden runs: today's cycle makes the same decisions as when the runs were stored.

The tests compare all outputs of the cycle (60 fields: estimates, demands, commands, limits, modes,
power, zeros) bit by bit. They agree on every processor: the square root is the only function of the
C library in the cycle, and IEEE 754 defines it; designed gains are rounded above the last bits of
the BLAS. The exception is an open-loop reference from numpy's Fourier transform, whose last bits
depend on the processor: 1e-9 (A, N) is far above them and far below the effect of any change of a
law.
"""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from golden_runs import IN_WAVES, KINDS, MOST_BYTES, facts_without_limits, record
from rig_command import rig_here

from rig.analysis.rows import row_table
from rig.execution.replay import replay
from rig.kinds.wavebot import recorded
from rig.recording.runs import folder, open_run


@pytest.mark.parametrize("kind", KINDS)
def test_golden_run_is_reproduced(kind: str) -> None:
    report = replay(record(kind))
    allowed = 1e-9 if kind == "open_loop" else 0.0
    differing = [
        difference for difference in report.differences if not difference.largest <= allowed
    ]
    assert differing == [], (
        f"the cycle decides differently than when the golden run was stored: {differing}; "
        "if intended, store the golden runs again (tests/batch/golden_runs.py)"
    )
    assert report.requests == ()
    assert report.absent == ()
    assert report.ticks >= 900
    assert report.fields >= 60
    assert record(kind).stat().st_size <= MOST_BYTES


NEWER_LIMITS = ("heave.current_difference_", "surge.current_difference_", "power.")


def test_run_older_than_a_check_is_replayed_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such runs lack the comparison of current, force and power with the command."""
    monkeypatch.setattr(folder, "run_info", facts_without_limits(*NEWER_LIMITS))
    subject = recorded.recorded_task(folder.run_info(record("cots")))
    assert subject.params.rig.heave.limits.current_difference_stop == 500.0
    assert replay(record("cots")).identical


@pytest.mark.parametrize("kind", IN_WAVES)
def test_golden_run_in_waves_absorbs_power(kind: str) -> None:
    rows = row_table(record(kind))
    assert rows["state"].values.tolist() == ["complete", "complete"]
    assert (rows["power_mechanical_1"].values < -1.0).all()  # W, absorbed
    assert rows["kp"].values.tolist() == [-2000.0, -2500.0]


def test_every_golden_run_moves() -> None:
    excited = open_run(
        record("open_loop"), fields=["heave.command.current", "heave.estimate.position"]
    )
    assert float(abs(excited["heave.command.current"]).max()) > 10.0  # A
    assert float(abs(excited["heave.estimate.position"]).max()) > 0.05  # m
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
def test_one_changed_bit_of_one_tick_is_detected(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Today's code estimates one velocity, in tick 700, as the next float."""
    original, tick = recorded.KIND.observe, iter(range(10_000))

    def observe(*arguments: Any) -> Any:
        heave, surge = original(*arguments)
        if next(tick) == 700:
            heave = heave._replace(velocity=math.nextafter(heave.velocity, math.inf))
        return heave, surge

    monkeypatch.setattr(recorded, "KIND", recorded.KIND._replace(observe=observe))
    code, out, _ = rig_here("replay", record(kind), "--interpreted", "--json")
    assert code == 1
    result = json.loads(out)
    assert result["same"] is False
    first = result["differences"][0]
    assert (first["field"], first["first"]) == ("heave.estimate.velocity", 700)
    assert 0.0 < first["largest"] < 1e-15  # m/s
    tick = iter(range(10_000))
    code, out, _ = rig_here("replay", record(kind), "--interpreted")
    assert out.startswith("first difference in tick 700: heave.estimate.velocity was ")
