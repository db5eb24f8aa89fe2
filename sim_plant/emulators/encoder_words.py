"""SSI words of an IncOder Midi Ultra encoder. Pure.

Source: Zettlex/Celera product guide MIDI ULTRA, protocols SSI1, SSI2, SSI4, SSI6, SSI9. Not
confirmed: that the parity of SSI2 covers the position alone, and a vendor's value of SSI6's check
sum. SSI7 and SSI8 are unknown and not implemented.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.units import Count, Flag, Radian, Second

LENGTHS: dict[int, Count] = {1: 24, 2: 24, 4: 32, 6: 32, 9: 32}  # bits of a word, by protocol
STAMPED: dict[int, Second] = {4: 1.0e-5, 9: 1.0e-6}  # tick of the time stamp
MAX_BITS = {1: 22, 2: 22, 4: 19, 6: 22, 9: 19}

STEP, CREEP = 30.0, 10.0  # deg of the encoder's own shaft, deg/s

FAULTS = {
    "invalid": "the word marks its position as not valid (PV 0; SSI2: alarm 1)",
    "wrapped": "the position jumps by half a turn and stays there",
    "reversed": "the position counts in the opposite direction from its present value",
    "stepped": f"the position jumps by {STEP:g} deg and stays there",
    "creeping": f"the position drifts away by {CREEP:g} deg/s",
    "stuck": "the position does not change, the time stamp continues",
    "frozen_word": "the same word is repeated, time stamp included",
    "wrong_crc": "check sum (SSI6) or parity (SSI2) is wrong; other words carry none",
    "no_answer": "the encoder does not answer its clock",
    "zero_moved": "the word marks its zero as not the manufacturer's (ZPD 0)",
}


class EncoderSettings(NamedTuple):
    """Type and mounting of an encoder."""

    protocol: int = 4  # 1, 2, 4, 6 or 9
    bits: Count = 19  # of one turn
    sign: int = 1  # -1: counts fall with a growing angle
    zero: Count = 0  # count at angle 0
    zero_is_makers: Flag = 1  # ZPD


def crc8(value: int) -> int:
    """Return SSI6's check sum over 24 bits: polynomial 97, start 0, no final xor."""
    crc = 0
    for shift in (16, 8, 0):
        crc ^= value >> shift & 0xFF
        for _ in range(8):
            crc = (crc << 1 ^ 0x97 if crc & 0x80 else crc << 1) & 0xFF
    return crc


def encode_word(
    protocol: int,
    position: Count,
    *,
    valid: bool,
    zero: bool = True,
    stamp: int = 0,
    intact: bool = True,
) -> int:
    """Return an SSI word, first bit highest; `intact` False falsifies parity or check sum.

    Raises ValueError for an unknown protocol or a position out of its range.
    """
    if protocol not in LENGTHS:
        raise ValueError(f"no protocol SSI{protocol}; available: {sorted(LENGTHS)}")
    if not 0 <= position < 1 << MAX_BITS[protocol]:
        raise ValueError(
            f"position {position} does not fit SSI{protocol}, which has {MAX_BITS[protocol]} bits"
        )
    if protocol == 2:
        parity = position.bit_count() & 1 ^ (not intact)
        return position << 2 | parity << 1 | (not valid)
    if protocol in STAMPED:
        return valid << 31 | zero << 30 | position << 11 | stamp & 0x7FF
    plain = valid << 23 | zero << 22 | position
    if protocol == 1:
        return plain
    return (crc8(plain) ^ (not intact)) << 24 | plain


class Encoder:
    """One encoder on a shaft, with its faults."""

    def __init__(self, settings: EncoderSettings | None = None) -> None:
        """Raise ValueError for an unknown protocol or too many bits."""
        self.settings = settings or EncoderSettings()
        self.faults = DeviceFaults(FAULTS)
        encode_word(self.settings.protocol, (1 << self.settings.bits) - 1, valid=True)
        self._position: Count | None = None
        self._fault_start: dict[
            str, tuple[Count, Second]
        ] = {}  # position and time at the start of active faults
        self._word: int | None = None

    def count(self, angle: Radian) -> Count:
        """Return the count at an angle, 0 to 2^bits - 1; an angle that is not finite reads 0."""
        turn = 1 << self.settings.bits
        if not math.isfinite(angle):
            return 0
        counts = math.floor(self.settings.sign * angle / (2.0 * math.pi) * turn)
        return (counts + self.settings.zero) % turn

    def latch(self, angle: Radian, time: Second) -> int | None:
        """Return the word for an angle at a time of the encoder's clock; None: no answer."""
        faults, settings = self.faults, self.settings
        if faults.is_on("no_answer"):
            return None
        if faults.is_on("frozen_word") and self._word is not None:
            return self._word
        if not faults.is_on("stuck") or self._position is None:
            self._position = self._apply_motion_faults(self.count(angle), time)
        position = self._position
        if faults.is_on("wrapped"):
            position = (position + (1 << settings.bits - 1)) % (1 << settings.bits)
        tick = STAMPED.get(settings.protocol)
        self._word = encode_word(
            settings.protocol,
            position,
            valid=not faults.is_on("invalid") and math.isfinite(angle),
            zero=settings.zero_is_makers == 1 and not faults.is_on("zero_moved"),
            stamp=0 if tick is None else math.floor(time / tick + 1.0e-6),
            intact=not faults.is_on("wrong_crc"),
        )
        return self._word

    def _apply_motion_faults(self, position: Count, time: Second) -> Count:
        """Return the count with the active motion faults applied."""
        turn = 1 << self.settings.bits
        for name in ("reversed", "stepped", "creeping"):
            if not self.faults.is_on(name):
                self._fault_start.pop(name, None)
                continue
            start_position, start_time = self._fault_start.setdefault(name, (position, time))
            if name == "reversed":
                position = 2 * start_position - position
            elif name == "stepped":
                position += round(STEP / 360.0 * turn)
            else:
                position += round(CREEP * (time - start_time) / 360.0 * turn)
        return position % turn
