"""ESI files (EtherCAT slave information, ETG.2000): a slave's description by its maker, as XML.

A rig file names one as `device: FILE.xml#TYPE`; TYPE is the type in the file, such as EL3104. Of
several revisions the newest counts, unless `@REVISION` follows. The process data are those that the
file assigns by default; names join those of PDO and entry. CoE objects that the file sets on the
way to SAFEOP are written before a run. A device of profile 402 is a drive, whose process data the
drivers choose. One whose every mode of operation has SYNC0 works with SYNC0 only.

An entry is one value, and so is each element of an array. Samples of one signal are the exception:
numbers of one object at sub-indices that follow become one value, whose mean is read, if they are
inputs and the file calls each of them a sample (`Sample 1`, `Ch1 Sample 0`), or the whole array
`Samples`. That they share an object proves nothing: channels of a terminal do so, too.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from rig.regular_file import read_regular

MAX_ESI_BYTES = 64 * 1024 * 1024
_TYPES = {
    "BOOL": "bit", "BIT": "bit", "BIT1": "bit", "BOOLEAN": "bit",
    "SINT": "i8", "USINT": "u8", "BYTE": "u8", "BITARR8": "u8", "BIT8": "u8",
    "INT": "i16", "UINT": "u16", "WORD": "u16", "BITARR16": "u16",
    "DINT": "i32", "UDINT": "u32", "DWORD": "u32", "BITARR32": "u32",
    "LINT": "i64", "ULINT": "u64", "LWORD": "u64", "REAL": "f32", "LREAL": "f64",
    # not of ETG.2000, but of tools that write such files
    "INT8": "i8", "UINT8": "u8", "INT16": "i16", "UINT16": "u16",
    "INT32": "i32", "UINT32": "u32", "INT64": "i64", "UINT64": "u64",
}  # fmt: skip
_BITS = {"bit": 1} | {f"{sign}{bits}": bits for sign in "iuf" for bits in (8, 16, 32, 64)}
_ENCODING = re.compile(rb"<\?xml[^>]*?\sencoding\s*=\s*[\"']([\w.:-]+)")
_SAMPLES = re.compile(r"(ch(annel)?\W*\d+\W+)?samples?", re.IGNORECASE)
_ARRAY = re.compile(r"ARRAY\s*\[(\d+)\.\.(\d+)\]\s*OF\s*(\w+)")
_SET_TYPES = {1: "u8", 2: "u16", 4: "u32"}  # of an object, by its bytes
_MAX_GAP = 256  # bits of one gap
_MAX_BITS = 8 * 1486  # of an entry: a frame has no more
_LAST_SUB = 0xFF
_ENGLISH = "1033"  # LcId of a text
_DRIVE_PROFILE = 402
_CYCLIC_SYNC0 = 0x0300  # of AssignActivate, whose high byte is register 0x0981


class EsiError(ValueError):
    """A file that is no ESI file, or has no such slave; the message says which it has."""


class _Entry(NamedTuple):
    name: str
    object: int
    sub: int
    kind: str  # a type of `rig.config.segment`, empty for a gap
    number: int  # values of that type, or bits of the gap
    first: int = 0  # subscript of the first element of an array


def read_esi(path: Path, chosen: str) -> dict[str, Any]:
    """Return a slave of an ESI file as the mapping of a device file.

    ``chosen``: TYPE or TYPE@REVISION; empty if the file has one type. EsiError or OSError.
    """
    root = _root(read_regular(path, MAX_ESI_BYTES))
    if root.tag != "EtherCATInfo":
        raise EsiError(f"no ESI file: it begins with {root.tag}, not EtherCATInfo")
    name, _, revision = chosen.partition("@")
    found = [device for device in root.iter("Device") if name in ("", _type_name(device))]
    if revision:
        number = _parse(revision.replace("0x", "#x"))
        found = [each for each in found if _number(_type(each), "RevisionNo") == number]
    types = sorted({_type_name(device) for device in root.iter("Device")})
    if not found or (not name and len(types) > 1):
        fault = f"no type {chosen}" if chosen else "several types"
        raise EsiError(f"{fault}; the file has {', '.join(types) or 'none'}: FILE.xml#TYPE")
    device = max(found, key=lambda each: _number(_type(each), "RevisionNo"))
    return _mapping(root, device)


def _root(data: bytes) -> ElementTree.Element:
    """Return the root of an XML file, which Python decodes: expat knows few encodings."""
    declared = _ENCODING.match(data)
    encoding = declared[1].decode() if declared else ""
    try:
        return ElementTree.fromstring(data.decode(encoding) if encoding else data)
    except ElementTree.ParseError as error:
        raise EsiError(f"no XML: {error}") from None
    except (LookupError, ValueError) as error:
        raise EsiError(f"encoding {encoding}: {error}") from None


def _mapping(root: ElementTree.Element, device: ElementTree.Element) -> dict[str, Any]:
    kind = _type(device)
    vendor = root.find("Vendor/Id")
    if vendor is None:
        raise EsiError("no vendor")
    mailbox = device.find("Mailbox/CoE")
    is_drive = any(
        _parse(each.text or "0") == _DRIVE_PROFILE for each in device.iterfind("Profile//ProfileNo")
    )
    pdos = {} if is_drive else {tag: list(_pdos(device, tag)) for tag in ("RxPdo", "TxPdo")}
    outputs, inputs = pdos.get("RxPdo", []), pdos.get("TxPdo", [])
    needs_sync0, sync0_cycles = _sync0(device)
    return {
        "title": _title(device),
        "type": "drive" if is_drive else "terminal" if outputs or inputs else "coupler",
        "vendor": _parse(vendor.text or ""),
        "product": _number(kind, "ProductCode"),
        "mailbox": mailbox is not None,
        "sync0": needs_sync0,
        "sync0_cycles_ns": sync0_cycles,
        "outputs": outputs,
        "inputs": inputs,
        "objects": [] if mailbox is None else list(_objects(mailbox)),
    }


def _pdos(device: ElementTree.Element, tag: str) -> Iterator[dict[str, Any]]:
    """Yield the PDOs of a direction that a sync manager has by default."""
    taken: set[str] = set()
    bases = {
        (each.findtext("Name") or "").strip(): (each.findtext("BaseType") or "").strip()
        for each in device.iterfind("Profile//DataType")
    }
    for pdo in device.findall(tag):
        is_assigned = pdo.get("Sm") is not None or _flag(pdo, "Mandatory")
        if not is_assigned or _flag(pdo, "Virtual"):
            continue  # it could be chosen, but is not; or only a tool of the maker has it
        title = pdo.findtext("Name") or ""
        values = []
        entries = [_entry(each, bases) for each in pdo.findall("Entry")]
        for entry in _signals(entries, is_input=tag == "TxPdo"):
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


def _entry(entry: ElementTree.Element, bases: Mapping[str, str]) -> _Entry:
    """Return an entry; ``bases``: base types of the types that the device defines."""
    index, sub = _parse(entry.findtext("Index") or "0"), _parse(entry.findtext("SubIndex") or "0")
    bits, kind = _parse(entry.findtext("BitLen") or "0"), (entry.findtext("DataType") or "").strip()
    if not 0 <= bits <= _MAX_BITS:
        raise EsiError(f"object {index:#06x}:{sub} has {bits} bits; allowed 0 to {_MAX_BITS}")
    number, first = 1, 0
    if array := _ARRAY.match(kind):
        first, kind = _parse(array[1]), array[3]
        number = 1 + _parse(array[2]) - first
    known = _TYPES.get(kind) or _TYPES.get(bases.get(kind, ""), "")
    if known == "bit" and number == 1 and bits in (8, 16, 32):
        known = f"u{bits}"  # a truth value that fills octets
    lacks_subs = sub <= _LAST_SUB < sub + number - 1  # an array of more elements than sub-indices
    if index == 0 or not known or lacks_subs or _BITS[known] * number != bits:
        return _Entry("", 0, 0, "", bits)
    return _Entry((entry.findtext("Name") or "").strip(), index, sub, known, number, first)


def _signals(entries: Iterable[_Entry], *, is_input: bool) -> list[_Entry]:
    """Return an entry for each signal: samples are joined, other arrays are split."""
    signals: list[_Entry] = []
    for entry in entries:
        stem = _stem(entry.name)
        if not is_input or entry.kind in ("", "bit") or not _SAMPLES.fullmatch(stem):
            signals += _elements(entry)
            continue
        last = signals[-1] if signals else None
        here = (entry.kind, stem, entry.object, entry.sub)
        if last and (last.kind, _stem(last.name), last.object, last.sub + last.number) == here:
            signals[-1] = last._replace(name=stem, number=last.number + entry.number)
        else:
            signals.append(entry)
    return signals


def _elements(entry: _Entry) -> list[_Entry]:
    """Return the elements of an array; of any other entry the entry."""
    if not entry.kind or entry.number == 1:
        return [entry]
    return [
        _Entry(f"{entry.name} {entry.first + at}", entry.object, entry.sub + at, entry.kind, 1)
        for at in range(entry.number)
    ]


def _stem(name: str) -> str:
    return re.sub(r"[\s_\[\(]*\d+[\]\)]?$", "", name).strip()


def _objects(mailbox: ElementTree.Element) -> Iterator[dict[str, Any]]:
    """Yield the objects that are set from PREOP to SAFEOP, but for the choice of PDOs."""
    for command in mailbox.iter("InitCmd"):
        index = _parse(command.findtext("Index") or "0")
        transitions = {(each.text or "").strip() for each in command.findall("Transition")}
        if "PS" not in transitions or 0x1C00 <= index <= 0x1C3F:
            continue
        sub, text = _parse(command.findtext("SubIndex") or "0"), command.findtext("Data") or ""
        if _flag(command, "CompleteAccess"):
            raise EsiError(
                f"object {index:#06x}:{sub} is set by complete access; allowed one sub-index at a "
                "time: describe the slave in a device file of your own"
            )
        try:
            data = bytes.fromhex(text)
        except ValueError:
            raise EsiError(f"object {index:#06x}:{sub}: data {text!r} are no octets") from None
        if len(data) not in _SET_TYPES:
            raise EsiError(
                f"object {index:#06x}:{sub} is set with {len(data)} octets at once; allowed 1, 2, "
                "4: describe the slave in a device file of your own"
            )
        yield {
            "object": index,
            "sub": sub,
            "type": _SET_TYPES[len(data)],
            "value": int.from_bytes(data, "little"),
        }


def _sync0(device: ElementTree.Element) -> tuple[bool, list[int]]:
    """Return whether a slave works with SYNC0 only, and the cycles that SYNC0 must have, in ns.

    It works with SYNC0 only if every mode of operation has it. No cycles: those of any tick.
    EsiError if it needs more than a SYNC0 in each tick, such as SYNC1, or SYNC0 several times.
    """
    modes = device.findall("Dc/OpMode")
    activations = [_parse(each.findtext("AssignActivate") or "0") for each in modes]
    is_needed = bool(modes) and all(each & _CYCLIC_SYNC0 == _CYCLIC_SYNC0 for each in activations)
    cycles = []
    for mode, activation in zip(modes, activations, strict=True):
        if activation != _CYCLIC_SYNC0:
            continue
        cycle = mode.find("CycleTimeSync0")
        if cycle is None or (factor := _number(cycle, "Factor")) == 1:
            cycles.append(0)
        elif factor == 0:  # a fixed time
            cycles.append(_parse(cycle.text or "0"))
    if cycles or not is_needed:
        return is_needed, [] if 0 in cycles else cycles
    shown = ", ".join(f"{each:#06x}" for each in activations)
    raise EsiError(
        f"its modes of operation have AssignActivate {shown}; allowed one with "
        f"{_CYCLIC_SYNC0:#06x}, SYNC0 once in a cycle, or one without"
    )


def _flag(element: ElementTree.Element, attribute: str) -> bool:
    return element.get(attribute, "0").strip().lower() in ("1", "true")


def _title(device: ElementTree.Element) -> str:
    names = device.findall("Name")
    english = [each for each in names if each.get("LcId") in (None, _ENGLISH)]
    found = next((each.text for each in (*english, *names) if each.text), None)
    return (found or _type_name(device) or "slave").strip()


def _type_name(device: ElementTree.Element) -> str:
    return (_type(device).text or "").strip()


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
