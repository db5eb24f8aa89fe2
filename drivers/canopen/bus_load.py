"""How full a CAN bus gets in the worst case, before anything is sent on it.

    bits of a frame with n data bytes  =  47 + 8 n  +  floor((34 + 8 n - 1) / 4)

47: start, identifier (11 bits), control, CRC, acknowledge, end and 3 bits of space between frames;
the last term: stuff bits if the 34 + 8 n bits that are stuffed are as unlucky as can be.
"""

from math import isfinite
from typing import NamedTuple

LIMIT = 0.80  # of the bus; the rest is left to SDO, EMCY, NMT and repeated frames


class Frame(NamedTuple):
    """One frame that is sent again and again."""

    name: str
    data_bytes: int  # 0 to 8
    rate: float  # Hz, > 0


class Share(NamedTuple):
    """What one frame takes."""

    name: str
    bits: int  # of one frame, worst case
    share: float  # of the bus, 0 to 1 and more


class Load(NamedTuple):
    """What a schedule takes."""

    total: float  # of the bus on average
    busiest: float  # of one cycle, if every frame falls into it
    shares: tuple[Share, ...]


class OverloadError(ValueError):
    """A schedule that does not fit the bus; lists what each frame takes."""


def frame_bits(data_bytes: int) -> int:
    """Bits on the wire of one frame, 11-bit identifier, worst stuffing, with the space after it."""
    if not 0 <= data_bytes <= 8:
        raise ValueError(f"{data_bytes} data bytes: a CAN frame has 0 to 8")
    return 47 + 8 * data_bytes + (34 + 8 * data_bytes - 1) // 4


def sync(rate: float) -> Frame:
    """The SYNC frame, ``rate`` (Hz) times a second."""
    return Frame("SYNC", 0, rate)


def synchronous(name: str, data_bytes: int, rate: float, divider: int) -> Frame:
    """A PDO on every ``divider``-th SYNC (transmission type 1 to 240); ``rate`` (Hz): of SYNC."""
    if not 1 <= divider <= 240:
        raise ValueError(f"{name}: SYNC divider {divider} is not 1 to 240")
    return Frame(name, data_bytes, rate / divider)


def heartbeat(name: str, period: float) -> Frame:
    """A heartbeat every ``period`` (s)."""
    if not (period > 0.0 and isfinite(period)):
        raise ValueError(f"{name}: heartbeat period {period} s is not above 0")
    return Frame(name, 1, 1.0 / period)


def load(schedule: tuple[Frame, ...], bit_rate: float, cycle_rate: float) -> Load:
    """Worst-case load of a bus (``bit_rate``: bit/s) that is cycled at ``cycle_rate`` (Hz)."""
    for name, value in (("bit rate", bit_rate), ("cycle rate", cycle_rate)):
        if not (value > 0.0 and isfinite(value)):
            raise ValueError(f"{name} {value} is not above 0")
    for frame in schedule:
        if not (frame.rate > 0.0 and isfinite(frame.rate)):
            raise ValueError(f"{frame.name}: rate {frame.rate} Hz is not above 0")
    bits = [frame_bits(frame.data_bytes) for frame in schedule]
    shares = tuple(
        Share(frame.name, n, n * frame.rate / bit_rate)
        for frame, n in zip(schedule, bits, strict=True)
    )
    total = sum(share.share for share in shares)
    # A frame faster than the cycle falls into it several times.
    busiest = sum(
        n * max(1.0, frame.rate / cycle_rate) for frame, n in zip(schedule, bits, strict=True)
    )
    return Load(total, busiest * cycle_rate / bit_rate, shares)


def admit(schedule: tuple[Frame, ...], bit_rate: float, cycle_rate: float) -> Load:
    """The load, or OverloadError above 80 % on average.

    A cycle into which more falls than fits is let pass: what has a high identifier comes one cycle
    later, and the status of the axes has the lowest ones.
    """
    found = load(schedule, bit_rate, cycle_rate)
    if found.total <= LIMIT:
        return found
    lines = [
        f"CAN bus at {bit_rate / 1e3:g} kbit/s: {100 * found.total:.1f} % in the worst case, above "
        f"{100 * LIMIT:.0f} %; {100 * found.busiest:.0f} % of a cycle when all falls into it"
    ]
    lines += [f"  {s.name}: {s.bits} bits, {100 * s.share:.1f} %" for s in found.shares]
    raise OverloadError("\n".join(lines))
