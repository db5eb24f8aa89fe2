"""Names and phrases shared by pictures and reports."""

import math
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime

from rig.realtime.reasons import Reason
from rig.realtime.safety import Mode
from rig.realtime.sequence import Phase
from rig.recording.runs.folder import earlier_reasons

_MODE_STAMPS = {
    "batch": "BATCH: simulated plant, no clock",
    "rehearsal": "REHEARSAL: simulated plant",
    "hil": "HIL: emulated devices on real wires",
    "hardware": "HARDWARE",
    "imported": "IMPORTED: recorded by another system",
}

_STATES = {
    Mode.OFF: "OFF",
    Mode.ENABLING: "ENABLING",
    Mode.RUN: "RUNNING",
    Mode.STOP_2: "HOLD",
    Mode.STOP_1: "STOPPING",
    Mode.STOP_0: "OFF",
}


def mode_stamp(mode: str) -> str:
    """Return the stamp of an execution mode, which names the kind of plant."""
    return _MODE_STAMPS.get(mode, mode.upper() if mode else "MODE NOT RECORDED")


def reason_text(reason: str) -> str:
    """Return the text of a stop reason by its name, for a run that did not record it."""
    return earlier_reasons().text(reason or Reason.NONE.name)


def state_text(mode: int) -> str:
    """Return the state of a run by the mode of its safety machine."""
    return _STATES[Mode(mode)]


def phase_text(phase: int) -> str:
    """Return the name of a phase of the plan."""
    return Phase(phase).name.lower().replace("_", "-")


def count_text(count: int, thing: str) -> str:
    """Return a count of things, in the plural unless it is 1."""
    return f"{count} {thing}{'s' if count != 1 else ''}"


def unit_text(unit: str) -> str:
    """Return a unit as text for people; empty for a dimensionless quantity."""
    return "" if unit == "1" else unit.replace("*", "·")


def aligned(
    rows: Sequence[Sequence[str]], to_right: Callable[[int, str], bool] = lambda column, cell: True
) -> list[str]:
    """Return rows of cells as lines with columns of equal width, the first indented by two.

    ``to_right`` returns whether a cell, given with its column (from 0), is aligned to the right.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = (
            cell.rjust(width) if to_right(at, cell) else cell.ljust(width)
            for at, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        lines.append(f"  {'  '.join(cells)}".rstrip())
    return lines


_SMALL_POWER, _LEAST_POWER = 0.1, 1.0e-6  # W
_COARSE_ERROR = 0.005  # W; a smaller one is 0.00 with two decimals


def format_signed(value: float, digits: int = 0) -> str:
    """Return a number with its sign and a typographic minus; zero has no sign."""
    text = f"{value:+.{digits}f}"
    if float(text) == 0.0:
        return text[1:]
    return text.replace("-", "\N{MINUS SIGN}")


def format_power(value: float, error: float = float("nan")) -> str:
    """Return a power (W) with its standard error if known, both with the same decimals.

    Of a power below 0.1 W three digits are shown, unless the error hides them.
    """
    if not error >= _COARSE_ERROR and _LEAST_POWER <= abs(value) < _SMALL_POWER:
        digits = 2 - math.floor(math.log10(abs(value)))
    elif math.isfinite(error):
        digits = 0 if error >= 9.5 else 1 if error >= 0.095 else 2
    else:
        digits = 1 if abs(value) < 100.0 else 0
    if not math.isfinite(error):
        return f"{format_signed(value, digits)} W"
    last = 10.0**-digits
    size = f"{error:.{digits}f}" if error >= 0.5 * last else f"<{last:.{digits}f}"
    return f"{format_signed(value, digits)} ± {size} W"  # plus: consumed


def format_utc(text: str) -> str:
    """Return an ISO 8601 time as readable UTC to the second; other text unchanged."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return text
    return f"{moment.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC"


def clock_text(seconds: float) -> str:
    """Return seconds as h:mm:ss or m:ss."""
    rounded = max(0, round(seconds))
    hours, rest = divmod(rounded, 3600)
    minutes, remaining = divmod(rest, 60)
    return f"{hours}:{minutes:02d}:{remaining:02d}" if hours else f"{minutes}:{remaining:02d}"


def plan_end_text(row: Mapping[str, float], rows: int) -> str:
    """Return how a plan of ``rows`` rows ended, by the last log row."""
    completed = int(row["safety.reason"]) in (Reason.NONE, Reason.PLAN_END)
    return f"all {rows} done" if completed else f"stopped before all {rows} were done"


def format_duration(seconds: float) -> str:
    """Return a duration as text in hours, minutes and seconds."""
    minutes, rest = divmod(seconds, 60.0)
    if minutes < 60.0:
        return f"{minutes:.0f} min {rest:.3g} s" if minutes else f"{rest:.3g} s"
    hours, minutes = divmod(minutes, 60.0)
    return f"{hours:.0f} h {minutes:.0f} min {rest:.3g} s"
