"""How a CAN bus is reached, and what forbids to cycle it from a tick."""

from typing import Any, NamedTuple

SOCKETCAND_PORT = 29536  # TCP, where the options of a bus name none
SLCAN_RATE = 100.0  # Hz, the highest with which an slcan bus can be looked at from a tick


class Bus(NamedTuple):
    """How a bus is reached."""

    interface: str  # name in python-can: socketcan, pcan, kvaser, socketcand, virtual, ...
    channel: str
    bit_rate: int  # bit/s
    options: tuple[tuple[str, Any], ...]  # passed on to python-can as they are


def refusal(bus: Bus, rate: float) -> str:
    """Why a bus cannot be cycled at ``rate`` (Hz) from a tick; empty if it can."""
    if bus.interface == "slcan" and rate > SLCAN_RATE:
        return (
            f"slcan on {bus.channel} cannot be cycled at {rate:g} Hz: an empty look at it takes "
            f"1.1 ms; at most {SLCAN_RATE:g} Hz"
        )
    return ""
