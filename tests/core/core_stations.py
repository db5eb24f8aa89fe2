"""Independent specification of the power checks, to be run on any version of the modules.

The numbers are exact in binary and small, so that many cases lie exactly on a bound.
"""

from __future__ import annotations

import itertools
import random
from typing import Any

from core_checks import MODES, REASONS

from controllers.signals import AxisCommand, AxisSense, Demand, Estimate
from rig.realtime import axis, motor_power

CASES = 20_000
POWERED = [MODES[name] for name in ("RUN", "STOP_2", "STOP_1")]


def averaged(before: float, value: float, newest: float) -> float:
    """Return the low-pass average in another form."""
    return (1.0 - newest) * before + newest * value


def _draw(rng: random.Random, *choices: float) -> float:
    return rng.choice(choices)


def check_wavebot_power_checks(module: Any) -> None:
    """Check averages, the power that counts, every bound from both sides, and resets."""
    rest = ((0.0, 0.0, 0.0, 0), 0.0, 0.0, 0.0, 0.0, 0)
    assert module.start() == rest
    rng = random.Random(1)
    bounds = {
        "motor": motor_power.Params(0.25, 2.0, 2.0, 0.5), "slow_weight": 0.125,
        "balance_stop": 4.0, "friction": 2.0, "loss": 0.5, "newtons_per_ampere": 4.0,
    }  # fmt: skip
    counts_by_reason = dict.fromkeys(("NONE", "FORCE_DISAGREES", "POWER_SIGN", "POWER_BALANCE"), 0)
    for _ in range(CASES):
        absorbs = rng.choice((0, 1))
        params = module.Params(absorbs=absorbs, **bounds)
        position, velocity = _draw(rng, -2.0, 0.0, 1.0), _draw(rng, -2.0, -1.0, 0.0, 1.0, 2.0)
        current = _draw(rng, -1.0, 0.0, 0.5, 1.0, 2.0)
        trs = _draw(rng, 4.0 * current, -2.0, 0.0, 1.0, 4.0)
        lcb = trs + _draw(rng, 0.0, 0.0, -2.0, 2.0, 4.0, -6.0)
        kp, ki = _draw(rng, -8.0, -1.0, 0.0, 8.0), _draw(rng, 0.0, 0.0, 1.0, -4.0)
        km = _draw(rng, 0.0, 0.0, 0.0, 0.0, 2.0)
        limited = rng.choice((0, 0, 0, 0, 4))
        saturated = rng.choice((0, 0, 0, 0, 1))
        fade = _draw(rng, 0.0, 0.0, 0.0, 0.0, 0.5)
        mode = rng.choice((*MODES.values(), MODES["RUN"], MODES["RUN"], MODES["RUN"]))
        shaft = trs * velocity
        ac = shaft + _draw(rng, 0.0, 0.0, 4.0, -4.0, 4.5, 6.0, -5.0)
        counts = kp < 0.0 and km == 0.0 and limited == saturated == 0 and fade == 0.0
        counts = counts and (absorbs == 1 or mode != MODES["RUN"])
        values = (
            shaft - ki * position * velocity if counts else 0.0,
            4.0 * current * velocity - shaft, abs(shaft), (lcb - trs) * velocity,
            velocity * velocity, ac - shaft, current * current,
        )  # fmt: skip
        # An average equal to its value stays there, so bounds are met exactly.
        before = tuple(value if rng.random() < 0.8 else 2.0 * value + 1.0 for value in values)
        record = axis.Record(
            AxisSense(0, 0.0, current, 1, 0, 0.0),
            Estimate(position, velocity, 9.0),
            Demand(kp, ki, km, 77.0),
            AxisCommand(7.0, 7.0, 1, limited),
            0,
        )
        state = module.State(motor_power.State(*before[:3], 0), *before[3:], 0)
        got = module.step(params, state, record, fade, saturated, lcb, trs, ac, mode)
        if mode not in POWERED:
            assert got == rest
            continue
        shares = (0.25, 0.25, 0.25, 0.125, 0.125, 0.125, 0.125)
        expected = tuple(map(averaged, before, values, shares))
        assert (*got.motor[:3], *got[1:5]) == expected, (before, values)
        fed, motor, size, cells, speed, electric, heat = expected
        reason = "NONE"
        if abs(motor) > 2.0 + 0.5 * size:
            reason = "FORCE_DISAGREES"
        elif fed > 2.0:
            reason = "POWER_SIGN"
        elif (
            cells > 4.0
            or cells < -(4.0 + 2.0 * speed)
            or electric < -4.0
            or electric > 4.0 + 0.5 * heat
        ):
            reason = "POWER_BALANCE"
        assert got.reason == REASONS[reason][0], (expected, reason)
        assert type(got.reason) is int
        counts_by_reason[reason] += 1
    assert min(counts_by_reason.values()) > CASES // 100, counts_by_reason


def check_motor_power(module: Any) -> None:
    """Check the same for a motor alone."""
    rest = (0.0, 0.0, 0.0, 0)
    assert module.start() == rest
    params = module.Params(weight=0.25, fed_stop=2.0, difference_stop=2.0, difference_ratio=0.5)
    for current, torque, velocity, absorbs, mode, moved in itertools.product(
        (-1.0, 0.0, 0.5, 1.0), (-4.0, -1.0, 0.0, 1.0, 2.0, 4.0), (-2.0, -1.0, 0.0, 1.0, 2.0),
        (False, True), MODES.values(), (0.0, 1.0),
    ):  # fmt: skip
        motor, power = 4.0 * current * velocity, torque * velocity
        fed = power if absorbs else 0.0
        values = (fed, motor - power, abs(power))
        before = tuple(value + moved for value in values)
        got = module.step(params, module.State(*before, 0), fed, motor, power, mode)
        if mode not in POWERED:
            assert got == rest
            continue
        expected = [averaged(*each, 0.25) for each in zip(before, values, strict=True)]
        fed, difference, size = expected
        assert list(got[:3]) == expected
        reason = "NONE"
        if abs(difference) > 2.0 + 0.5 * size:
            reason = "FORCE_DISAGREES"
        elif fed > 2.0:
            reason = "POWER_SIGN"
        assert got.reason == REASONS[reason][0], expected
        assert type(got.reason) is int
