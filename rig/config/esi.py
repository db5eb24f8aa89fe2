"""ESI files (EtherCAT slave information, ETG.2000): a slave's description by its maker, as XML.

A rig file names one as `device: FILE.xml#TYPE`; TYPE is the type in the file, such as EL3104. Of
several revisions the newest counts, unless `@REVISION` follows. The process data are those that the
file assigns by default; names join those of PDO and entry. CoE objects that the file sets on the
way to SAFEOP are written before a run.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from rig.regular_file import read_regular

MAX_ESI_BYTES = 64 * 1024 * 1024
_TYPES = {
    "BOOL": "bit", "BIT": "bit",
    "SINT": "i8", "USINT": "u8", "BYTE": "u8", "BITARR8": "u8",
    "INT": "i16", "UINT": "u16", "WORD": "u16", "BITARR16": "u16",
    "DINT": "i32", "UDINT": "u32", "DWORD": "u32", "BITARR32": "u32",
    "LINT": "i64", "ULINT": "u64", "REAL": "f32", "LREAL": "f64",
}  # fmt: skip
_BITS = {"bit": 1} | {f"{sign}{bits}": bits for sign in "iuf" for bits in (8, 16, 32, 64)}
_ARRAY = re.compile(r"ARRAY\s*\[(\d+)\.\.(\d+)\]\s*OF\s*(\w+)")
_SET_TYPES = {1: "u8", 2: "u16", 4: "u32"}  # of an object, by its bytes
_MAX_GAP = 256  # bits of one gap


class EsiError(ValueError):
    """A file that is no ESI file, or has no such slave; the message says which it has."""


class _Entry(NamedTuple):
    name: str
    object: int
    sub: int
    kind: str  # a type of `rig.config.segment`, empty for a gap
    number: int  # values of that type, or bits of the gap


def read_esi(path: Path, chosen: str) -> dict[str, Any]:
    """Return a slave of an ESI file as the mapping of a device file.

    ``chosen``: TYPE or TYPE@REVISION; empty if the file has one type. EsiError or OSError.
    """
    try:
        root = ElementTree.fromstring(read_regular(path, MAX_ESI_BYTES))
    except ElementTree.ParseError as error:
        raise EsiError(f"no XML: {error}") from None
    if root.tag != "EtherCATInfo":
        raise EsiError(f"no ESI file: it begins with {root.tag}, not EtherCATInfo")
    name, _, revision = chosen.partition("@")
    found = [device for device in root.iter("Device") if name in ("", _type(device).text)]
    if revision:
        number = _parse(revision.replace("0x", "#x"))
        found = [each for each in found if _number(_type(each), "RevisionNo") == number]
    types = sorted({str(_type(device).text) for device in root.iter("Device")})
    if not found or (not name and len(types) > 1):
        fault = f"no type {chosen}" if chosen else "several types"
        raise EsiError(f"{fault}; the file has {', '.join(types) or 'none'}: FILE.xml#TYPE")
    device = max(found, key=lambda each: _number(_type(each), "RevisionNo"))
    return _mapping(root, device)


def _mapping(root: ElementTree.Element, device: ElementTree.Element) -> dict[str, Any]:
    kind = _type(device)
    vendor = root.find("Vendor/Id")
    if vendor is None:
        raise EsiError("no vendor")
    mailbox = device.find("Mailbox/CoE")
    outputs, inputs = list(_pdos(device, "RxPdo")), list(_pdos(device, "TxPdo"))
    return {
        "title": (device.findtext("Name") or kind.text or "slave").strip(),
        "type": "terminal" if outputs or inputs else "coupler",
        "vendor": _parse(vendor.text or ""),
        "product": _number(kind, "ProductCode"),
        "mailbox": mailbox is not None,
        "outputs": outputs,
        "inputs": inputs,
        "objects": [] if mailbox is None else list(_objects(mailbox)),
    }


def _pdos(device: ElementTree.Element, tag: str) -> Iterator[dict[str, Any]]:
    """Yield the PDOs of a direction that a sync manager has by default."""
    taken: set[str] = set()
    for pdo in device.findall(tag):
        if pdo.get("Sm") is None:
            continue  # it could be chosen, but is not
        title = pdo.findtext("Name") or ""
        values = []
        for entry in _joined([_entry(each) for each in pdo.findall("Entry")]):
            if not entry.kind:
                values += [
                    {"type": "bit", "count": min(_MAX_GAP, entry.number - done)}
                    for done in range(0, entry.number, _MAX_GAP)
                ]
                continue
            name = _unique(_identifier(f"{title} {entry.name}"), taken)
            values.append(
                {
                    "name": name,
                    "object": entry.object,
                    "sub": entry.sub,
                    "type": entry.kind,
                    "count": entry.number,
                }
            )
        if values:
            yield {"pdo": _parse(pdo.findtext("Index") or "0"), "values": values}


def _entry(entry: ElementTree.Element) -> _Entry:
    index, sub = _parse(entry.findtext("Index") or "0"), _parse(entry.findtext("SubIndex") or "0")
    bits, kind = _parse(entry.findtext("BitLen") or "0"), (entry.findtext("DataType") or "").strip()
    number = 1
    if array := _ARRAY.match(kind):
        number, kind = 1 + int(array[2]) - int(array[1]), array[3]
    known = _TYPES.get(kind, "")
    if index == 0 or not known or _BITS[known] * number != bits:
        return _Entry("", 0, 0, "", bits)
    return _Entry((entry.findtext("Name") or "").strip(), index, sub, known, number)


def _joined(entries: list[_Entry]) -> list[_Entry]:
    """Return entries with samples of one object joined: one type, sub-indices that follow."""
    joined: list[_Entry] = []
    for entry in entries:
        last = joined[-1] if joined else None
        follows = (
            last is not None
            and entry.kind not in ("", "bit")
            and (last.kind, last.object) == (entry.kind, entry.object)
            and last.sub + last.number == entry.sub
            and _stem(last.name) == _stem(entry.name)
        )
        if follows and last is not None:
            joined[-1] = last._replace(name=_stem(last.name), number=last.number + entry.number)
        else:
            joined.append(entry)
    return joined


def _stem(name: str) -> str:
    return re.sub(r"[\s_\[\(]*\d+[\]\)]?$", "", name).strip()


def _objects(mailbox: ElementTree.Element) -> Iterator[dict[str, Any]]:
    """Yield the objects that are set from PREOP to SAFEOP, but for the choice of PDOs."""
    for command in mailbox.findall("InitCmd"):
        index = _parse(command.findtext("Index") or "0")
        data = bytes.fromhex(command.findtext("Data") or "")
        transitions = {each.text for each in command.findall("Transition")}
        if "PS" not in transitions or 0x1C00 <= index <= 0x1C3F or len(data) not in _SET_TYPES:
            continue
        yield {
            "object": index,
            "sub": _parse(command.findtext("SubIndex") or "0"),
            "type": _SET_TYPES[len(data)],
            "value": int.from_bytes(data, "little"),
        }


def _type(device: ElementTree.Element) -> ElementTree.Element:
    found = device.find("Type")
    if found is None:
        raise EsiError("a device has no type")
    return found


def _number(element: ElementTree.Element, attribute: str) -> int:
    return _parse(element.get(attribute, "0"))


def _parse(text: str) -> int:
    """Return a number of an ESI file: decimal, or hexadecimal after #x."""
    try:
        text = text.strip()
        return int(text[2:], 16) if text.lower().startswith("#x") else int(text)
    except ValueError:
        raise EsiError(f"{text!r} is no number") from None


def _identifier(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_") or "value"


def _unique(name: str, taken: set[str]) -> str:
    found, number = name, 2
    while found in taken:
        found, number = f"{name}_{number}", number + 1
    taken.add(found)
    return found
