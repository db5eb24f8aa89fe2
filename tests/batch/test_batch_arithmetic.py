"""Plant and law as compiled code and as C written by hand give the same energies to the bit."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from benchmarks.arithmetic import in_c, lifted, model
from benchmarks.support.integrated import continuous, sampled


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_c_and_the_lifted_functions_agree_to_the_bit(tmp_path: Path) -> None:
    made = model(tmp_path)
    ours, theirs = lifted(made), in_c(made, tmp_path)
    assert theirs is not None
    for ticks in (1, 700, 20_000):
        assert ours(ticks) == theirs(ticks)
    _, ac, *_ = ours(4000)
    # The law is sampled at 1 kHz here and continuous there: half a tick of delay is 1e-3.
    assert ac == pytest.approx(continuous(made, 4.0, 1e-6)[1], rel=5e-3)


def test_scipy_walks_the_same_model(tmp_path: Path) -> None:
    """Its law acts once a tick as well: what is left is the integrator's own error."""
    made = model(tmp_path)
    ours, theirs = lifted(made)(1500), sampled(made, 1.5, 1e-3)
    # The midpoint rule at 1 ms; the stator moves on once a tick here and all the time there.
    assert ours[:3] == pytest.approx(theirs, rel=1e-4)
