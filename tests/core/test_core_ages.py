"""A value whose age is below zero is as stale as one that is too old: in every kind of rig."""

from __future__ import annotations

from typing import Any

import core_bench
import core_wavebot
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rig.kinds import KINDS
from rig.realtime.safety import FINE, OFF, Reason

HOSTS: dict[str, Any] = {"wavebot": core_wavebot, "oswec bench": core_bench}
UNCHECKED = {("wavebot", "probes", "age")}  # they serve the analysis; no limit asks for them
TOO_OLD = 1e6  # s


def sensed(kind: str) -> tuple[Any, Any, Any]:
    """Parameters, state and a sense of a rig at rest, all well."""
    host = HOSTS[kind]
    devices = host.Quiet()
    params = host.params().rig
    return params, KINDS[kind].start(params), devices.read(0.0)


def ages() -> list[tuple[str, str, str]]:
    """Every field of every sense that is an age."""
    return [
        (kind, word, field)
        for kind in KINDS
        for word, value in sensed(kind)[2]._asdict().items()
        for field in getattr(value, "_fields", ())
        if field == "age" or field.endswith("_age")
    ]


CHECKED = [one for one in ages() if one not in UNCHECKED]


def verdict(kind: str, word: str, field: str, age: float) -> int:
    """What the checks find of a rig at rest with one age as given."""
    params, state, sense = sensed(kind)
    made = KINDS[kind]
    motion = made.observe(params, state, sense, 1, 0.001)
    bent = sense._replace(**{word: getattr(sense, word)._replace(**{field: age})})
    return made.check(params, state, bent, motion, OFF)


def test_the_list_of_ages_is_not_empty() -> None:
    assert {kind for kind, _, _ in CHECKED} == set(KINDS)
    assert len(CHECKED) >= 12


@pytest.mark.parametrize(("kind", "word", "field"), CHECKED)
def test_zero_is_well_and_too_old_has_a_reason(kind: str, word: str, field: str) -> None:
    assert verdict(kind, word, field, 0.0) == FINE
    assert verdict(kind, word, field, -0.0) == FINE
    assert "STALE" in Reason(verdict(kind, word, field, TOO_OLD)).name


@pytest.mark.parametrize(("kind", "word", "field"), CHECKED)
@given(age=st.floats(min_value=-1e300, max_value=-5e-324))
@example(age=-1e-9)
def test_an_age_below_zero_is_stale(kind: str, word: str, field: str, age: float) -> None:
    assert verdict(kind, word, field, age) == verdict(kind, word, field, TOO_OLD)
