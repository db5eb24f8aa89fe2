"""CANopen drives and actuators (CiA 301, CiA 402): codecs and handshakes, pure functions.

Nothing here owns a bus or asks the time: ages and counts of ticks are arguments, frames are bytes.
"""
