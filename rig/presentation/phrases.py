"""Names and phrases shared by pictures and reports."""

import math
from datetime import UTC, datetime

from rig.realtime.reasons import Reason
from rig.recording.runs.folder import earlier_reasons

_MODE_STAMPS = {
    "batch": "BATCH: simulated plant, no clock",
    "rehearsal": "REHEARSAL: simulated plant",
    "hil": "HIL: emulated devices on real wires",
    "hardware": "HARDWARE",
    "imported": "IMPORTED: recorded by another system",
}


def mode_stamp(mode: str) -> str:
    """Return the stamp of an execution mode, which names the kind of plant."""
    return _MODE_STAMPS.get(mode, mode.upper() if mode else "MODE NOT RECORDED")


def reason_text(reason: str) -> str:
    """Return the text of a stop reason by its name, for a run that did not record it."""
    return earlier_reasons().text(reason or Reason.NONE.name)


def format_signed(value: float, digits: int = 0) -> str:
    """Return a number with its sign and a typographic minus; zero has no sign."""
    text = f"{value:+.{digits}f}"
    if float(text) == 0.0:
        return text[1:]
    return text.replace("-", "\N{MINUS SIGN}")


def format_power(value: float, error: float = float("nan")) -> str:
    """Return a power (W) with its standard error if known, both with the same decimals."""
    if not math.isfinite(error):
        return f"{format_signed(value, 1 if abs(value) < 100.0 else 0)} W"
    digits = 0 if error >= 9.5 else 1 if error >= 0.095 else 2
    size = f"{error:.{digits}f}" if error >= 0.005 else "<0.01"
    return f"{format_signed(value, digits)} ± {size} W"  # plus: consumed


def format_utc(text: str) -> str:
    """Return an ISO 8601 time as readable UTC to the second; other text unchanged."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return text
    return f"{moment.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC"
