"""Remarks that stand in the free words of an entry: what failed, what was done by hand."""

import re

from rig.interop.legacy.testlog.entry import Bias, RemarkKind

_WORDS = tuple(
    (kind, re.compile(words, re.IGNORECASE))
    for kind, words in (
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

_DONE = tuple(
    (done, re.compile(words, re.IGNORECASE))
    for done, words in (
        ("attempted", r"correction attempted"),
        ("lost", r"bias corrections aren't good"),
        ("corrected", r"bias (?:corrected|adjusted)"),
        ("zeroed", r"encoder zeroed"),
        ("seen", r"offset in heave encoder was noted"),
    )
)
_WHEN = re.compile(r"\b(before|after) this (?:run|test)", re.IGNORECASE)


def read_notes(text: str) -> tuple[tuple[RemarkKind, str], ...]:
    """Kinds of irregularity in a text, each with the sentences that tell it."""
    sentences = _SENTENCE.split(text.strip())
    found = []
    for kind, words in _WORDS:
        told = [sentence.strip() for sentence in sentences if words.search(sentence)]
        if told:
            found.append((kind, " ".join(told)))
    return tuple(found)


def read_bias(text: str, cell: str) -> Bias | None:
    """What a text says of the zero of the heave position; None if nothing."""
    for sentence in _SENTENCE.split(text):
        for done, words in _DONE:
            if words.search(sentence):
                when = _WHEN.search(sentence)
                return Bias(done, when[1].lower() if when else "", cell)
    return None
