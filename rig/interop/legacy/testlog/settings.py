"""Parse the settings of the rig from text such as `GainMatrix006_2, magK=-6152`."""

import re
from typing import NamedTuple

from rig.interop.legacy.testlog.entry import Activity, Amplitude, Gain, RemarkKind, Spring

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

Remarks = list[tuple[RemarkKind, int]]  # kind, and cell: 0 WaveBot, 1 notes


class EntrySettings(NamedTuple):
    """Settings in the two cells of an entry, and the irregularities of their text."""

    activities: tuple[Activity, ...]
    matrix: str
    gains: tuple[Gain, ...]
    spring: Spring | None
    stator: tuple[float, ...]
    drive: str
    drive_cell: str
    scheme: str
    surge: str
    bus_voltage: float | None
    amplitudes: tuple[Amplitude, ...]
    order: tuple[Amplitude, ...]
    remarks: Remarks


def read_settings(wavebot: str, notes: str, cells: tuple[str, str]) -> EntrySettings:
    """Return the settings in an entry's text; ``cells`` are the names of its two cells."""
    remarks: Remarks = []
    gains = tuple(
        gain
        for text, cell in zip((wavebot, notes), cells, strict=True)
        for gain in _gains(text, cell)
    )
    if any(not gain.values for gain in gains):
        remarks.append((RemarkKind.RANGE_EMPTY, 0))
    matrix = _MATRIX.search(wavebot)
    activities = tuple(activity for activity, pattern in _ACTIVITIES if pattern.search(wavebot))
    gains_in_wavebot_cell = any(gain.cell == cells[0] for gain in gains)
    if gains_in_wavebot_cell and Activity.GAIN_MATRIX not in activities:
        activities = (*activities, Activity.GAINS)
    amplitudes, unknown = _amplitudes(wavebot)
    if unknown:
        remarks.append((RemarkKind.AMPLITUDE_UNKNOWN, 0))
    order = _amplitudes(" ".join(match[0] for match in _LIST.finditer(notes)))[0]
    stator = _STATOR.search(wavebot)
    bus = _BUS.search(wavebot)
    drive, drive_cell = _drive(wavebot, notes)
    return EntrySettings(
        activities,
        f"GainMatrix{matrix[1]}" if matrix else "",
        gains,
        _spring(wavebot, notes, cells, remarks),
        tuple(float(word) for word in stator[1].split(",")) if stator else (),
        drive,
        cells[drive_cell] if drive else "",
        _scheme(wavebot, notes, remarks),
        _surge(wavebot, notes, remarks),
        float(bus[1]) if bus else None,
        amplitudes,
        order if any(amplitude.waveform for amplitude in order) else (),
        remarks,
    )


def _spring(wavebot: str, notes: str, cells: tuple[str, str], remarks: Remarks) -> Spring | None:
    rates = _rates(wavebot, _SPRINGS)
    if len(rates) > 1:
        remarks.append((RemarkKind.SPRING_SEVERAL, 0))
        return None
    if rates:
        return Spring(rates[0], cells[0])
    if _SPRING_MENTIONED.search(wavebot):
        remarks.append((RemarkKind.SPRING_UNSPECIFIED, 0))
    noted = _rates(notes, _SPRING_NOTES)
    if len(noted) != 1:
        return None
    remarks.append((RemarkKind.SPRING_IN_NOTES, 1))
    return Spring(noted[0], cells[1])


def _rates(text: str, patterns: tuple[tuple[float, re.Pattern[str]], ...]) -> tuple[float, ...]:
    """Return all different spring rates in a text, N/m."""
    rates = [
        0.0 if match[1].lower() == "zero" else scale * float(match[1])
        for scale, pattern in patterns
        for match in pattern.finditer(text)
    ]
    return tuple(dict.fromkeys(rates))


def _gains(text: str, cell: str) -> list[Gain]:
    gains = []
    for match in _GAIN.finditer(text):
        axis, letter, gain, value_text = match.groups()
        surge = "surge" in (axis or "").lower() or letter == "s"
        values = _range(
            [float(word) for word in value_text.strip("[] ").split(":") if word.strip()]
        )
        gains.append(Gain("surge" if surge else "heave", f"k{gain}", values, cell))
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


def _drive(wavebot: str, notes: str) -> tuple[str, int]:
    for cell, text in enumerate((wavebot, notes)):
        if _COTS.search(text):
            return "COTS", cell
        if _CUSTOM.search(text):
            return "custom", cell
    return "", 0


def _scheme(wavebot: str, notes: str, remarks: Remarks) -> str:
    in_wavebot = [word.lower() for word in _SCHEME.findall(wavebot)]
    in_notes = [word.lower() for word in _SCHEME.findall(notes)]
    cell = 0 if in_wavebot else 1
    names = in_wavebot or in_notes
    if "svpm" in names:
        remarks.append((RemarkKind.SCHEME_MISSPELT, cell))
    schemes = list(dict.fromkeys(SCHEMES[word] for word in names))
    if schemes and cell:
        remarks.append((RemarkKind.SCHEME_IN_NOTES, 1))
    if len(schemes) > 1:
        remarks.append((RemarkKind.SCHEME_SEVERAL, cell))
        return ""
    if in_wavebot and {SCHEMES[word] for word in in_notes} - set(schemes):
        remarks.append((RemarkKind.SCHEME_SEVERAL, 1))
    return schemes[0] if schemes else ""


def _surge(wavebot: str, notes: str, remarks: Remarks) -> str:
    for cell, text in enumerate((wavebot, notes)):
        if match := _SURGE.search(text):
            state = match[1].lower()
            if state == "disables":
                remarks.append((RemarkKind.SURGE_MISSPELT, cell))
            return "disabled" if state.startswith("disable") else "enabled"
        if _SURGE_BY_HAND.search(text):
            return "by hand"
    return ""
