"""Facts of the line that `pysoem_master` starts; it has no import, since pysoem may be absent."""

VENDOR = 0x0BAD0EC0
IDENTITY = [
    ("Coupler", VENDOR, 0x10000001),
    ("Torque drive", VENDOR, 0x10000500),
    ("Position drive", VENDOR, 0x10000600),
    ("Digital input, 4 channels", VENDOR, 0x10000104),
    ("Digital input, 8 channels", VENDOR, 0x10000108),
    ("Digital output, 4 channels", VENDOR, 0x10000204),
    ("Digital output, 2 channels", VENDOR, 0x10000202),
    ("Analog input, oversampling", VENDOR, 0x10000300),
    ("Absolute encoder, 2 channels", VENDOR, 0x10000402),
]
# 3 for a slave with both directions, 1 with inputs only, 2 with outputs only.
COUNTER = 0 + 3 + 3 + 1 + 1 + 2 + 2 + 1 + 1
ALL_OP = [8] * len(IDENTITY)
