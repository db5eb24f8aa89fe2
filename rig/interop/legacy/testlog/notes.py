"""Find remarks in the free text of an entry: failures, manual actions, sensor biases."""

import re

from rig.interop.legacy.testlog.entry import Bias, Cell, Remark, RemarkKind

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
