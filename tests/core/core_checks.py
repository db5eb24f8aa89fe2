"""Independent specification of limits and safety, to be checked on any version of the modules.

`check_safety(module)` and `check_limits(module)` raise AssertionError if a module, the real one
or a mutant, deviates from it.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

from controllers.signals import AxisSense, DriveFault, Estimate

MODES = {"OFF": 0, "ENABLING": 1, "RUN": 2, "STOP_2": 3, "STOP_1": 4, "STOP_0": 5}

# Reason: number in the log, stop category. The numbers are in recorded files and never change.
REASONS = {
    "NONE": (0, 1),
    "PLAN_END": (1, 1),
    "OPERATOR_STOP": (2, 1),
    "OPERATOR_ABORT": (3, 0),
    "SUPERVISOR_LOST": (4, 1),
    "LOGGER_LOST": (5, 1),
    "NOT_FINITE": (6, 0),
    "STALE_ENCODER": (7, 0),
    "STALE_DRIVE": (8, 0),
    "STALE_LOAD_CELL": (9, 1),
    "STALE_ANALYSER": (10, 1),
    "STALE_STATOR": (11, 1),
    "LOST_TICKS": (12, 0),
    "DRIVE_FAULT": (13, 0),
    "DRIVE_DROPPED": (14, 0),
    "DRIVE_NOT_ON": (15, 0),
    "POSITION": (16, 1),
    "VELOCITY": (17, 1),
    "ROTOR_TRAVEL": (18, 1),
    "POSITION_DISAGREES": (19, 0),
    "STATOR_LATE": (20, 1),
    "NOT_CALM": (21, 1),
    "EXCEPTION": (22, 0),
    "ENCODER_JUMP": (23, 0),
    "SPRING_STROKE": (24, 1),
    "BUS_UNDERVOLTAGE": (25, 0),
    "BUS_OVERVOLTAGE": (26, 0),
    "SURGE_STALE_ENCODER": (27, 0),
    "SURGE_STALE_DRIVE": (28, 0),
    "SURGE_DRIVE_FAULT": (29, 0),
    "SURGE_DRIVE_DROPPED": (30, 0),
    "SURGE_POSITION": (31, 1),
    "SURGE_VELOCITY": (32, 1),
    "SURGE_ENCODER_JUMP": (33, 0),
    "EMERGENCY_STOP": (34, 0),
    "LIMIT_SWITCH": (35, 1),
    "STALE_PANEL": (36, 1),
    "BRAKE_LOST": (37, 1),
    "STALE_BRAKE": (38, 1),
    "COUPLING_SLIP": (39, 0),
    "LOAD_CELL_OVERLOAD": (40, 0),
    "SHAFT_ENCODER_JUMP": (41, 0),
    "CURRENT_DISAGREES": (42, 0),
    "SURGE_CURRENT_DISAGREES": (43, 0),
    "VELOCITY_DISAGREES": (44, 0),
    "FORCE_DISAGREES": (45, 0),
    "POWER_SIGN": (46, 0),
    "POWER_BALANCE": (47, 1),
    "NO_OPERATOR": (48, 1),
    "FIELDBUS_LOST": (49, 0),
}

REQUESTS = {
    "NONE": (0, "NONE"),
    "STOP": (1, "OPERATOR_STOP"),
    "ABORT": (2, "OPERATOR_ABORT"),
    "HOLD": (3, "NONE"),
    "RESUME": (4, "NONE"),
    "LOGGER_LOST": (5, "LOGGER_LOST"),
    "SUPERVISOR_LOST": (6, "SUPERVISOR_LOST"),
    "NO_OPERATOR": (7, "NO_OPERATOR"),
}

# Every pair of mode and event, by IEC 60204-1. "off": power removed (category 0); "damp": motion
# brought to rest, then power removed (category 1); "hold": the same and power kept (category 2);
# "enable": power requested; "run": the law acts; "-": no change.
EVENTS = [
    "TRIP_0",
    "EXPIRED",
    "TRIP_1",
    "STOP",
    "HOLD",
    "RESUME",
    "POWERED",
    "POWER_REQUIRED",
    "NONE",
]
TRANSITIONS = {
    "OFF": "off - off off - - enable enable -",
    "ENABLING": "off off off off - - run - -",
    "RUN": "off - damp damp hold - - - -",
    "STOP_2": "off - damp damp - run - - -",
    "STOP_1": "off off - - - - - - -",
    "STOP_0": "- - - - - - - - -",
}
ACTION_MODE = {
    "off": "STOP_0",
    "damp": "STOP_1",
    "hold": "STOP_2",
    "enable": "ENABLING",
    "run": "RUN",
}

ENABLE_TICKS, STOP_TICKS = 5, 3


class Input(NamedTuple):
    """Inputs of the safety machine in a tick, by name; "NONE" for none."""

    mode: str
    age: int
    reason: str  # of the state before
    trip: str
    request: str
    plan_finished: bool
    power_required: bool
    drive_on: bool


def stop_reason(now: Input) -> str:
    """Return the stop reason of this tick: lowest category first, then trip, request, plan."""
    causes = []
    if now.trip != "NONE":
        causes.append(now.trip)
    elif now.mode == "ENABLING" and now.age >= ENABLE_TICKS and not now.drive_on:
        causes.append("DRIVE_NOT_ON")
    if REQUESTS.get(now.request, (0, "NONE"))[1] != "NONE":
        causes.append(REQUESTS[now.request][1])
    if now.plan_finished:
        causes.append("PLAN_END")
    return min(causes, key=lambda name: REASONS[name][1], default="NONE")


def expected(now: Input) -> tuple[str, str]:
    """Return mode and reason after the tick."""
    reason = stop_reason(now)
    after = _mode_after(now, reason)
    if after == now.mode:
        return after, now.reason
    return after, now.reason if now.reason != "NONE" else reason


def _mode_after(now: Input, reason: str) -> str:
    if now.mode == "STOP_0":
        return "STOP_0"  # latched
    if reason != "NONE" and REASONS[reason][1] == 0:
        return "STOP_0"  # category 0: remove power at once
    if now.mode == "STOP_1":
        return "STOP_0" if now.age >= STOP_TICKS else "STOP_1"
    if now.mode in ("OFF", "ENABLING"):
        if reason != "NONE":
            return "STOP_0"  # no motion under power yet, so nothing to damp
        if now.mode == "OFF":
            return "ENABLING" if now.power_required else "OFF"
        return "RUN" if now.power_required and now.drive_on else "ENABLING"
    if reason != "NONE":
        return "STOP_1"  # category 1: damp, then remove power
    if now.mode == "RUN":
        return "STOP_2" if now.request == "HOLD" else "RUN"
    return "RUN" if now.request == "RESUME" else "STOP_2"


def inputs() -> list[Input]:
    """Return every combination that can matter to the machine."""
    return [
        Input(*case)
        for case in itertools.product(
            MODES,
            (0, STOP_TICKS - 1, STOP_TICKS, ENABLE_TICKS - 1, ENABLE_TICKS, ENABLE_TICKS + 1),
            ("NONE", "STALE_STATOR"),
            ("NONE", "POSITION", "DRIVE_FAULT"),
            (*REQUESTS, "UNKNOWN"),
            (False, True),
            (False, True),
            (False, True),
        )
    ]


INPUTS = [(case, expected(case)) for case in inputs()]


def check_safety(module: Any) -> None:
    """Check the numbers, the categories, the start, and every step."""
    assert {mode.name: mode.value for mode in module.Mode} == MODES
    assert {name: getattr(module, name) for name in MODES} == MODES
    assert {event.name: event.value for event in module.Event} == {
        name: number for number, name in enumerate(EVENTS)
    }
    assert [[mode.name for mode in row] for row in module.TABLE] == [
        [ACTION_MODE.get(action, name) for action in TRANSITIONS[name].split()] for name in MODES
    ]
    for reason in module.Reason:  # the kinds have the others
        assert (reason.value, module.CATEGORY[reason]) == REASONS[reason.name]
    category = tuple(category for _, category in REASONS.values())
    for name, (number, reason_name) in REQUESTS.items():
        assert getattr(module, f"REQUEST_{name}") == number
        assert module.stop_reason(number) == REASONS[reason_name][0]
    assert module.stop_reason(99) == module.NO_REASON == 0
    assert module.start(7) == (0, 7, 0)
    params = module.Params(ENABLE_TICKS, STOP_TICKS)
    for case, (mode, reason) in INPUTS:
        state = module.State(MODES[case.mode], 100, REASONS[case.reason][0])
        tick = 100 + case.age
        got = module.step(
            params,
            state,
            tick,
            REASONS[case.trip][0],
            REQUESTS.get(case.request, (99,))[0],
            case.plan_finished,
            case.power_required,
            case.drive_on,
            category,
        )
        entered = 100 if mode == case.mode else tick
        assert got == (MODES[mode], entered, REASONS[reason][0]), case
        assert type(got.mode) is int


# --- limits; numbers chosen so that every bound is exact in binary

DT = 1.0 / 1024.0
BOUNDS = {
    "position_warn": 0.25,
    "position_stop": 0.5,
    "velocity_stop": 2.0,
    "current_peak": 16.0,
    "current_rms": 8.0,
    "current_rms_time": 0.5,
    "force_slew": 8192.0,  # 8 N a tick
    "encoder_age_stop": 0.125,
    "encoder_jump_stop": 0.0625,
    "drive_age_stop": 0.375,
    "current_difference_stop": 1.5,
    "current_ticks_stop": 5,
    "newtons_per_ampere": 4.0,
}
SLEW, PEAK, RMS = 8.0, 64.0, 32.0  # N
LIMITED = {
    "CURRENT_PEAK": 1, "CURRENT_RMS": 2, "SLEW": 4, "MODE": 8, "NOT_FINITE": 16, "GATED": 32,
    "VELOCITY": 64,
}  # fmt: skip
NORMAL = AxisSense(123, 0.125, 3.0, 1, 0, 0.375)  # ages at their bounds
STILL = Estimate(0.5, -2.0, 7.0)  # position and velocity at theirs

# Faults of an axis, the most severe first: the reason, and the values that cause it.
FAULTS: tuple[tuple[str, dict[str, float]], ...] = (
    ("NOT_FINITE", {"acceleration": math.nan}),
    ("STALE_ENCODER", {"encoder_age": 0.126}),
    ("STALE_DRIVE", {"drive_age": 0.376}),
    ("DRIVE_FAULT", {"fault": 1}),
    ("DRIVE_DROPPED", {"enabled": 0}),
    ("ENCODER_JUMP", {"jump": -0.063}),
    ("CURRENT_DISAGREES", {"mismatch": 5}),
    ("POSITION", {"position": -0.501}),
    ("VELOCITY", {"velocity": 2.001}),
)


def axis_with(jump: float = 0.0625, **changes: Any) -> tuple[AxisSense, float, Estimate]:
    """Return a faultless axis with some values replaced: sense, measured position, motion."""
    sense = {name: value for name, value in changes.items() if name in AxisSense._fields}
    motion = {name: value for name, value in changes.items() if name in Estimate._fields}
    assert len(sense) + len(motion) == len(changes)
    moved = STILL._replace(**motion)
    return NORMAL._replace(**sense), moved.position + jump, moved


def check_limits(module: Any) -> None:
    """Check trips, warnings, and the granted force."""
    limits = module.AxisLimits(**BOUNDS)
    assert module.start() == (0.0, 0.0, 0)
    assert {flag.name: flag.value for flag in module.LimitFlag} == LIMITED
    assert {flag.name: flag.value for flag in module.WarningFlag} == {"POSITION": 1}
    _check_trips(module, limits)
    _check_mismatch(module, limits)
    for position, warned in ((0.25, 0), (-0.25, 0), (0.2501, 1), (-0.2501, 1), (0.0, 0)):
        assert module.warn_axis(limits, Estimate(position, 0.0, 0.0)) == warned
    _check_grants(module, limits)


def _check_trips(module: Any, limits: Any) -> None:
    healthy = module.AxisState(0.0, 0.0, 0)
    for mode in MODES.values():
        powered = mode in (MODES["RUN"], MODES["STOP_2"], MODES["STOP_1"])
        for chosen in itertools.product((False, True), repeat=len(FAULTS)):
            changes: dict[str, Any] = {}
            found = []
            for (reason, change), is_wrong in zip(FAULTS, chosen, strict=True):
                if is_wrong:
                    changes |= change
                    if reason != "DRIVE_DROPPED" or powered:
                        found.append(reason)
            mismatch = changes.pop("mismatch", 4)
            sense, measured, motion = axis_with(**changes)
            got = module.check_axis(limits, healthy, mismatch, sense, measured, motion, mode)
            assert got == REASONS[found[0] if found else "NONE"][0], (mode, changes)
            assert type(got) is int
            # A lost bus is the cause of old values, and of all that the drive does without it.
            lost = sense._replace(fault=DriveFault.FIELDBUS_LOST.value)
            got = module.check_axis(limits, healthy, mismatch, lost, measured, motion, mode)
            assert got == REASONS["NOT_FINITE" if chosen[0] else "FIELDBUS_LOST"][0], changes
    run = MODES["RUN"]
    for name in ("current", "encoder_age", "drive_age", *Estimate._fields):
        for bad in (math.nan, math.inf, -math.inf):
            sense, measured, motion = axis_with(**{name: bad})
            got = module.check_axis(limits, healthy, 0, sense, measured, motion, run)
            assert got == REASONS["NOT_FINITE"][0], (name, bad)
    sense, measured, motion = axis_with(current=math.inf, velocity=-math.inf)  # must not cancel
    got = module.check_axis(limits, healthy, 0, sense, measured, motion, run)
    assert got == REASONS["NOT_FINITE"][0]
    bad_demand = module.AxisState(0.0, 0.0, 1)
    got = module.check_axis(limits, bad_demand, 0, NORMAL, STILL.position, STILL, run)
    assert got == REASONS["NOT_FINITE"][0]
    for name, value, reason in (
        ("position", 0.501, "POSITION"),
        ("position", -0.5, "NONE"),
        ("velocity", -2.001, "VELOCITY"),
        ("velocity", 2.0, "NONE"),
        ("fault", 0x2310, "DRIVE_FAULT"),
        ("encoder_age", 0.0, "NONE"),
        ("encoder_age", -0.001, "STALE_ENCODER"),  # a negative age means a wrong clock
        ("drive_age", 0.0, "NONE"),
        ("drive_age", -0.001, "STALE_DRIVE"),
        ("jump", -0.0625, "NONE"),
        ("jump", 0.063, "ENCODER_JUMP"),
        ("current", -900.0, "NONE"),  # trips only after some ticks
    ):
        sense, measured, motion = axis_with(**{name: value})
        got = module.check_axis(limits, healthy, 0, sense, measured, motion, run)
        assert got == REASONS[reason][0], (name, value)


def _check_mismatch(module: Any, limits: Any) -> None:
    """Check every command, current on and next to a bound, mode, and previous count."""
    scale, tolerance = BOUNDS["newtons_per_ampere"], BOUNDS["current_difference_stop"]
    edges = [around + side * tolerance for around in (-4.0, 0.0, 4.0) for side in (-1.0, 1.0)]
    currents = [edge + off for edge in edges for off in (-0.0625, 0.0, 0.0625)]
    for commanded, current, on, saturated, (name, mode), before in itertools.product(
        (-4.0, 0.0, 4.0), (*currents, math.nan), (0, 1), (0, 1), MODES.items(), (0, 1, 5)
    ):
        low, high = commanded, commanded
        if saturated:  # the drive may supply less, not more, and not the opposite sign
            low, high = min(commanded, 0.0), max(commanded, 0.0)
        agrees = low - tolerance <= current <= high + tolerance
        expected_count = max(before - 1, 0) if agrees else before + 1
        if not on or name not in ("RUN", "STOP_2", "STOP_1"):
            expected_count = 0
        state = module.AxisState(scale * commanded, 0.0, 0)
        sense = NORMAL._replace(current=current, enabled=on)
        got = module.mismatch_ticks(limits, state, before, sense, saturated, mode)
        assert got == expected_count, (commanded, current, on, saturated, name, before)
        assert type(got) is int


def expected_grant(
    before: float, square: float, demand: float, mode: int
) -> tuple[tuple[float, float, int], tuple[float, float, int, int]]:
    """Return the expected state and command of `grant`."""
    share = DT / BOUNDS["current_rms_time"]
    decayed = square * (1.0 - share)
    if mode not in (MODES["RUN"], MODES["STOP_2"], MODES["STOP_1"]):
        on = int(mode == MODES["ENABLING"])
        return (0.0, decayed, 0), (0.0, 0.0, on, 0 if demand == 0.0 else LIMITED["MODE"])
    if not math.isfinite(demand):
        return (0.0, decayed, 1), (0.0, 0.0, 1, LIMITED["NOT_FINITE"])
    rms_exceeded = square >= BOUNDS["current_rms"] ** 2
    ceiling = RMS if rms_exceeded else PEAK
    flags = 0
    limited = min(max(demand, -ceiling), ceiling)
    if limited != demand:
        flags += LIMITED["CURRENT_RMS" if rms_exceeded else "CURRENT_PEAK"]
    force = min(max(limited, before - SLEW), before + SLEW)
    if force != limited:
        flags += LIMITED["SLEW"]
    current = force / BOUNDS["newtons_per_ampere"]
    return (force, decayed + share * current * current, 0), (force, current, 1, flags)


DEMANDS = (
    *(0.0, 1.0, 8.0, 9.0, -8.0, -9.0, 32.0, 33.0, -33.0, 38.0, -38.0, 64.0, -64.0, 65.0, -65.0),
    *(1e9, -1e9, math.nan, math.inf, -math.inf),
)
GRANTS = [
    (before, square, demand, mode, expected_grant(before, square, demand, mode))
    for before, square, demand, mode in itertools.product(
        (0.0, 1.0, 30.0, -30.0, 60.0, -60.0, 64.0, -64.0),
        (0.0, 40.0, math.nextafter(64.0, 0.0), 64.0, 65.0),
        DEMANDS,
        MODES.values(),
    )
]


def _check_grants(module: Any, limits: Any) -> None:
    """Check all cases of `GRANTS`."""
    for before, square, demand, mode, (state, command) in GRANTS:
        for not_finite in (0, 1):
            memory = module.AxisState(before, square, not_finite)
            got_state, got_command = module.grant(limits, memory, demand, 1, mode, DT)
            case = (before, square, demand, mode)
            assert got_state.force == state[0], case
            assert math.isclose(got_state.mean_square, state[1], rel_tol=1e-12), case
            assert got_state.not_finite == state[2], case
            assert got_command == command, case
            assert type(got_command.limited) is int
            gated_state, gated_command = module.grant(limits, memory, demand, 0, mode, DT)
            if command[2] == 0 or mode == MODES["ENABLING"] or not math.isfinite(demand):
                assert (gated_state, gated_command) == (got_state, got_command), case
                continue
            rest = square * (1.0 - DT / BOUNDS["current_rms_time"])
            assert math.isclose(gated_state.mean_square, rest, rel_tol=1e-12), case
            assert (gated_state.force, gated_state.not_finite) == (0.0, 0), case
            assert gated_command == (0.0, 0.0, 1, LIMITED["GATED"]), case
