"""A strain-gauge amplifier with up to nine channels on Modbus RTU, after the DY094.

Source: requests printed by the manufacturer, `01 03 03 00 00 02 C4 4F` (int32) and
`01 03 01 00 00 02 C5 F7` (float32, high word first), 10 to 320 Hz. Not confirmed, and therefore
parameters: the spacing of the channels by two registers, and the scale of the int32.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from sim_plant.emulators.modbus_pdu import Table
from sim_plant.emulators.modbus_unit import ModbusUnit, WordOrder
from sim_plant.units import Count, Hertz, Second

CHANNELS = 9

FAULTS = {
    "saturated": "every channel reads its positive rating",
    "saturated_negative": "every channel reads its negative rating",
    "nan": "float32 channels read not-a-number, int32 channels 7FFFFFFF",
    "drift": "every channel drifts by a percent of its rating each second",
}


class AmplifierSettings(NamedTuple):
    """Settings of an amplifier; values in the unit of its source (N or N m)."""

    rating: float  # beyond it a channel saturates
    rate: Hertz = 100.0  # 10 to 320
    counts_per_unit: float = 1000.0  # of the int32; not confirmed
    float_register: int = 0x0100
    int_register: int = 0x0300
    stride: int = 2  # registers from one channel to the next; not confirmed
    word_order: WordOrder = "upper first"


class StrainAmplifier(ModbusUnit):
    """Samples its channels at its own rate and holds them; holding registers only."""

    def __init__(
        self,
        read: Callable[[], Sequence[float]],
        settings: AmplifierSettings,
        *,
        reply_delay: Second = 0.0,
    ) -> None:
        """`read` returns up to nine channels; missing channels read 0."""
        super().__init__(
            faults=FAULTS,
            word_order=settings.word_order,
            reply_delay=reply_delay,
            functions=frozenset((3, 6, 16)),
        )
        self.settings = settings
        self._read = read
        self._sample_period: int | None = None
        self._drift_start: Second | None = None
        self.samples: Count = 0

    def measure(self, now: Second) -> None:
        """Take a sample if one is due."""
        period = math.floor(now * self.settings.rate)
        if period == self._sample_period:
            return
        self._sample_period = period
        self.samples += 1
        values = tuple(self._read())
        for channel in range(CHANNELS):
            value = self._apply_faults(values[channel] if channel < len(values) else 0.0, now)
            offset = self.settings.stride * channel
            self.put_float(Table.HOLDING, self.settings.float_register + offset, value)
            finite = math.isfinite(value)
            counts = round(value * self.settings.counts_per_unit) if finite else 0x7FFFFFFF
            self.put_int32(Table.HOLDING, self.settings.int_register + offset, counts)

    def _apply_faults(self, value: float, now: Second) -> float:
        rating = self.settings.rating
        if not self.faults.is_on("drift"):
            self._drift_start = None
        else:
            self._drift_start = now if self._drift_start is None else self._drift_start
            value += 0.01 * rating * (now - self._drift_start)
        if self.faults.is_on("nan"):
            return float("nan")
        if self.faults.is_on("saturated"):
            return rating
        if self.faults.is_on("saturated_negative"):
            return -rating
        return max(-rating, min(value, rating))
