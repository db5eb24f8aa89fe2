"""Calibration of an ATI six-axis transducer: wrench to gage counts or scaled counts. Pure."""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np

from sim_plant.units import Count, Newton, NewtonMetre

SixAxes = tuple[float, float, float, float, float, float]
NEWTON, NEWTON_METRE = 2, 3  # codes of the units
REGISTER_COUNT = 169


class Wrench(NamedTuple):
    """Force and torque in the transducer's axes."""

    fx: Newton = 0.0
    fy: Newton = 0.0
    fz: Newton = 0.0
    tx: NewtonMetre = 0.0
    ty: NewtonMetre = 0.0
    tz: NewtonMetre = 0.0


# A full matrix with cross-talk of a realistic size; every transducer has a matrix of its own.
EXAMPLE_MATRIX: tuple[SixAxes, ...] = (
    (-14.0, 37.0, 984.0, -17880.0, -936.0, 17736.0),
    (-1140.0, 20460.0, 612.0, -10296.0, 444.0, -10188.0),
    (29760.0, 1056.0, 29592.0, 732.0, 30024.0, 1128.0),
    (-13.0, 257.0, -1021.0, -136.0, 1043.0, -115.0),
    (1178.0, 43.0, -583.0, 212.0, -599.0, -226.0),
    (23.0, 616.0, 40.0, 631.0, 26.0, 612.0),
)


class Calibration(NamedTuple):
    """One transducer's calibration; the ratings of a Mini58 vary and are parameters."""

    matrix: tuple[SixAxes, ...] = EXAMPLE_MATRIX  # scaled counts from gage counts, gages G0 to G5
    counts_per_force: Count = 1_000_000
    counts_per_torque: Count = 1_000_000
    ratings: SixAxes = (700.0, 700.0, 1700.0, 30.0, 30.0, 30.0)  # N, N m
    bias: tuple[int, ...] = (312, -145, 88, -420, 57, 263)  # gage counts without load
    gains: tuple[int, ...] = (512, 512, 512, 512, 512, 512)
    offsets: tuple[int, ...] = (32768, 32768, 32768, 32768, 32768, 32768)
    serial: str = "FT00000"
    part: str = "SI-700-30"
    family: str = "DIG"
    calibrated: str = "2026-01-15"


class Gages:
    """Converts a wrench to six gage readings, in counts of the transducer's electronics."""

    def __init__(self, calibration: Calibration) -> None:
        """Raise numpy's LinAlgError for a singular matrix."""
        self.calibration = calibration
        units = [calibration.counts_per_force] * 3 + [calibration.counts_per_torque] * 3
        inverse = np.linalg.inv(np.asarray(calibration.matrix, dtype=np.float32).astype(float))
        self._rows: list[list[float]] = (inverse * np.asarray(units, dtype=float)).tolist()

    def read(self, wrench: Wrench) -> tuple[list[int], bool]:
        """Return the six counts, and whether one of them exceeds 16 bits."""
        counts = []
        saturated = False
        for row, bias in zip(self._rows, self.calibration.bias, strict=True):
            total = sum(rate * value for rate, value in zip(row, wrench, strict=True)) + bias
            if not -32768.0 <= total <= 32767.0:  # also for NaN
                saturated = True
                total = 32767.0 if total > 0.0 else -32768.0
            counts.append(round(total))
        return counts, saturated


def calibration_registers(calibration: Calibration) -> list[int]:
    """Return the calibration as 169 registers, as function 3 reads them from 0x00E3.

    Source: ATI 9610-05-1030 (Digital F/T), calibration structure. The content after the offsets is
    unknown and reads 0; the position of the unit codes in their register is not confirmed.
    """
    texts = struct.pack(
        "8s32s4s20s",
        *(
            text.encode("ascii")
            for text in (
                calibration.serial,
                calibration.part,
                calibration.family,
                calibration.calibrated,
            )
        ),
    )
    data = (
        texts
        + struct.pack(">36f", *(value for row in calibration.matrix for value in row))
        + struct.pack(">BB", NEWTON, NEWTON_METRE)
        + struct.pack(">6f", *calibration.ratings)
        + struct.pack(">ii", calibration.counts_per_force, calibration.counts_per_torque)
        + struct.pack(">6H6H", *calibration.gains, *calibration.offsets)
    )
    data += bytes(2 * REGISTER_COUNT - len(data))
    return list(struct.unpack(f">{REGISTER_COUNT}H", data))
