"""Error codes of drives (0x603F, emergencies) and bits of the error register, as text."""

# CiA 301 classes by the high digits; an unlisted manufacturer's code gets the text of its class.
CLASSES: tuple[tuple[int, int, str], ...] = (
    # mask   value   meaning
    (0xFF00, 0x0000, "error reset or no error"),
    (0xFF00, 0x2100, "current, input side"),
    (0xFF00, 0x2200, "current inside the device"),
    (0xFF00, 0x2300, "current, output side"),
    (0xFF00, 0x3100, "mains voltage"),
    (0xFF00, 0x3200, "voltage inside the device"),
    (0xFF00, 0x3300, "output voltage"),
    (0xFF00, 0x4100, "ambient temperature"),
    (0xFF00, 0x4200, "device temperature"),
    (0xFF00, 0x6100, "internal software"),
    (0xFF00, 0x6200, "user software"),
    (0xFF00, 0x6300, "data set"),
    (0xFF00, 0x8100, "communication"),
    (0xFF00, 0x8200, "protocol error"),
    (0xFF00, 0xFF00, "specific to the device"),
    (0xF000, 0x1000, "generic error"),
    (0xF000, 0x2000, "current"),
    (0xF000, 0x3000, "voltage"),
    (0xF000, 0x4000, "temperature"),
    (0xF000, 0x5000, "device hardware"),
    (0xF000, 0x6000, "device software"),
    (0xF000, 0x7000, "additional modules"),
    (0xF000, 0x8000, "monitoring"),
    (0xF000, 0x9000, "external error"),
    (0xF000, 0xF000, "additional functions"),
)

# Codes of the supported drives, from their manuals and EDS files.
CODES = {
    0x0000: "error reset",
    0x2310: "continuous over-current",
    0x2320: "short circuit or earth leakage",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4310: "drive over-temperature",
    0x5530: "EEPROM",
    0x6320: "parameter error",
    0x7305: "position sensor",
    0x7500: "communication",
    0x8110: "CAN overrun",
    0x8120: "CAN error passive",
    0x8130: "heartbeat or life guarding lost",
    0x8140: "recovered from bus-off",
    0x8210: "PDO not processed, wrong length",
    0x8220: "PDO too long",
    0x8240: "SYNC of unexpected length",
    0x8250: "RPDO deadline missed",
    0x8611: "following error",
    0xFF00: "specific to the device",
}

REGISTER = (  # bits of the error register 0x1001
    "generic", "current", "voltage", "temperature", "communication", "profile", "reserved", "maker",
)  # fmt: skip


_COMMUNICATION = (0x7500, 0x8100, 0x8200, 0x8700)  # 0x87xx: synchronisation


def is_communication(code: int) -> bool:
    """Return whether a drive reports with a code that its bus failed, not the drive itself."""
    return code & 0xFF00 in _COMMUNICATION


def meaning(code: int) -> str:
    """Return the text of a code, or else of its class; every code has a text."""
    if code in CODES:
        return CODES[code]
    for mask, value, text in CLASSES:
        if code & mask == value:
            return text
    return "reserved"
