"""Detection of bus-off of our own CAN controller from its error frames (linux/can/error.h).

The controller goes off the bus when its transmit error count exceeds 255: a wire is cut or shorted,
a terminator is missing, or a bit rate is wrong. This module does not restart it: a person must
check the wire first.
"""

import can

BUS_OFF = 0x040  # CAN_ERR_BUSOFF, in the identifier of an error frame


class BusOffListener(can.Listener):
    """Looks for the bus-off error frame in all frames; called from the library's thread."""

    def __init__(self) -> None:
        self.occurred = False

    def on_message_received(self, msg: can.Message) -> None:
        """Record a bus-off error frame."""
        if msg.is_error_frame and msg.arbitration_id & BUS_OFF:
            self.occurred = True

    def explain(self) -> str:
        """Return a message about a bus-off, for people; empty if none occurred."""
        if not self.occurred:
            return ""
        return (
            "the CAN controller of this computer went off the bus (bus-off): check the wire, its "
            "terminators and bit rates, then bring it back (docs/how_to/set_up_can_and_serial.md)"
        )
