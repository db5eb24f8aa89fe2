"""Parse the text of an entry: waves, settings of the rig, remarks on failures and sensor biases.

The height is the amplitude of regular waves and Hs of irregular ones. A name such as 4A is that of
the wave file, not a current.
"""

import re
from typing import Any, NamedTuple

from rig.interop.legacy.testlog.entry import (
    Activity,
    Amplitude,
    Bias,
    Cell,
    Gain,
    Remark,
    RemarkKind,
    Spring,
    Wave,
    WaveKind,
)

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


_PATTERNS = tuple(
    (kind, re.compile(pattern, re.IGNORECASE))
    for kind, pattern in (
        (RemarkKind.TIME_SYNC, r"\bPTP\b"),
        (
            RemarkKind.WAVE_MAKER,
            r"wave ?maker (?:failed|crashed|down)|waves? (?:stopped|ended|stop)\b"
            r"|Waves came from",
        ),
        (
            RemarkKind.SENSOR,
            r"enc(?:oder)? disconnected|not wired|no Fenner drive|encoder (?:removed|reading)"
            r"|signal (?:was lost|strange)",
        ),
        (RemarkKind.WAVE_UNCALIBRATED, r"uncalibrated wave"),
        (RemarkKind.SUPPLY, r"power supply (?:off|switched|toggled)"),
        (RemarkKind.TRIPPED, r"tripped|power supply failure|GUI crashed|E-stopped|fuse blew"),
        (RemarkKind.ROWS_DOUBTFUL, r"all rows after \d+|cases that got messed up|to be re-done"),
        (
            RemarkKind.INCOMPLETE,
            r"stopped early|incomplete|cut early|no good runs|nothing really useful"
            r"|last period short|stopped ASAP|restarting|stopped at \d+A",
        ),
        (RemarkKind.BY_HAND, r"\bmanual(?:ly)?\b|in[ -]hand|by[ -]hand"),
        (
            RemarkKind.BIAS,
            r"\bbias(?:es)?\b|position offset|offset in heave encoder|encoder zeroed",
        ),
    )
)
_SENTENCE = re.compile(r"(?<=[.;])\s+")

_BIAS_PATTERNS = tuple(
    (done, re.compile(pattern, re.IGNORECASE))
    for done, pattern in (
        ("attempted", r"correction attempted"),
        ("lost", r"bias corrections aren't good"),
        ("corrected", r"bias (?:corrected|adjusted)"),
        ("zeroed", r"encoder zeroed"),
        ("seen", r"offset in heave encoder was noted"),
    )
)
_RELATION_TO_RUN = re.compile(r"\b(before|after) this (?:run|test)", re.IGNORECASE)


def read_notes(cell: Cell) -> list[Remark]:
    """Return a remark for each kind of irregularity, with the sentences that mention it."""
    sentences = [sentence.strip() for sentence in _SENTENCE.split(cell.text.strip())]
    remarks = []
    for kind, pattern in _PATTERNS:
        if matching := [sentence for sentence in sentences if pattern.search(sentence)]:
            remarks.append(cell.remark(kind, " ".join(matching)))
    return remarks


def read_bias(cell: Cell) -> Bias | None:
    """Return the action on the zero of the heave position that a cell mentions; None if none."""
    for sentence in _SENTENCE.split(cell.text):
        for action, pattern in _BIAS_PATTERNS:
            if pattern.search(sentence):
                when = _RELATION_TO_RUN.search(sentence)
                return Bias(action, when[1].lower() if when else "", cell.name)
    return None


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


def read_settings(wavebot: Cell, notes: Cell, remarks: list[Remark]) -> dict[str, Any]:
    """Return the settings in the text of an entry, by the names of its fields.

    The irregularities of the text are added to ``remarks``.
    """
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
    return {
        "activities": tuple(activities),
        "matrix": f"GainMatrix{matrix[1]}" if matrix else "",
        "gains": gains,
        "spring": _spring(wavebot, notes, remarks),
        "stator_percent": tuple(float(part) for part in stator[1].split(",")) if stator else (),
        "drive": drive,
        "drive_source": drive_source,
        "scheme": _scheme(wavebot, notes, remarks),
        "surge": _surge(wavebot, notes, remarks),
        "bus_voltage_v": float(bus[1]) if bus else None,
        "amplitudes": amplitudes,
        "order": order if any(amplitude.waveform for amplitude in order) else (),
    }


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
