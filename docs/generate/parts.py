"""Generated parts of pages: a page has the mark `<!-- generated: NAME -->` in their place."""

import re
from collections.abc import Callable

from docs.generate.markdown import code, table
from drivers.canopen import bus_cycle, emcy, heartbeat, pdo
from drivers.cia402.process_data import ANALOG_INPUTS, BYTES, Entry

_MARK = re.compile(r"^<!-- generated: (?P<name>\w+) -->$", re.MULTILINE)


def fill(markdown: str) -> str:
    """Return a page with its generated parts; KeyError for a name that is not in `PARTS`."""
    return _MARK.sub(lambda match: PARTS[match["name"]](), markdown)


def can_frames() -> str:
    """Return the table of the frames on a CAN bus, in the order of a tick."""
    slow, actuator = "`slow_divider`", "`actuator_divider`"
    rows = [
        _pdo("torque drive", "command", pdo.rpdo_cob_id(1, 1), pdo.AXIS_COMMAND, "1"),
        _pdo("actuator", "target", pdo.rpdo_cob_id(2, 1), pdo.ACTUATOR_TARGET, actuator),
        _pdo("actuator", "command", pdo.rpdo_cob_id(1, 1), pdo.ACTUATOR_COMMAND, actuator),
        [f"{bus_cycle.SYNC:#05x}", "all", "SYNC", "", 0, "1"],
        _pdo("torque drive", "status", pdo.tpdo_cob_id(1, 1), pdo.AXIS_STATUS, "1"),
        _pdo("torque drive", "mode, error", pdo.tpdo_cob_id(2, 1), pdo.AXIS_SLOW_STATUS, slow),
        _pdo("torque drive", "analog inputs", pdo.tpdo_cob_id(3, 1), ANALOG_INPUTS, "1"),
        _pdo("actuator", "status", pdo.tpdo_cob_id(1, 1), pdo.ACTUATOR_STATUS, actuator),
        [f"{emcy.BASE:#05x} + node", "all", "emergency", "", 8, "at an error"],
        [f"{heartbeat.BASE:#05x} + node", "all, this computer", "heartbeat", "", 1, "by time"],
    ]
    heads = ["COB-ID", "device", "frame", "objects, in order", "bytes", "SYNCs"]
    return table(heads, rows)


def _pdo(
    device: str, name: str, cob_id: int, entries: tuple[Entry, ...], divider: str
) -> list[object]:
    objects = ", ".join(code(f"{each.object:04X}:{each.sub:02X} {each.type}") for each in entries)
    size = sum(BYTES[each.type] for each in entries)
    return [f"{cob_id - 1:#05x} + node", device, name, objects, size, divider]


PARTS: dict[str, Callable[[], str]] = {
    "can_frames": can_frames,
}
"""Functions that generate parts, by name."""
