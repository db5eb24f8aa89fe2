"""CANopen (CiA 301): frames, process data by SYNC, and service of drives (`drivers.cia402`).

The codecs own no bus and read no clock. Only `link`, `service` and the bus classes do I/O.
"""
