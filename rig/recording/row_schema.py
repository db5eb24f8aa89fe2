"""Description of the rows in an MCAP file: schema, channel, and check sums of both.

MCAP has check sums for chunks, attachments and the summary, but none for a schema, a channel or a
metadata record; a flipped bit in one of those would change a field, a unit or the start time.
"""

import zlib
from typing import NamedTuple

from mcap.records import Channel

from rig.recording import row_layout

TOPIC = "/row"
CLOCK_RECORD = "clock"  # metadata record with the mapping from run time to UTC
START_KEY = "start_utc_ns"
SCHEMA_RECORD = "form"  # metadata record with the check sum of the schema, which itself has none
CHECKSUM_KEY = "crc32"  # key in a metadata record: check sum of its other pairs
SCHEMA_ID = CHANNEL_ID = 1


class MessageSchema(NamedTuple):
    """Description of the rows in a file: message name and ros2msg schema."""

    name: str
    schema: str


def message_schema(row_type: type) -> MessageSchema:
    """Return the schema of a row type; raise RowError naming a field that cannot be stored."""
    return MessageSchema(row_layout.schema_name(row_type), row_layout.schema(row_type))


def schema_checksum(name: str, schema: str) -> str:
    """Return the check sum of a message schema."""
    return f"{zlib.crc32(repr((name, schema)).encode()):08x}"


def metadata_checksum(name: str, pairs: dict[str, str]) -> str:
    """Return the check sum of a metadata record."""
    return f"{zlib.crc32(repr((name, sorted(pairs.items()))).encode()):08x}"


def channel_record() -> Channel:
    """Return the record of the file's one channel."""
    return Channel(CHANNEL_ID, TOPIC, "cdr", {}, SCHEMA_ID)


def time_index(leaves: tuple[row_layout.Leaf, ...]) -> int:
    """Return the index of the time (s) among the numbers of a row; the tick has index 0."""
    fields = [(leaf.name, leaf.code) for leaf in leaves]
    if fields[0] != ("tick", "q"):
        raise row_layout.RowError(f"the first field of a row is its tick, not {fields[0][0]}")
    if ("time", "d") not in fields:
        raise row_layout.RowError("a row needs a field time in seconds")
    return fields.index(("time", "d"))
