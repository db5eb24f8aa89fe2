"""Bits on the wire by counting them, and schedules that do not fit."""

from __future__ import annotations

import math
import random

import pytest

from drivers.canopen import bus_load
from drivers.canopen.bus_load import Frame, OverloadError, check_load, frame_bits, heartbeat, load

PUBLISHED = {0: 55, 2: 75, 4: 95, 6: 115, 8: 135}


def stuffed(bits: list[int]) -> int:
    """Length after stuffing: a bit of the other level after every five of one level."""
    length, run, last = 0, 0, -1
    for bit in bits:
        length, run, last = length + 1, run + 1 if bit == last else 1, bit
        if run == 5:
            length, run, last = length + 1, 1, 1 - bit
    return length


def crc15(bits: list[int]) -> list[int]:
    register = 0
    for bit in bits:
        feed = bit ^ register >> 14 & 1
        register = (register << 1 & 0x7FFF) ^ (0x4599 if feed else 0)
    return [register >> n & 1 for n in range(14, -1, -1)]


def on_the_wire(identifier: int, data: bytes) -> int:
    """All bits of a frame and the space after it."""
    head = [0, *(identifier >> n & 1 for n in range(10, -1, -1)), 0, 0, 0]
    head += [len(data) >> n & 1 for n in range(3, -1, -1)]
    head += [byte >> n & 1 for byte in data for n in range(7, -1, -1)]
    return stuffed(head + crc15(head)) + 1 + 2 + 7 + 3


def test_the_formula_gives_the_published_bits() -> None:
    assert {n: frame_bits(n) for n in PUBLISHED} == PUBLISHED
    for n in (-1, 9):
        with pytest.raises(ValueError, match="0 to 8"):
            frame_bits(n)


def test_no_real_frame_is_longer_than_the_formula() -> None:
    dice = random.Random(4)
    worst = dict.fromkeys(range(9), 0)
    for _ in range(6000):
        n = dice.randrange(9)
        level = dice.choice((0x00, 0xFF, 0x1F, 0x78, 0x87, 0xC3, dice.randrange(256)))
        data = bytes(level if dice.random() < 0.7 else dice.randrange(256) for _ in range(n))
        worst[n] = max(worst[n], on_the_wire(dice.choice((0, 0x7FF, dice.randrange(2048))), data))
    for n, bits in worst.items():
        assert 44 + 3 + 8 * n < bits <= frame_bits(n)


def axis(name: str, rate: float = 1000.0, divider: int = 1) -> tuple[Frame, ...]:
    return (
        bus_load.synchronous(f"{name} RPDO1", 4, rate, divider),
        bus_load.synchronous(f"{name} TPDO1", 8, rate, divider),
    )


def test_one_two_and_three_axes_at_1_khz() -> None:
    sync = bus_load.sync(1000.0)
    full = (Frame("RPDO", 8, 1e3), Frame("TPDO", 8, 1e3))
    assert load((sync, *full), 1e6, 1e3).total == pytest.approx(0.325)
    assert load((sync, *axis("heave")), 1e6, 1e3).total == pytest.approx(0.285)
    assert check_load((sync, *axis("heave"), *axis("surge")), 1e6, 1e3).total == pytest.approx(
        0.515
    )
    assert check_load((sync, *full, *full), 1e6, 1e3).total == pytest.approx(0.595)
    with pytest.raises(OverloadError):
        check_load((sync, *full, *full, *full), 1e6, 1e3)
    assert check_load((sync, *full), 500e3, 1e3).total == pytest.approx(0.65)
    with pytest.raises(OverloadError):
        check_load((sync, *axis("heave")), 250e3, 1e3)


def test_a_refusal_lists_what_each_frame_takes() -> None:
    schedule = (bus_load.sync(1e3), *axis("heave"), heartbeat("master heartbeat", 0.1))
    with pytest.raises(OverloadError) as error:
        check_load(schedule, 250e3, 1e3)
    assert str(error.value).splitlines() == [
        "CAN bus at 250 kbit/s: 114.3 % in the worst case, above 80 %; "
        "140 % of a cycle when all falls into it",
        "  SYNC: 55 bits, 22.0 %",
        "  heave RPDO1: 95 bits, 38.0 %",
        "  heave TPDO1: 135 bits, 54.0 %",
        "  master heartbeat: 65 bits, 0.3 %",
    ]


def test_dividers_thin_out_but_may_all_fall_into_one_cycle() -> None:
    slow = tuple(bus_load.synchronous(f"slow {n}", 8, 1e3, 20) for n in range(6))
    slow_load = load((bus_load.sync(1e3), *slow), 1e6, 1e3)
    assert slow_load.total == pytest.approx(0.055 + 6 * 0.135 / 20)
    assert slow_load.busiest_cycle == pytest.approx(0.055 + 6 * 0.135)
    crowded = check_load((bus_load.sync(1e3), *slow, *slow), 1e6, 1e3)
    assert crowded.busiest_cycle > 1.0  # frames with high identifiers come one cycle later
    twice = load((Frame("fast", 0, 2e3),), 1e6, 1e3)
    assert twice.busiest_cycle == pytest.approx(0.110)


def test_exactly_the_limit_is_admitted() -> None:
    frame = Frame("full", 8, 1e3)
    assert check_load((frame,), 135 * 1e3 / bus_load.LIMIT, 1e3).total <= bus_load.LIMIT
    with pytest.raises(OverloadError):
        check_load((frame,), 135 * 1e3 / bus_load.LIMIT * 0.999, 1e3)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_invalid_rates_are_refused(bad: float) -> None:
    for call in (
        lambda: load((Frame("x", 1, bad),), 1e6, 1e3),
        lambda: load((), bad, 1e3),
        lambda: load((), 1e6, bad),
        lambda: heartbeat("x", bad),
    ):
        with pytest.raises(ValueError, match="not above 0"):
            call()
    with pytest.raises(ValueError, match="divider"):
        bus_load.synchronous("x", 1, 1e3, 241)
