"""Parse the waves of an entry from text such as `0.4 Hz JONSWAP 5 inch Hs gamma = 3.3`.

The height is the amplitude of regular waves and Hs of irregular ones. A name such as 4A is that of
the wave file, not a current.
"""

import re
from typing import NamedTuple

from rig.interop.legacy.testlog.entry import RemarkKind, Wave, WaveKind

INCH = 0.0254  # m

SEAS = ((0.127, 3.45), (0.127, 2.5), (0.254, 2.5), (0.127, 1.58), (0.254, 1.58))
"""Hs (m) and Tp (s) of the irregular seas of the test, all with gamma 3.3: MASK4 report (Sandia),
Table 3-1."""

_PERIOD_TOLERANCE = 0.01  # relative; the log has 0.29 Hz for 3.45 s

_PERIOD = re.compile(r"\s*\[?\s*(\d+(?:\.\d+)?)\s*(Hz|s)\b", re.IGNORECASE)
_RANGE = re.compile(r"\[\s*([\d.]+)\s*Hz\s*:\s*([\d.]+)\s*:\s*([\d.]+)\s*\]", re.IGNORECASE)
_HEIGHT = re.compile(r"(\d+(?:\.\d+)?)\s*(?:inch|\"|'')", re.IGNORECASE)
_METRES = re.compile(r"\(\s*(\d*\.\d+)\s*m\s*\)")
_GAMMA = re.compile(r"gamma\s*=?\s*(\d+(?:\.\d+)?)", re.IGNORECASE)
_REPEAT = re.compile(r"(\d+(?:\.\d+)?)\s*s\s+repeat", re.IGNORECASE)
_CODE = re.compile(r"\b(\d{1,2}[A-Z])\b")
_PINK = re.compile(r"\b(PINK[A-Z]?)\b")
_DRY = re.compile(r"on shore|no buoy|lifted out", re.IGNORECASE)


class ParsedWaves(NamedTuple):
    """Waves of a cell, and its irregularities."""

    waves: tuple[Wave, ...]
    remarks: tuple[tuple[RemarkKind, str], ...]


def read_waves(text: str) -> ParsedWaves:
    """Return the waves that a cell describes; no waves and a remark for unreadable text."""
    waves: list[Wave] = []
    remarks: list[tuple[RemarkKind, str]] = []
    for part in text.split(";") if not _DRY.search(text) else [text]:
        parsed = _parse_part(part)
        waves += parsed.waves
        remarks += parsed.remarks
    if len({wave.kind for wave in waves}) > 1:
        remarks.append((RemarkKind.WAVES_MIXED, text.strip()))
    return ParsedWaves(tuple(waves), tuple(remarks))


def _parse_part(cell_part: str) -> ParsedWaves:
    text = cell_part.strip()
    lower = text.lower()
    if lower.startswith("none"):
        dry = ((RemarkKind.NO_WATER, text),) if _DRY.search(text) else ()
        return ParsedWaves((Wave(WaveKind.CALM),), dry)
    if pink := _PINK.search(text):
        remark = (RemarkKind.HEIGHT_UNSPECIFIED, text)
        return ParsedWaves((Wave(WaveKind.PINK, code=pink[1]),), (remark,))
    height, period = _HEIGHT.search(text), _PERIOD.match(text)
    irregular = "jonswap" in lower
    has_kind = irregular or "regular" in lower
    if height is None or period is None or not has_kind or float(period[1]) <= 0.0:
        return ParsedWaves((), ((RemarkKind.WAVES_UNREADABLE, text),))
    metres = round(float(height[1]) * INCH, 9)
    remarks = []
    in_metres = _METRES.search(text)
    if in_metres is not None and abs(float(in_metres[1]) - metres) > 5e-4:
        remarks.append((RemarkKind.HEIGHT_DISAGREES, text))
    if ("hs" if irregular else "amplitude") not in lower:
        remarks.append((RemarkKind.HEIGHT_UNSPECIFIED, text))
    if not irregular:
        waves = tuple(
            _with_period(Wave(WaveKind.REGULAR, amplitude_m=metres), value, period[2])
            for value in _frequencies(text, period)
        )
        return ParsedWaves(waves, tuple(remarks))
    gamma, repeat, code = _GAMMA.search(text), _REPEAT.search(text), _CODE.search(text)
    wave = Wave(
        WaveKind.JONSWAP,
        hs_m=metres,
        gamma=float(gamma[1]) if gamma else None,
        repeat_s=float(repeat[1]) if repeat else None,
        code=code[1] if code else "",
    )
    wave = _with_period(wave, float(period[1]), period[2])
    if not in_table(wave):
        remarks.append((RemarkKind.SEA_NOT_IN_TABLE, text))
    return ParsedWaves((wave,), tuple(remarks))


def in_table(wave: Wave) -> bool:
    """Return whether an irregular sea is in the report's Table 3-1 (period within 1 %)."""
    return wave.gamma in (None, 3.3) and any(
        wave.hs_m is not None
        and wave.period_s is not None
        and abs(wave.hs_m - hs) < 1e-9
        and abs(wave.period_s / tp - 1.0) <= _PERIOD_TOLERANCE
        for hs, tp in SEAS
    )


def _frequencies(text: str, period: re.Match[str]) -> tuple[float, ...]:
    """Return one frequency, or those of a range such as [0.4 Hz:0.1:0.6]."""
    range_match = _RANGE.search(text)
    if range_match is None:
        return (float(period[1]),)
    first, step, last = (float(number) for number in range_match.groups())
    count = round((last - first) / step) if step > 0.0 else 0
    return tuple(round(first + i * step, 9) for i in range(count + 1))


def _with_period(wave: Wave, value: float, unit: str) -> Wave:
    frequency = value if unit.lower() == "hz" else 1.0 / value
    return wave._replace(
        frequency_hz=frequency,
        period_s=value if unit.lower() == "s" else 1.0 / value,
        written="Hz" if unit.lower() == "hz" else "s",
    )
