"""Modbus TCP and RTU: register maps as data, and lines that reject late answers.

Not for the tick: an answer takes milliseconds. A poller process sends the requests; the loop reads
the last value and its age. The largest age is poll period + timeout, so an e-stop read this way is
monitoring only; the stop chain is hard-wired.
"""
