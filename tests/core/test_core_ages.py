"""Negative ages trip like ages that are too large, in every rig kind."""

from __future__ import annotations

from typing import Any

import core_bench
import core_modular
import core_wavebot
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rig.kinds import registry
from rig.realtime.reasons import NO_REASON
from rig.realtime.safety import OFF

HOSTS: dict[str, Any] = {
    "wavebot": core_wavebot,
    "oswec bench": core_bench,
    "modular": core_modular,
}
UNCHECKED = {("wavebot", "probes", "age")}  # for the analysis only; no limit uses them
TOO_OLD = 1e6  # s

KINDS = {name: registry.find(name).room("tick").find_kind("") for name in registry.OWN_PACKAGES}
KINDS["modular"] = core_modular.KIND  # with two axes and sensors


def params_state_and_sense(kind: str) -> tuple[Any, Any, Any]:
    """Return parameters, state and sense of a rig at rest without faults."""
    host = HOSTS[kind]
    devices = host.Quiet()
    params = host.params().rig
    return params, KINDS[kind].start(params), devices.read(0.0)


def ages() -> list[tuple[str, str, str]]:
    """Return every age among the sensed values."""
    return [
        (kind, signal, field)
        for kind in KINDS
        for signal, value in params_state_and_sense(kind)[2]._asdict().items()
        for field in getattr(value, "_fields", ())
        if field == "age" or field.endswith("_age")
    ]


CHECKED = [one for one in ages() if one not in UNCHECKED]


def trip_reason(kind: str, signal: str, field: str, age: float) -> int:
    """Return the trip reason of a rig at rest with one age replaced."""
    params, state, sense = params_state_and_sense(kind)
    rig_kind = KINDS[kind]
    motion = rig_kind.observe(params, state, sense, 1, 0.001)
    modified = sense._replace(**{signal: getattr(sense, signal)._replace(**{field: age})})
    return rig_kind.check(params, state, modified, motion, OFF)


def test_the_list_of_ages_is_not_empty() -> None:
    assert {kind for kind, _, _ in CHECKED} == set(KINDS)
    assert len(CHECKED) >= 12


@pytest.mark.parametrize(("kind", "signal", "field"), CHECKED)
def test_an_age_of_zero_passes_and_a_large_one_trips(kind: str, signal: str, field: str) -> None:
    assert trip_reason(kind, signal, field, 0.0) == NO_REASON
    assert trip_reason(kind, signal, field, -0.0) == NO_REASON
    assert "STALE" in KINDS[kind].reason_table.name(trip_reason(kind, signal, field, TOO_OLD))


@pytest.mark.parametrize(("kind", "signal", "field"), CHECKED)
@given(age=st.floats(min_value=-1e300, max_value=-5e-324))
@example(age=-1e-9)
def test_an_age_below_zero_is_stale(kind: str, signal: str, field: str, age: float) -> None:
    assert trip_reason(kind, signal, field, age) == trip_reason(kind, signal, field, TOO_OLD)
