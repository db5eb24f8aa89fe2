"""Plant and law as compiled code and as C written by hand give the same energies to the bit."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from benchmarks.arithmetic import in_c, integrated, lifted, model


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_c_and_the_lifted_functions_agree_to_the_bit(tmp_path: Path) -> None:
    made = model(tmp_path)
    ours, theirs = lifted(made), in_c(made, tmp_path)
    assert theirs is not None
    for ticks in (1, 700, 20_000):
        assert ours(ticks) == theirs(ticks)
    _, ac, *_ = ours(4000)
    # The law is sampled at 1 kHz here and continuous there: half a tick of delay is 1e-3.
    assert ac == pytest.approx(integrated(made, 4.0, 1e-6)[1], rel=5e-3)
