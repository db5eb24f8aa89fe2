"""Parse the settings of the rig from text such as `GainMatrix006_2, magK=-6152`."""

import re
from typing import NamedTuple

from rig.interop.legacy.testlog.entry import (
    Activity,
    Amplitude,
    Cell,
    Gain,
    Remark,
    RemarkKind,
    Spring,
)

SCHEMES = {"svpwm": "SVPWM", "svpm": "SVPWM", "dpwm": "DPWM", "sinetri": "SineTri", "hyst": "Hyst"}

_ACTIVITIES = (
    (Activity.GAIN_MATRIX, re.compile(r"GainMatrix\d", re.IGNORECASE)),
    (Activity.MULTISINE, re.compile(r"multi?-?n?sine|multine|\bMS\b")),
    (Activity.SINE, re.compile(r"(?<!multi)sinusoid|(?<!multi)\bsines?\b", re.IGNORECASE)),
    (Activity.CHIRP, re.compile(r"chirp", re.IGNORECASE)),
    (Activity.RAMPS, re.compile(r"\bramps\b", re.IGNORECASE)),
    (Activity.SPRING_SWEEP, re.compile(r"mag spring sweep", re.IGNORECASE)),
    (Activity.BY_HAND, re.compile(r"by[ -]hand|in[ -]hand|manually", re.IGNORECASE)),
)
_MATRIX = re.compile(r"\bGainMatrix(\w+)")
_SPRINGS = (
    (1000.0, re.compile(r"([+-]?\d+(?:\.\d+)?)\s*kN/m")),
    (1.0, re.compile(r"([+-]?\d{3,6})\s*(?:spring\s?K|magSpring)\b", re.IGNORECASE)),
    (1.0, re.compile(r"(?:mag|spring)\s?K\s*=\s*([+-]?\d+)", re.IGNORECASE)),
    (1.0, re.compile(r"spring(?:\s+rate)?(?:\s+at)?\s+([+-]?\d{3,6})\b(?!\s*kN)", re.IGNORECASE)),
    (0.0, re.compile(r"(zero) spring rate", re.IGNORECASE)),
)
_SPRING_NOTES = _SPRINGS[2:3]
_SPRING_MENTIONED = re.compile(
    r"spring rate corrected|mag ?spring (?:home|decoupled)|mag ?spring at home", re.IGNORECASE
)
_STATOR = re.compile(r"stator position\s*\[([-\d,\s]+)\]", re.IGNORECASE)
_GAIN = re.compile(r"(?:\b(heave|surge)\s+|\b([hs])|\b)K([pi])\s*=\s*(\[?[-\d.:\s]*\d\]?)")
_LIST = re.compile(r"\[([^\[\]]*)\]\s*(amps?\b)?", re.IGNORECASE)
_ITEM = re.compile(r"\s*(\d+(?:\.\d+)?|\?+)\s*([A-D])?\s*")
_INLINE = re.compile(r"(?<![\w.\[;,])(\d+(?:\.\d+)?)\s*A\b(?!\w)")
_SCHEME = re.compile(r"(?<![A-Za-z])(SVPWM|SVPM|DPWM|SineTri|Hyst)(?![A-Za-z])", re.IGNORECASE)
_SURGE = re.compile(r"surge(?: drive)?(?: is)? (disabled|disables|enabled)", re.IGNORECASE)
_SURGE_BY_HAND = re.compile(r"surge Kp\b[^.;]*\bmanually", re.IGNORECASE)
_BUS = re.compile(r"DC ?BUS at (\d+(?:\.\d+)?)\s*V\b", re.IGNORECASE)
_COTS = re.compile(r"\bAMC drive\b", re.IGNORECASE)
_CUSTOM = re.compile(r"\bcustom drive\b", re.IGNORECASE)


class EntrySettings(NamedTuple):
    """Settings of an entry, by its fields, as far as the text of its two cells gives them."""

    activities: tuple[Activity, ...]
    matrix: str
    gains: tuple[Gain, ...]
    spring: Spring | None
    stator_percent: tuple[float, ...]
    drive: str
    drive_source: str
    scheme: str
    surge: str
    bus_voltage_v: float | None
    amplitudes: tuple[Amplitude, ...]
    order: tuple[Amplitude, ...]
    remarks: list[Remark]


def read_settings(wavebot: Cell, notes: Cell) -> EntrySettings:
    """Return the settings in the text of an entry, and the irregularities of the text."""
    remarks: list[Remark] = []
    gains = (*_gains(wavebot), *_gains(notes))
    if any(not gain.values for gain in gains):
        remarks.append(wavebot.remark(RemarkKind.RANGE_EMPTY))
    matrix = _MATRIX.search(wavebot.text)
    activities = [activity for activity, pattern in _ACTIVITIES if pattern.search(wavebot.text)]
    gains_in_wavebot_cell = any(gain.cell == wavebot.name for gain in gains)
    if gains_in_wavebot_cell and Activity.GAIN_MATRIX not in activities:
        activities.append(Activity.GAINS)
    amplitudes, unknown = _amplitudes(wavebot.text)
    if unknown:
        remarks.append(wavebot.remark(RemarkKind.AMPLITUDE_UNKNOWN))
    order = _amplitudes(" ".join(match[0] for match in _LIST.finditer(notes.text)))[0]
    stator = _STATOR.search(wavebot.text)
    bus = _BUS.search(wavebot.text)
    drive, drive_source = _drive(wavebot, notes)
    return EntrySettings(
        tuple(activities),
        f"GainMatrix{matrix[1]}" if matrix else "",
        gains,
        _spring(wavebot, notes, remarks),
        tuple(float(part) for part in stator[1].split(",")) if stator else (),
        drive,
        drive_source,
        _scheme(wavebot, notes, remarks),
        _surge(wavebot, notes, remarks),
        float(bus[1]) if bus else None,
        amplitudes,
        order if any(amplitude.waveform for amplitude in order) else (),
        remarks,
    )


