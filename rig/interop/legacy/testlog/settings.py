"""How the rig was set for an entry, from words such as `GainMatrix006_2, magK=-6152`."""

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
_SPRING_WORDS = re.compile(
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

Remarks = list[tuple[RemarkKind, int]]  # kind, and which of the two cells: 0 WaveBot, 1 notes


class Settings(NamedTuple):
    """What the two cells of an entry say, and what is irregular in them."""

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


def read_settings(wavebot: str, notes: str, cells: tuple[str, str]) -> Settings:
    """The settings that an entry says; ``cells`` are the names of the two cells."""
    remarks: Remarks = []
    gains = tuple(
        gain
        for text, cell in zip((wavebot, notes), cells, strict=True)
        for gain in _gains(text, cell)
    )
    if any(not gain.values for gain in gains):
        remarks.append((RemarkKind.RANGE_EMPTY, 0))
    matrix = _MATRIX.search(wavebot)
    activities = tuple(activity for activity, words in _ACTIVITIES if words.search(wavebot))
    said_here = any(gain.cell == cells[0] for gain in gains)
    if said_here and Activity.GAIN_MATRIX not in activities:
        activities = (*activities, Activity.GAINS)
    amplitudes, unknown = _amplitudes(wavebot)
    if unknown:
        remarks.append((RemarkKind.AMPLITUDE_UNKNOWN, 0))
    order = _amplitudes(" ".join(match[0] for match in _LIST.finditer(notes)))[0]
    stator = _STATOR.search(wavebot)
    bus = _BUS.search(wavebot)
    drive, at = _drive(wavebot, notes)
    return Settings(
        activities,
        f"GainMatrix{matrix[1]}" if matrix else "",
        gains,
        _spring(wavebot, notes, cells, remarks),
        tuple(float(word) for word in stator[1].split(",")) if stator else (),
        drive,
        cells[at] if drive else "",
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
    if _SPRING_WORDS.search(wavebot):
        remarks.append((RemarkKind.SPRING_UNSAID, 0))
    noted = _rates(notes, _SPRING_NOTES)
    if len(noted) != 1:
        return None
    remarks.append((RemarkKind.SPRING_IN_NOTES, 1))
    return Spring(noted[0], cells[1])


def _rates(text: str, ways: tuple[tuple[float, re.Pattern[str]], ...]) -> tuple[float, ...]:
    """All different spring rates of a text, N/m."""
    found = [
        0.0 if match[1].lower() == "zero" else scale * float(match[1])
        for scale, pattern in ways
        for match in pattern.finditer(text)
    ]
    return tuple(dict.fromkeys(found))


def _gains(text: str, cell: str) -> list[Gain]:
    found = []
    for match in _GAIN.finditer(text):
        axis, letter, gain, words = match.groups()
        surge = "surge" in (axis or "").lower() or letter == "s"
        values = _range([float(word) for word in words.strip("[] ").split(":") if word.strip()])
        found.append(Gain("surge" if surge else "heave", f"k{gain}", values, cell))
    return found


def _range(numbers: list[float]) -> tuple[float, ...]:
    """A number, or start:step:stop as MATLAB counts: nothing where the step leads away."""
    if len(numbers) == 2:
        numbers = [numbers[0], 1.0, numbers[1]]
    if len(numbers) != 3:
        return tuple(numbers)
    first, step, last = numbers
    count = int((last - first) / step + 1e-9) if step != 0.0 and (last - first) * step >= 0 else -1
    return tuple(first + i * step for i in range(count + 1))


def _amplitudes(text: str) -> tuple[tuple[Amplitude, ...], bool]:
    """Current amplitudes of a text, and whether one of them is `??`.

    [10A,20A] are amperes; in [10A,10B] the letters are phase realisations.
    """
    found: list[Amplitude] = []
    unknown = False
    for match in _LIST.finditer(text):
        items = [_ITEM.fullmatch(item) for item in re.split("[;,]", match[1])]
        kept = [item for item in items if item is not None]
        letters = {item[2] for item in kept if item[2]}
        if len(kept) != len(items) or not (letters or match[2]):
            continue
        waveforms = letters - {"A"} != set()
        unknown |= any(item[1].startswith("?") for item in kept)
        found += [
            Amplitude(float(item[1]), (item[2] or "") if waveforms else "")
            for item in kept
            if not item[1].startswith("?")
        ]
    outside = _LIST.sub(" ", text)
    found += [Amplitude(float(match[1])) for match in _INLINE.finditer(outside)]
    return tuple(found), unknown


def _drive(wavebot: str, notes: str) -> tuple[str, int]:
    for at, text in enumerate((wavebot, notes)):
        if _COTS.search(text):
            return "COTS", at
        if _CUSTOM.search(text):
            return "custom", at
    return "", 0


def _scheme(wavebot: str, notes: str, remarks: Remarks) -> str:
    here = [word.lower() for word in _SCHEME.findall(wavebot)]
    noted = [word.lower() for word in _SCHEME.findall(notes)]
    at = 0 if here else 1
    words = here or noted
    if "svpm" in words:
        remarks.append((RemarkKind.SCHEME_MISSPELT, at))
    schemes = list(dict.fromkeys(SCHEMES[word] for word in words))
    if schemes and at:
        remarks.append((RemarkKind.SCHEME_IN_NOTES, 1))
    if len(schemes) > 1:
        remarks.append((RemarkKind.SCHEME_SEVERAL, at))
        return ""
    if here and {SCHEMES[word] for word in noted} - set(schemes):
        remarks.append((RemarkKind.SCHEME_SEVERAL, 1))
    return schemes[0] if schemes else ""


def _surge(wavebot: str, notes: str, remarks: Remarks) -> str:
    for at, text in enumerate((wavebot, notes)):
        if found := _SURGE.search(text):
            word = found[1].lower()
            if word == "disables":
                remarks.append((RemarkKind.SURGE_MISSPELT, at))
            return "disabled" if word.startswith("disable") else "enabled"
        if _SURGE_BY_HAND.search(text):
            return "by hand"
    return ""
