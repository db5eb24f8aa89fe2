"""Settings of a CAN bus, and the limit of the rate at which a tick can cycle it."""

from typing import Any, NamedTuple

SOCKETCAND_PORT = 29536  # TCP, default if the options of a bus name none
SLCAN_RATE = 100.0  # Hz, highest rate at which a tick can poll an slcan bus


class BusSettings(NamedTuple):
    """Interface, channel and bit rate of a bus."""

    interface: str  # name in python-can: socketcan, pcan, kvaser, socketcand, virtual, ...
    channel: str
    bit_rate: int  # bit/s
    options: tuple[tuple[str, Any], ...]  # passed to python-can unchanged


def unsupported_rate(bus: BusSettings, rate: float) -> str:
    """Return why a tick cannot cycle a bus at ``rate`` (Hz); empty if it can."""
    if bus.interface == "slcan" and rate > SLCAN_RATE:
        return (
            f"slcan on {bus.channel} cannot be cycled at {rate:g} Hz: an empty look at it takes "
            f"1.1 ms; at most {SLCAN_RATE:g} Hz"
        )
    return ""
