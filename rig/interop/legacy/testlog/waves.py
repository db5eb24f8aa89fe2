"""The waves of an entry, from words such as `0.4 Hz JONSWAP 5 inch Hs gamma = 3.3`.

The same number means two things: regular waves are given by their amplitude, irregular ones by
Hs. A name such as 4A is that of the wave file and no current.
"""

import re
from typing import NamedTuple

from rig.interop.legacy.testlog.entry import RemarkKind, Wave, WaveKind

INCH = 0.0254  # m

SEAS = ((0.127, 3.45), (0.127, 2.5), (0.254, 2.5), (0.127, 1.58), (0.254, 1.58))
"""Hs (m) and Tp (s) of the irregular seas of the test, all with gamma 3.3: MASK4 report (Sandia),
Table 3-1."""

_NEAR = 0.01  # 0.29 Hz is written for 3.45 s

_WHEN = re.compile(r"\s*\[?\s*(\d+(?:\.\d+)?)\s*(Hz|s)\b", re.IGNORECASE)
_RANGE = re.compile(r"\[\s*([\d.]+)\s*Hz\s*:\s*([\d.]+)\s*:\s*([\d.]+)\s*\]", re.IGNORECASE)
_HEIGHT = re.compile(r"(\d+(?:\.\d+)?)\s*(?:inch|\"|'')", re.IGNORECASE)
_METRES = re.compile(r"\(\s*(\d*\.\d+)\s*m\s*\)")
_GAMMA = re.compile(r"gamma\s*=?\s*(\d+(?:\.\d+)?)", re.IGNORECASE)
_REPEAT = re.compile(r"(\d+(?:\.\d+)?)\s*s\s+repeat", re.IGNORECASE)
_CODE = re.compile(r"\b(\d{1,2}[A-Z])\b")
_PINK = re.compile(r"\b(PINK[A-Z]?)\b")
_DRY = re.compile(r"on shore|no buoy|lifted out", re.IGNORECASE)


class Read(NamedTuple):
    """Waves of a cell and what is irregular in it."""

    waves: tuple[Wave, ...]
    remarks: tuple[tuple[RemarkKind, str], ...]


def read_waves(text: str) -> Read:
    """The waves that a cell describes; none and a remark where it does not."""
    waves: list[Wave] = []
    remarks: list[tuple[RemarkKind, str]] = []
    for part in text.split(";") if not _DRY.search(text) else [text]:
        one = _one(part)
        waves += one.waves
        remarks += one.remarks
    if len({wave.kind for wave in waves}) > 1:
        remarks.append((RemarkKind.WAVES_MIXED, text.strip()))
    return Read(tuple(waves), tuple(remarks))


def _one(text: str) -> Read:
    said = text.strip()
    low = said.lower()
    if low.startswith("none"):
        dry = ((RemarkKind.NO_WATER, said),) if _DRY.search(said) else ()
        return Read((Wave(WaveKind.CALM),), dry)
    if pink := _PINK.search(said):
        unsaid = (RemarkKind.HEIGHT_UNSAID, said)
        return Read((Wave(WaveKind.PINK, code=pink[1]),), (unsaid,))
    height, when = _HEIGHT.search(said), _WHEN.match(said)
    irregular = "jonswap" in low
    known = irregular or "regular" in low
    if height is None or when is None or not known or float(when[1]) <= 0.0:
        return Read((), ((RemarkKind.WAVES_UNREAD, said),))
    metres = round(float(height[1]) * INCH, 9)
    remarks = []
    other = _METRES.search(said)
    if other is not None and abs(float(other[1]) - metres) > 5e-4:
        remarks.append((RemarkKind.HEIGHT_DISAGREES, said))
    if ("hs" if irregular else "amplitude") not in low:
        remarks.append((RemarkKind.HEIGHT_UNSAID, said))
    if not irregular:
        waves = tuple(
            _timed(Wave(WaveKind.REGULAR, amplitude_m=metres), value, when[2])
            for value in _values(said, when)
        )
        return Read(waves, tuple(remarks))
    gamma, repeat, code = _GAMMA.search(said), _REPEAT.search(said), _CODE.search(said)
    wave = Wave(
        WaveKind.JONSWAP,
        hs_m=metres,
        gamma=float(gamma[1]) if gamma else None,
        repeat_s=float(repeat[1]) if repeat else None,
        code=code[1] if code else "",
    )
    wave = _timed(wave, float(when[1]), when[2])
    if not in_table(wave):
        remarks.append((RemarkKind.SEA_NOT_IN_TABLE, said))
    return Read((wave,), tuple(remarks))


def in_table(wave: Wave) -> bool:
    """Whether an irregular sea is one of the report's Table 3-1 (period within 1 %)."""
    return wave.gamma in (None, 3.3) and any(
        wave.hs_m is not None
        and wave.period_s is not None
        and abs(wave.hs_m - hs) < 1e-9
        and abs(wave.period_s / tp - 1.0) <= _NEAR
        for hs, tp in SEAS
    )


def _values(said: str, when: re.Match[str]) -> tuple[float, ...]:
    """One frequency, or those of a range such as [0.4 Hz:0.1:0.6]."""
    found = _RANGE.search(said)
    if found is None:
        return (float(when[1]),)
    first, step, last = (float(word) for word in found.groups())
    count = round((last - first) / step) if step > 0.0 else 0
    return tuple(round(first + i * step, 9) for i in range(count + 1))


def _timed(wave: Wave, value: float, unit: str) -> Wave:
    frequency = value if unit.lower() == "hz" else 1.0 / value
    return wave._replace(
        frequency_hz=frequency,
        period_s=value if unit.lower() == "s" else 1.0 / value,
        written="Hz" if unit.lower() == "hz" else "s",
    )
