"""A raw Ethernet socket for one owner of a segment: it never waits, and hears its own answers only.

Two programs share a segment's interface, and each hears the answers to both. So each owner has
a range of indices of its own, and the kernel drops all other frames (a BPF program on the index).
"""

import ctypes
import socket
import struct
import time

from drivers.errors import LinkError
from drivers.ethercat.frames import ETHERTYPE, INDEX_PLACE

TICK_INDICES = range(16, 256)  # of the loop; pysoem uses 0 to 15
_ATTACH_FILTER = 26  # SO_ATTACH_FILTER
_BYPASS_QUEUE, _SOL_PACKET = 20, 263  # PACKET_QDISC_BYPASS: send at once
_MAX_FRAME = 1518
_LOAD_BYTE, _AT_LEAST, _RETURN = 0x30, 0x35, 0x06  # BPF: ldb [k]; jge k; ret k


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.c_void_p))


def filter_indices(own: socket.socket, indices: range) -> None:
    """Let a socket receive only frames whose first datagram has one of the indices."""
    code = b"".join(
        struct.pack("=HBBI", *each)
        for each in (
            (_LOAD_BYTE, 0, 0, INDEX_PLACE),
            (_AT_LEAST, 0, 2, indices.start),
            (_AT_LEAST, 1, 0, indices.stop),
            (_RETURN, 0, 0, _MAX_FRAME),
            (_RETURN, 0, 0, 0),
        )
    )
    memory = ctypes.create_string_buffer(code)
    program = _Program(len(code) // 8, ctypes.addressof(memory))
    own.setsockopt(socket.SOL_SOCKET, _ATTACH_FILTER, bytes(program))


class Link:
    """One end of a segment for one thread; once open, it counts errors instead of raising them."""

    def __init__(self, interface: str, indices: range = TICK_INDICES) -> None:
        """Open the interface; LinkError names it and the right that is missing."""
        self.unsent = 0  # frames that the interface did not accept
        self.errors = 0  # failed looks
        self.frame = bytearray(_MAX_FRAME)  # the received frame of `receive`
        self._clock = time.monotonic  # the wire is a place where time may be read
        try:
            own = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)  # hears nothing until bound
        except PermissionError:
            raise LinkError(f"EtherCAT on {interface}: raw sockets need CAP_NET_RAW") from None
        except OSError as error:
            raise LinkError(f"EtherCAT on {interface}: {error.strerror}") from error
        try:
            filter_indices(own, indices)
            own.setsockopt(_SOL_PACKET, _BYPASS_QUEUE, 1)
            own.bind((interface, ETHERTYPE))
            own.setblocking(False)
        except OSError as error:
            own.close()
            raise LinkError(f"EtherCAT on {interface}: {error.strerror or error}") from error
        self._socket = own
        self._send, self._receive = own.send, own.recv_into

    def now(self) -> float:
        """Return the time of the monotonic clock, s."""
        return self._clock()

    def send(self, frame: bytearray) -> bool:
        """Send a frame without waiting; return whether the interface accepted it."""
        try:
            self._send(frame)
        except OSError:
            self.unsent += 1
            return False
        return True

    def receive(self) -> int:
        """Take one frame into `frame`; return its length, 0 if none has come."""
        try:
            return self._receive(self.frame)
        except BlockingIOError:
            return 0
        except OSError:
            self.errors += 1
            return 0

    def close(self) -> None:
        """Close the interface; cannot raise."""
        self._socket.close()
