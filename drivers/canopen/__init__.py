"""CANopen drives and actuators (CiA 301, CiA 402): codecs and handshakes, pure functions.

The codecs and handshakes own no bus and read no clock: ages and counts of ticks are arguments,
frames are bytes. Only `link`, `service` and the bus classes do I/O.
"""
