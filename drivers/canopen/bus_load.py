"""Worst-case load of a CAN bus, computed before any frame is sent.

    bits of a frame with n data bytes  =  47 + 8 n  +  floor((34 + 8 n - 1) / 4)

47: start, identifier (11 bits), control, CRC, acknowledge, end and 3 bits of space between frames;
the last term: worst-case number of stuff bits in the 34 + 8 n bits subject to stuffing.
"""

from math import isfinite
from typing import NamedTuple

LIMIT = 0.80  # of the bus; the rest is left to SDO, EMCY, NMT and repeated frames


class Frame(NamedTuple):
    """One periodic frame."""

    name: str
    data_bytes: int  # 0 to 8
    rate: float  # Hz, > 0


class FrameShare(NamedTuple):
    """Share of the bus that one frame takes."""

    name: str
    bits: int  # of one frame, worst case
    share: float  # of the bus, 0 to 1 and more


class BusLoad(NamedTuple):
    """Load of a schedule, as fractions of the bus's capacity."""

    total: float  # on average
    busiest_cycle: float  # in one cycle, if every frame falls into it
    shares: tuple[FrameShare, ...]


class OverloadError(ValueError):
    """A schedule that exceeds the bus's capacity; lists the share of each frame."""


def frame_bits(data_bytes: int) -> int:
    """Return the bits of one frame (11-bit identifier, worst stuffing) and the space after it."""
    if not 0 <= data_bytes <= 8:
        raise ValueError(f"{data_bytes} data bytes: a CAN frame has 0 to 8")
    return 47 + 8 * data_bytes + (34 + 8 * data_bytes - 1) // 4


def sync(rate: float) -> Frame:
    """Return the SYNC frame at ``rate`` (Hz)."""
    return Frame("SYNC", 0, rate)


def synchronous(name: str, data_bytes: int, rate: float, divider: int) -> Frame:
    """Return a PDO on every ``divider``-th SYNC (transmission type 1 to 240).

    ``rate``: rate of the SYNC, Hz.
    """
    if not 1 <= divider <= 240:
        raise ValueError(f"{name}: SYNC divider {divider} is not 1 to 240")
    return Frame(name, data_bytes, rate / divider)


def heartbeat(name: str, period: float) -> Frame:
    """Return a heartbeat with ``period`` (s)."""
    if not (period > 0.0 and isfinite(period)):
        raise ValueError(f"{name}: heartbeat period {period} s is not above 0")
    return Frame(name, 1, 1.0 / period)


def load(schedule: tuple[Frame, ...], bit_rate: float, cycle_rate: float) -> BusLoad:
    """Return the worst-case load of a bus (``bit_rate``: bit/s) cycled at ``cycle_rate`` (Hz)."""
    for name, value in (("bit rate", bit_rate), ("cycle rate", cycle_rate)):
        if not (value > 0.0 and isfinite(value)):
            raise ValueError(f"{name} {value} is not above 0")
    for frame in schedule:
        if not (frame.rate > 0.0 and isfinite(frame.rate)):
            raise ValueError(f"{frame.name}: rate {frame.rate} Hz is not above 0")
    bits = [frame_bits(frame.data_bytes) for frame in schedule]
    shares = tuple(
        FrameShare(frame.name, n, n * frame.rate / bit_rate)
        for frame, n in zip(schedule, bits, strict=True)
    )
    total = sum(share.share for share in shares)
    # A frame faster than the cycle falls into it several times.
    busiest = sum(
        n * max(1.0, frame.rate / cycle_rate) for frame, n in zip(schedule, bits, strict=True)
    )
    return BusLoad(total, busiest * cycle_rate / bit_rate, shares)


def check_load(schedule: tuple[Frame, ...], bit_rate: float, cycle_rate: float) -> BusLoad:
    """Return the load; OverloadError above 80 % on average.

    A single overfull cycle is permitted: frames with high identifiers then arrive one cycle later,
    and the status frames of the axes have the lowest identifiers.
    """
    total_load = load(schedule, bit_rate, cycle_rate)
    if total_load.total <= LIMIT:
        return total_load
    busiest = 100 * total_load.busiest_cycle
    lines = [
        f"CAN bus at {bit_rate / 1e3:g} kbit/s: {100 * total_load.total:.1f} % in the worst case, "
        f"above {100 * LIMIT:.0f} %; {busiest:.0f} % of a cycle when all falls into it"
    ]
    lines += [f"  {s.name}: {s.bits} bits, {100 * s.share:.1f} %" for s in total_load.shares]
    raise OverloadError("\n".join(lines))
