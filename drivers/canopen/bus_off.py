"""Whether our own controller has left the bus, as its error frames say (linux/can/error.h).

It does after 256 errors of sending in excess: a wire is cut or shorted, a terminator lacks, or a
bit rate is wrong. Nothing here brings it back: that is for whoever has looked at the wire.
"""

import can

BUS_OFF = 0x040  # CAN_ERR_BUSOFF, in the identifier of an error frame


class BusOff(can.Listener):
    """Hears error frames among all others; called from the library's thread."""

    def __init__(self) -> None:
        self.happened = False

    def on_message_received(self, msg: can.Message) -> None:
        """Note the frame that says it."""
        if msg.is_error_frame and msg.arbitration_id & BUS_OFF:
            self.happened = True

    def explain(self) -> str:
        """What happened, for people; empty if nothing did."""
        if not self.happened:
            return ""
        return (
            "the CAN controller of this computer went off the bus (bus-off): look at the wire, its "
            "terminators and bit rates, then bring it back (docs/wires.md)"
        )
