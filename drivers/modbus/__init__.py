"""Modbus devices, TCP and RTU: register maps as data, lines that mind stale answers, devices.

Not for the tick: an answer takes milliseconds. A poller process asks, the loop reads last value and
age. The worst age is poll period + time-out, so an e-stop read this way is monitoring; the stop
chain is hard-wired.
"""
