"""The execution of the tick in runs of `core_runs`, for tests that must hold for both."""

from __future__ import annotations

from typing import Any

import core_runs
import pytest

from rig.realtime import loop
from rig.realtime.tick import Changeover


class ChangeoverAtOnce(Changeover):
    """A changeover after the first tick: it loads the code in one step."""

    def advance(self) -> Any:
        found = None
        while found is None:
            found = super().advance()
        assert self.problem == ""
        return found


@pytest.fixture(params=["interpreted", pytest.param("compiled", marks=pytest.mark.slow)])
def execution(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Run the ticks of a test interpreted, or compiled from the second one on."""
    chosen: str = request.param
    if chosen == "compiled":
        from core_code import code_of

        monkeypatch.setattr(core_runs, "find_code", code_of)
        monkeypatch.setattr(loop, "Changeover", ChangeoverAtOnce)
    return chosen
