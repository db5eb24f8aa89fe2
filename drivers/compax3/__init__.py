"""Parker Compax3 servo drive: binary records, ASCII lines, and the +-10 V command path.

Binary records carry a checksum and are the way to read and write objects; ASCII lines carry none
and are for people and diagnostics. The fast command is the analog voltage.
"""
