"""A host process, started by a test, that renews an output module's watchdog until it is killed."""

from __future__ import annotations

import sys
import time

from pymodbus.client import ModbusTcpClient

with ModbusTcpClient("127.0.0.1", port=int(sys.argv[1]), retries=0) as client:
    client.write_register(0x1000, int(sys.argv[2]))  # time, 0.1 s
    beat = 0
    while True:
        beat = beat % 0x7FFF + 1
        client.write_register(0x1003, beat)
        client.write_registers(0, [0x2000])
        time.sleep(0.02)
