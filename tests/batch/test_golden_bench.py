"""Replay of golden runs of the bench, and of new ones, reproduces the log.

A new run is reproduced to the bit. Golden runs depend on the processor that made them: the
reference of the bench uses sines of the C library, which may differ in the last bit on another
processor, and a closed loop carries the difference on. 1e-9 (rad, rad/s, N m, A) is far above the
effect of such bits within a few seconds and far below the effect of any change of a law.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from golden_bench import MIN_MOTION, record
from golden_runs import facts_without_limits
from rehearsing import CONFIGS, write_yaml
from rig_command import rig_here

from rig.execution.replay import replay
from rig.kinds.oswec_bench import recorded
from rig.kinds.oswec_bench.recorded import resolved_session, session_as_logged
from rig.kinds.oswec_bench.sessions.assemble import bench_params
from rig.kinds.oswec_bench.sessions.check import check_session
from rig.kinds.oswec_bench.sessions.plan import plan_session
from rig.kinds.oswec_bench.tick import stations
from rig.recording.runs import RunError, folder, open_run, run_info

LAST_BITS = 1e-9
NEWER_FIELDS = tuple(f"power.{field}" for field in stations.Power._fields)
"""Fields of the log row that the golden runs, which are older, lack."""


@pytest.mark.parametrize("kind", MIN_MOTION)
def test_golden_run_of_the_bench_is_reproduced(kind: str) -> None:
    report = replay(record(kind))
    differing = [
        difference for difference in report.differences if not difference.largest <= LAST_BITS
    ]
    assert differing == [], (
        f"the cycle decides differently than when the golden run was stored: {differing}; "
        "if intended, store the golden runs again (tests/batch/golden_bench.py)"
    )
    assert report.requests == ()
    assert report.absent == NEWER_FIELDS
    assert report.fields >= 36
    assert report.ticks > 3000
    motion = open_run(record(kind), fields=list(MIN_MOTION[kind]))
    for field, minimum in MIN_MOTION[kind].items():
        assert float(abs(motion[field]).max()) > minimum, field
    assert record(kind).stat().st_size <= 600_000  # bytes


def test_changed_law_of_the_bench_is_detected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Today's code estimates one motor velocity, in tick 900, with an error of 1e-6 rad/s."""
    original, tick = recorded.KIND.observe, iter(range(10_000))

    def observe(*arguments: Any) -> Any:
        motor, shaft = original(*arguments)
        error = 1e-6 if next(tick) == 900 else 0.0
        return motor._replace(velocity=motor.velocity + error), shaft

    monkeypatch.setattr(recorded, "KIND", recorded.KIND._replace(observe=observe))
    code, out, _ = rig_here("replay", record("bench_velocity"), "--interpreted", "--json")
    assert code == 1
    first = json.loads(out)["differences"][0]
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
def test_record_of_a_session_reproduces_its_parameters(name: str, tmp_path: Path) -> None:
    """All parameters of the cycle, including calibrations, corrections and set points."""
    if name in SESSIONS:
        config = {"name": "test", "session": name, **SESSIONS[name]}
        config["rig"] = str(CONFIGS / "rigs" / "oswec_bench.yaml")
        config["timing"] = {"rise_s": 0.5, "settle_periods": 0, "periods": 1}
        path = write_yaml(tmp_path / "session.yaml", config)
    else:
        path = CONFIGS / "sessions" / f"{name}.yaml"
    report = check_session(path)
    assert report.checked is not None, report.text()
    from_record = session_as_logged(json.loads(resolved_session(report.checked)))
    plan, plan_from_record = plan_session(report.checked), plan_session(from_record)
    assert bench_params(from_record, plan_from_record) == bench_params(report.checked, plan)


NEWER_LIMITS = ("motor.current_difference_", "motor.velocity_difference_", "power.")


def test_run_older_than_a_check_is_replayed_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such runs lack the comparison of motor and load cell with the command."""
    monkeypatch.setattr(folder, "run_info", facts_without_limits(*NEWER_LIMITS))
    assert replay(record("bench_torque")).identical


def test_run_without_constants_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Older runs of the bench lack the constants."""
    original = run_info

    def facts_without_constants(*arguments: Any) -> Any:
        run_facts = original(*arguments)
        remaining = {key: value for key, value in run_facts.config.items() if key != "constants"}
        return run_facts._replace(config=remaining)

    monkeypatch.setattr(folder, "run_info", facts_without_constants)
    with pytest.raises(RunError, match="constants"):
        replay(record("bench_torque"))
