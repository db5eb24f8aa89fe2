"""Settings of a CAN bus, and the limit of the rate at which a tick can cycle it."""

from typing import Any, NamedTuple, Self

SOCKETCAND_PORT = 29536  # TCP, default if the options of a bus name none
SLCAN_RATE = 100.0  # Hz, highest rate at which a tick can poll an slcan bus


class BusSettings(NamedTuple):
    """Interface, channel and bit rate of a bus."""

    interface: str  # name in python-can: socketcan, pcan, kvaser, socketcand, virtual, ...
    channel: str
    bit_rate: int  # bit/s
    options: tuple[tuple[str, Any], ...]  # passed to python-can unchanged

    @property
    def endpoint(self) -> tuple[str, int]:
        """Host and TCP port of a bus behind socketcand."""
        options = dict(self.options)
        return str(options.get("host", "127.0.0.1")), int(options.get("port", SOCKETCAND_PORT))

    @classmethod
    def from_json(cls, fields: list[Any]) -> Self:
        """Return the settings from their JSON values, in the order of the fields."""
        interface, channel, bit_rate, options = fields
        return cls(interface, channel, bit_rate, tuple((key, value) for key, value in options))


def unsupported_rate(bus: BusSettings, rate: float) -> str:
    """Return why a tick cannot cycle a bus at ``rate`` (Hz); empty if it can."""
    if bus.interface == "slcan" and rate > SLCAN_RATE:
        return (
            f"slcan on {bus.channel} cannot be cycled at {rate:g} Hz: an empty look at it takes "
            f"1.1 ms; at most {SLCAN_RATE:g} Hz"
        )
    return ""
