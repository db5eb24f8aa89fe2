"""Recorded values of calibrated quantities in a test log: spring rates, and products from them."""

from datetime import date

from rig.interop.legacy.testlog.entry import Activity, Entry
from rig.interop.legacy.testlog.read import RunLog
from rig.recording.calibration import RecordingTime
from rig.recording.calibration_changes import RecordedValue

_PRODUCTS = {
    Activity.GAIN_MATRIX: ("row table", "power surfaces"),
    Activity.GAINS: ("row table",),
    Activity.BY_HAND: ("row table",),
    Activity.MULTISINE: ("identified impedance",),
}


def values_in_log(log: RunLog, quantity: str) -> tuple[RecordedValue, ...]:
    """Return every record of a quantity in a log, and every gain matrix that contains it."""
    if quantity != "spring_rate":
        return ()
    return tuple(value for entry in log.entries if (value := _of_entry(entry)) is not None)


def recording_time(entry: Entry) -> RecordingTime:
    """Return the time of an entry's run, by its number and the date in its file's name."""
    day = date.fromisoformat(entry.recorded[:10]) if entry.recorded else None
    return RecordingTime(entry.series_name, entry.run, day)


def _of_entry(entry: Entry) -> RecordedValue | None:
    products = [name for a in entry.activities for name in _PRODUCTS.get(a, ())]
    rests = tuple(dict.fromkeys(products))
    if entry.spring is not None:
        value = entry.spring.written_n_per_m
        return RecordedValue(entry.name, entry.spring.cell, recording_time(entry), value, "", rests)
    if not entry.matrix:
        return None
    note = f"spring rates stand in {entry.matrix}, not in the log"
    return RecordedValue(entry.name, f"row {entry.row}", recording_time(entry), None, note, rests)