def _spring(wavebot: Cell, notes: Cell, remarks: list[Remark]) -> Spring | None:
    rates = _rates(wavebot.text, _SPRINGS)
    if len(rates) > 1:
        remarks.append(wavebot.remark(RemarkKind.SPRING_SEVERAL))
        return None
    if rates:
        return Spring(rates[0], wavebot.name)
    if _SPRING_MENTIONED.search(wavebot.text):
        remarks.append(wavebot.remark(RemarkKind.SPRING_UNSPECIFIED))
    noted = _rates(notes.text, _SPRING_NOTES)
    if len(noted) != 1:
        return None
    remarks.append(notes.remark(RemarkKind.SPRING_IN_NOTES))
    return Spring(noted[0], notes.name)


def _rates(text: str, patterns: tuple[tuple[float, re.Pattern[str]], ...]) -> tuple[float, ...]:
    """Return all different spring rates in a text, N/m."""
    rates = [
        0.0 if match[1].lower() == "zero" else scale * float(match[1])
        for scale, pattern in patterns
        for match in pattern.finditer(text)
    ]
    return tuple(dict.fromkeys(rates))


def _gains(cell: Cell) -> list[Gain]:
    gains = []
    for axis, letter, gain, value_text in _GAIN.findall(cell.text):
        named = "surge" if axis.lower() == "surge" or letter == "s" else "heave"
        parts = value_text.strip("[] ").split(":")
        values = _range([float(part) for part in parts if part.strip()])
        gains.append(Gain(named, f"k{gain}", values, cell.name))
    return gains


def _range(numbers: list[float]) -> tuple[float, ...]:
    """Return the values of a number or of start:step:stop; empty if MATLAB's range is empty."""
    if len(numbers) == 2:
        numbers = [numbers[0], 1.0, numbers[1]]
    if len(numbers) != 3:
        return tuple(numbers)
    first, step, last = numbers
    count = int((last - first) / step + 1e-9) if step != 0.0 and (last - first) * step >= 0 else -1
    return tuple(first + i * step for i in range(count + 1))


def _amplitudes(text: str) -> tuple[tuple[Amplitude, ...], bool]:
    """Return the current amplitudes in a text, and whether one of them is `??`.

    [10A,20A] are amperes; in [10A,10B] the letters are phase realisations.
    """
    amplitudes: list[Amplitude] = []
    unknown = False
    for match in _LIST.finditer(text):
        items = [_ITEM.fullmatch(item) for item in re.split("[;,]", match[1])]
        matched = [item for item in items if item is not None]
        letters = {item[2] for item in matched if item[2]}
        if len(matched) != len(items) or not (letters or match[2]):
            continue
        waveforms = letters - {"A"} != set()
        unknown |= any(item[1].startswith("?") for item in matched)
        amplitudes += [
            Amplitude(float(item[1]), (item[2] or "") if waveforms else "")
            for item in matched
            if not item[1].startswith("?")
        ]
    outside = _LIST.sub(" ", text)
    amplitudes += [Amplitude(float(match[1])) for match in _INLINE.finditer(outside)]
    return tuple(amplitudes), unknown


def _drive(wavebot: Cell, notes: Cell) -> tuple[str, str]:
    """Return the drive that the text names, and the cell that names it."""
    for cell in (wavebot, notes):
        if _COTS.search(cell.text):
            return "COTS", cell.name
        if _CUSTOM.search(cell.text):
            return "custom", cell.name
    return "", ""


def _scheme(wavebot: Cell, notes: Cell, remarks: list[Remark]) -> str:
    in_wavebot = [part.lower() for part in _SCHEME.findall(wavebot.text)]
    in_notes = [part.lower() for part in _SCHEME.findall(notes.text)]
    names, cell = (in_wavebot, wavebot) if in_wavebot else (in_notes, notes)
    if "svpm" in names:
        remarks.append(cell.remark(RemarkKind.SCHEME_MISSPELT))
    schemes = list(dict.fromkeys(SCHEMES[part] for part in names))
    if schemes and cell is notes:
        remarks.append(notes.remark(RemarkKind.SCHEME_IN_NOTES))
    if len(schemes) > 1:
        remarks.append(cell.remark(RemarkKind.SCHEME_SEVERAL))
        return ""
    if in_wavebot and {SCHEMES[part] for part in in_notes} - set(schemes):
        remarks.append(notes.remark(RemarkKind.SCHEME_SEVERAL))
    return schemes[0] if schemes else ""


def _surge(wavebot: Cell, notes: Cell, remarks: list[Remark]) -> str:
    for cell in (wavebot, notes):
        if match := _SURGE.search(cell.text):
            state = match[1].lower()
            if state == "disables":
                remarks.append(cell.remark(RemarkKind.SURGE_MISSPELT))
            return "disabled" if state.startswith("disable") else "enabled"
        if _SURGE_BY_HAND.search(cell.text):
            return "by hand"
    return ""
