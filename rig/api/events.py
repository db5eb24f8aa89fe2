"""Events of a run in the order of time: states, rows, stops, requests of people."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.api.log import LogFields
from rig.presentation.value_labels import REASON
from rig.realtime.sequence import NO_ROW
from rig.recording.journal import Entry, read_journal
from rig.recording.runs import RunInfo, reader

if TYPE_CHECKING:
    import pandas

_MODE, _ROW, _TICK = "safety.mode", "plan.row", "tick"
_COLUMNS = ("time", "event", "text")


def journal_entries(info: RunInfo) -> list[Entry]:
    """Return the requests of people in the order of time, also those before a run was resumed."""
    return list(read_journal(info.earlier_journals + b"\n" + info.journal))


def journal_frame(info: RunInfo) -> "pandas.DataFrame":
    """Return the requests of people and the answers to them; no line of a run without any."""
    import pandas

    names = [name for name in Entry._fields if name not in ("number", "numbers")]
    lines = [{name: getattr(each, name) for name in names} for each in journal_entries(info)]
    return pandas.DataFrame(lines, columns=names)


def event_frame(path: Path, info: RunInfo, fields: LogFields) -> "pandas.DataFrame":
    """Return the events of a run: changes of state and row, the stop, requests, resumptions."""
    import pandas

    names = [name for name in ("time", _TICK, _MODE, REASON, _ROW) if name in fields.leaves]
    log = reader.columns(reader.open_files(path), names)
    events: list[tuple[float, str, str]] = []
    for name, event in ((_MODE, "state"), (REASON, "stop"), (_ROW, "row")):
        if name not in log or not len(log[name]):
            continue
        values = log[name]
        places = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1))
        for place in places.tolist():
            text = _text(name, int(values[place]), fields, info)
            if text:
                events.append((float(log["time"][place]), event, text))
    events += _requests(info, log)
    events.sort(key=lambda each: each[0])
    frame = pandas.DataFrame(events, columns=list(_COLUMNS))
    frame.attrs["units"] = {"time": "s"}
    return frame


def _text(name: str, value: int, fields: LogFields, info: RunInfo) -> str:
    if name == _ROW:
        return "" if value == NO_ROW else f"row {value} begins"
    if name == REASON:
        reason = info.reasons.name(value)
        return "" if value == 0 else f"{reason}: {info.reasons.text(reason)}"
    labels = fields.value_labels(name)
    return str(value) if labels is None else labels.text(value)


def _requests(info: RunInfo, log: dict[str, Any]) -> list[tuple[float, str, str]]:
    found = []
    for entry in journal_entries(info):
        place = min(int(np.searchsorted(log[_TICK], entry.tick)), len(log[_TICK]) - 1)
        time = float(log["time"][place]) if place >= 0 and entry.tick >= 0 else 0.0
        given = f" {json.dumps(entry.arguments)}" if entry.arguments else ""
        answer = "" if entry.accepted else f", refused: {entry.reason}"
        found.append((time, "request", f"{entry.request}{given} by {entry.person}{answer}"))
    return found
