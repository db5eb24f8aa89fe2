"""Generated parts of pages: a page has the mark `<!-- generated: NAME -->` in their place."""

import ast
import inspect
import re
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from docs.generate.markdown import code, sentence, table
from drivers.canopen import bus_cycle, emcy, heartbeat, pdo
from drivers.cia402 import drive_objects as drive_objects_module
from drivers.cia402.drive_objects import REQUIRED, Access
from drivers.cia402.process_data import ANALOG_INPUTS, BYTES, Entry
from rig.kinds import registry
from rig.kinds.interface import PROTOCOLS

_MARK = re.compile(r"^<!-- generated: (?P<name>\w+) -->$", re.MULTILINE)

_OBJECT_NOTE = re.compile(r'"(\w{4,})",.*\),  # (.*)$', re.MULTILINE)


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


def drive_objects() -> str:
    """Return the table of the keys in `objects` of a drive; values are the comments of the code."""
    notes = dict(_OBJECT_NOTE.findall(inspect.getsource(drive_objects_module)))
    actions = {Access.SET: "writes", Access.VERIFY: "compares", Access.TRANSIENT: "writes"}
    rows = (
        [
            code(each.name), f"{each.object:04X}:{each.sub:02X} {each.type}",
            actions[Access(each.access)], "yes" if each.name in REQUIRED else "",
            notes.get(each.name, ""),
        ]
        for each in drive_objects_module.OBJECTS
    )  # fmt: skip
    return table(["key", "object", "a run", "needed", "value"], rows)


def rooms() -> str:
    """Return the table of the modules that every kind of rig has."""
    rows = (
        [code(room), _room_text(PROTOCOLS[room]), ", ".join(map(code, names))]
        for room, names in registry.ROOMS.items()
    )
    return table(["module", "content", "names"], rows)


def _room_text(protocol: type) -> str:
    return sentence(_first(inspect.getdoc(protocol)).partition(": ")[2])


def packages() -> str:
    """Return the table of the top-level packages."""
    return table(["package", "content"], map(_package_row, ("rig", *_OTHER_PACKAGES)))


def layers() -> str:
    """Return the table of the layers of `rig`, the highest first, from the import contract."""
    found = _contracts()
    order = next(each["layers"] for each in found if each["type"] == "layers")
    rows = (
        [number, *_package_row(f"rig/{name.strip()}")]
        for number, layer in enumerate(order, start=1)
        for name in layer.split("|")
    )
    return table(["layer", "package", "content"], rows)


def contracts() -> str:
    """Return the list of the other import contracts."""
    others = (each["name"] for each in _contracts() if each["type"] != "layers")
    return "".join(f"- {sentence(name)}\n" for name in others)


def kind_modules() -> str:
    """Return a table for each kind of rig with the parts of its package."""
    return "\n".join(
        f"### Kind `{name}`\n\n" + table(["part", "content"], _parts_of(package.replace(".", "/")))
        for name, package in registry.OWN_PACKAGES.items()
    )


def _parts_of(folder: str) -> Iterator[list[str]]:
    for path in sorted((_ROOT / folder).iterdir()):
        is_package = (path / "__init__.py").exists()
        if is_package or (path.suffix == ".py" and path.stem != "__init__"):
            yield _package_row(f"{folder}/{path.stem}")


def _package_row(name: str) -> list[str]:
    """Return path and first sentence of a package or module by its path without ending."""
    path = _ROOT / name / "__init__.py"
    is_package = path.exists()
    source = (path if is_package else _ROOT / f"{name}.py").read_text()
    shown = f"{name}/" if is_package else f"{name}.py"
    return [code(shown), sentence(_first(ast.get_docstring(ast.parse(source))))]


def _first(text: str | None) -> str:
    return " ".join((text or "").partition("\n\n")[0].split())


def _contracts() -> list[dict[str, Any]]:
    text = (_ROOT / "pyproject.toml").read_text()
    found: list[dict[str, Any]] = tomllib.loads(text)["tool"]["importlinter"]["contracts"]
    return found


_ROOT = Path(__file__).resolve().parents[2]
_OTHER_PACKAGES = ("controllers", "drivers", "sim_plant")

PARTS: dict[str, Callable[[], str]] = {
    "can_frames": can_frames,
    "contracts": contracts,
    "drive_objects": drive_objects,
    "kind_modules": kind_modules,
    "layers": layers,
    "packages": packages,
    "rooms": rooms,
}
"""Functions that generate parts, by name."""
