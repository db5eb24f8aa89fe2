"""What a file says of its rows beside the rows: schema, channel, and the check sums of both.

MCAP gives a check sum to chunks, attachments and the summary, but none to a schema, a channel or a
metadata record; a flipped bit in one of those would read as another field, unit or start time.
"""

import zlib
from typing import NamedTuple

from mcap.records import Channel

from rig.recording import row_layout

TOPIC = "/row"
CLOCK = "clock"  # metadata record with the mapping from run time to UTC
START_KEY = "start_utc_ns"
FORM = "form"  # metadata record with the check sum of the schema, which itself has none
CHECK = "crc32"  # of a metadata record's other pairs, in it
SCHEMA_ID = CHANNEL_ID = 1


class Form(NamedTuple):
    """What a file says about its rows: message name and ros2msg schema."""

    name: str
    schema: str


def form(row_type: type) -> Form:
    """The form of a row type; raises RowError naming a field that cannot be stored."""
    return Form(row_layout.schema_name(row_type), row_layout.schema(row_type))


def form_sum(name: str, schema: str) -> str:
    """Check sum of a form."""
    return f"{zlib.crc32(repr((name, schema)).encode()):08x}"


def pairs_sum(name: str, pairs: dict[str, str]) -> str:
    """Check sum of a metadata record."""
    return f"{zlib.crc32(repr((name, sorted(pairs.items()))).encode()):08x}"


def channel_record() -> Channel:
    """What a file says of its one channel."""
    return Channel(CHANNEL_ID, TOPIC, "cdr", {}, SCHEMA_ID)


def time_place(leaves: tuple[row_layout.Leaf, ...]) -> int:
    """Which number of a row is its time in seconds; the first is its tick."""
    fields = [(leaf.name, leaf.code) for leaf in leaves]
    if fields[0] != ("tick", "q"):
        raise row_layout.RowError(f"the first field of a row is its tick, not {fields[0][0]}")
    if ("time", "d") not in fields:
        raise row_layout.RowError("a row needs a field time in seconds")
    return fields.index(("time", "d"))
