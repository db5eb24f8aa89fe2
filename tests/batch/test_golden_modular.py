"""Replay of the golden run of the modular kind reproduces its log."""

from __future__ import annotations

from golden_modular import RECORD

from rig.execution.replay import replay
from rig.recording.runs import open_run

# The reference processor's sines are not in this run: its cycle takes square roots only, so every
# processor gives the same bits (tests/batch/test_golden_runs.py).


def test_golden_run_of_the_modular_kind_is_reproduced() -> None:
    report = replay(RECORD)
    assert report.differences == (), (
        "the cycle decides differently than when the golden run was stored; if intended, store it "
        "again (tests/batch/golden_modular.py)"
    )
    assert (report.requests, report.absent) == ((), ())
    assert report.ticks > 1500
    assert report.fields >= 30
    assert RECORD.stat().st_size <= 1_000_000  # bytes
    fields = {"heave.command.force": 20.0, "pitch.command.force": 4.0, "tare.pto_force": 1.0}
    motion = open_run(RECORD, fields=list(fields))
    for field, least in fields.items():
        assert float(abs(motion[field]).max()) > least, field
