"""Golden runs of the bench, and fresh ones, come out of today's cycle as they were logged.

A fresh run does so to the bit. The golden ones are of the processor that made them: the reference
of the bench takes sines of the C library, which may differ in the last bit on another one, and a
loop closed on its own estimate carries that on. 1e-9 (rad, rad/s, N m, A) is far above what such
bits become in a few seconds and far below what any change of a law does.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from golden_bench import MOVED, record
from golden_runs import facts_without
from rehearsing import CONFIGS, write_yaml
from rig_command import rig_here

from rig.execution import replay as replays
from rig.execution.replay import replay
from rig.kinds import oswec_bench
from rig.planning.session import plan_session
from rig.planning.session.assemble import bench_params
from rig.planning.session.check import check_session
from rig.planning.session.recorded import session_as_logged
from rig.planning.session.resolved import resolved_session
from rig.recording.runs import RunError, open_run, run_info

LAST_BITS = 1e-9


@pytest.mark.parametrize("kind", MOVED)
def test_a_golden_run_of_the_bench_comes_out_again(kind: str) -> None:
    found = replay(record(kind))
    far = [each for each in found.differences if not each.largest <= LAST_BITS]
    assert far == [], (
        f"the cycle decides otherwise than when the golden run was stored: {far}; "
        "where that is meant, make them anew (tests/batch/golden_bench.py)"
    )
    assert (found.requests, found.absent) == ((), ())
    assert found.fields >= 36
    assert found.ticks > 3000
    moved = open_run(record(kind), fields=list(MOVED[kind]))
    for field, least in MOVED[kind].items():
        assert float(abs(moved[field]).max()) > least, field
    assert record(kind).stat().st_size <= 600_000  # bytes


def test_a_law_of_the_bench_that_decides_otherwise_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As if today's code estimated one motor velocity, in tick 900, a nanoradian a second off."""
    sound, tick = oswec_bench.KIND.observe, iter(range(10_000))

    def observe(*given: Any) -> Any:
        motor, shaft = sound(*given)
        off = 1e-6 if next(tick) == 900 else 0.0
        return motor._replace(velocity=motor.velocity + off), shaft

    monkeypatch.setattr(replays.oswec_bench, "KIND", oswec_bench.KIND._replace(observe=observe))
    code, said, _ = rig_here("replay", record("bench_velocity"), "--json")
    assert code == 1
    first = json.loads(said)["differences"][0]
    assert (first["field"], first["first"]) == ("motor.velocity", 900)
    assert math.isclose(first["largest"], 1e-6, rel_tol=1e-3)


SESSIONS: dict[str, dict[str, Any]] = {
    "driveline": {"grid": [{"amplitude_deg": [5, 15], "damping_n_m_s_per_rad": 42, "period_s": 2}]},
    "brake_map": {"grid": [{"amplitude_deg": 5, "brake_current_a": [0.1, 0.2], "period_s": 2}]},
    "torque_tracking": {
        "grid": [{"torque_amplitude_n_m": [10, 20], "period_s": 2}],
        "shaft": "clamped",
        "control": "closed loop",
    },
}
SHIPPED = ("driveline_online", "irregular_instantaneous", "flap_rao_irregular")


@pytest.mark.parametrize("name", [*SESSIONS, *SHIPPED])
def test_what_a_record_keeps_of_a_session_gives_its_parameters_again(
    name: str, tmp_path: Path
) -> None:
    """Every number that the cycle is given: calibrations, corrections and set points are in it."""
    if name in SESSIONS:
        told = {"name": "test", "session": name, **SESSIONS[name]}
        told["rig"] = str(CONFIGS / "rigs" / "oswec_bench.yaml")
        told["timing"] = {"rise_s": 0.5, "settle_periods": 0, "periods": 1}
        path = write_yaml(tmp_path / "session.yaml", told)
    else:
        path = CONFIGS / "sessions" / f"{name}.yaml"
    report = check_session(path)
    assert report.session is not None, report.text()
    again = session_as_logged(json.loads(resolved_session(report.session)))
    ours, theirs = plan_session(report.session), plan_session(again)
    assert bench_params(again, theirs) == bench_params(report.session, ours)


LATER = ("motor.current_difference_", "motor.velocity_difference_", "power.")


def test_a_run_recorded_before_a_check_has_it_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """As runs did before motor and load cell were compared with what was commanded."""
    monkeypatch.setattr(replays, "facts", facts_without(*LATER))
    assert replay(record("bench_torque")).identical


def test_a_run_that_kept_no_constants_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """As runs of the bench did before."""
    sound = run_info

    def without(*given: Any) -> Any:
        known = sound(*given)
        kept = {key: value for key, value in known.config.items() if key != "constants"}
        return known._replace(config=kept)

    monkeypatch.setattr(replays, "facts", without)
    with pytest.raises(RunError, match="constants"):
        replay(record("bench_torque"))
