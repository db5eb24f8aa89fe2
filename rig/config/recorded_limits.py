"""Completion of limits recorded by runs that are older than a check."""

from collections.abc import Mapping
from typing import Any

# A limits file has no defaults, and a run recorded before a check existed has no limit for it. Such
# a run is opened and replayed with the weakest value that a file may have. No drive of these rigs
# comes near it, so the check never trips and the replay gives the same result as the run.
_NO_CURRENT_CHECK = {"current_difference_stop_a": 500.0, "current_difference_time_s": 60.0}
_NO_MOTOR_POWER_CHECK = {
    "time_s": 600.0,
    "fed_stop_w": 1e6,
    "motor_difference_stop_w": 1e6,
    "motor_difference_ratio": 10.0,
}
_WAVEBOT: dict[str, dict[str, float]] = {
    "heave": _NO_CURRENT_CHECK,
    "surge": _NO_CURRENT_CHECK,
    "power": {
        **_NO_MOTOR_POWER_CHECK,
        "balance_time_s": 600.0,
        "balance_stop_w": 1e6,
        "friction_n_s_per_m": 1e6,
        "loss_w_per_a2": 1e3,
    },
}
_BENCH: dict[str, dict[str, float]] = {
    "motor": {
        "current_difference_stop_a": 100.0,
        "current_difference_time_s": 60.0,
        "velocity_difference_stop_rad_per_s": 50.0,
        "velocity_difference_time_s": 60.0,
    },
    "power": _NO_MOTOR_POWER_CHECK,
}


def complete_wavebot_limits(recorded: Mapping[str, Any]) -> dict[str, Any]:
    """Return a WaveBot's recorded limits with limits of later checks that never trip."""
    return _complete(recorded, _WAVEBOT)


def complete_bench_limits(recorded: Mapping[str, Any]) -> dict[str, Any]:
    """Return a bench's recorded limits with limits of later checks that never trip."""
    return _complete(recorded, _BENCH)


def _complete(
    recorded: Mapping[str, Any], later: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    sections = {key: {**added, **recorded.get(key, {})} for key, added in later.items()}
    return {**recorded, **sections}
