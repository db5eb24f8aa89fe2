"""Binary records of the Compax3: ``SZ [Adr] L D0..Dn CRChi CRClo``, L = data bytes - 1.

SZ is the kind of record. In requests bit 0 means that an address follows (RS485), bit 3 selects PLC
number formats, and bit 1 (gateway) is refused because the drives lack it. Responses carry no
address. The drive accepts gaps of at most 5 ms between two bytes: send a record in one write.
Source: Compax3 manual 192-120100 N16 (I10T10, December 2010), 5.2.3, page 156 and 157.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.checksums import compax3_crc16
from drivers.errors import CodecError

NO_ADDRESS = -1  # RS232: one drive on the wire
MAX_ADDRESS = 99
MAX_REQUEST = 256  # data bytes
MAX_RESPONSE = 253
_ADDRESSED, _PLC = 0x01, 0x08
_SUBJECT = "Compax3 record"


class Kind(IntEnum):
    """Kind of a record; the value is its start code without the option bits."""

    RESPONSE = 0x05  # requested values
    ACK = 0x06  # written, and the function executed
    NAK = 0x07  # refused, with an error number
    READ = 0xA4
    WRITE = 0xC4


REPLIES = (Kind.RESPONSE, Kind.ACK, Kind.NAK)


class Object(NamedTuple):
    """Number of an object, written ``o680.5`` in the manuals."""

    number: int  # the manuals' index, 0 to 65535
    subindex: int  # 0 to 255


class Record(NamedTuple):
    """One record, its checksum verified and removed."""

    kind: Kind
    address: int  # 0 to 99, or NO_ADDRESS
    plc: int  # 1: numbers in PLC formats, 0: in DSP formats
    data: bytes


def record_kind(start: int) -> Kind | None:
    """Return the kind of record of a start code, None for any other byte."""
    if start in REPLIES:
        return Kind(start)
    request = start & ~(_ADDRESSED | _PLC)
    return Kind(request) if request in (Kind.READ, Kind.WRITE) else None


def allows_size(kind: Kind, size: int) -> bool:
    """Return True when a record of this kind may carry ``size`` data bytes."""
    if kind is Kind.RESPONSE:
        return 1 <= size <= MAX_RESPONSE
    if kind is Kind.READ:
        return size % 3 == 0 and 3 <= size <= MAX_REQUEST
    if kind is Kind.WRITE:
        return 4 <= size <= MAX_REQUEST
    return size == 2


def encode_record(record: Record) -> bytes:
    """Return the bytes of a record; CodecError for one that the drive would refuse."""
    kind, address, plc, data = record
    _check(record)
    head = bytes([kind | plc * _PLC])
    if address != NO_ADDRESS:
        head = bytes([head[0] | _ADDRESSED, address])
    body = head + bytes([len(data) - 1]) + data
    return body + compax3_crc16(body).to_bytes(2, "big")


def decode_record(data: bytes) -> Record:
    """Return the record that fills ``data`` exactly; CodecError for anything else."""
    kind = record_kind(data[0]) if data else None
    if kind is None:
        raise CodecError(_SUBJECT, "start code", "A4, C4 (+1, +8), 05, 06 or 07", data[:1].hex())
    request = kind in (Kind.READ, Kind.WRITE)
    addressed = request and data[0] & _ADDRESSED
    at = 2 if addressed else 1  # of the length byte
    if len(data) <= at:
        raise CodecError(_SUBJECT, "length", "a length byte", data.hex(" "))
    size = data[at] + 1
    if len(data) != at + 1 + size + 2:
        raise CodecError(_SUBJECT, "length", f"{at + 1 + size + 2} bytes", len(data))
    body, received = data[:-2], int.from_bytes(data[-2:], "big")
    expected = compax3_crc16(body)
    if received != expected:
        raise CodecError(_SUBJECT, "check sum", f"{expected:04X}", f"{received:04X}")
    address = data[1] if addressed else NO_ADDRESS
    plc = 1 if request and data[0] & _PLC else 0
    record = Record(kind, address, plc, body[at + 1 :])
    _check(record)
    return record


def read_request(objects: tuple[Object, ...], address: int = NO_ADDRESS, plc: int = 0) -> bytes:
    """Return the record that reads objects; the response holds their values in order."""
    return encode_record(Record(Kind.READ, address, plc, b"".join(map(_encode_object, objects))))


def write_request(target: Object, value: bytes, address: int = NO_ADDRESS, plc: int = 0) -> bytes:
    """Return the record that writes one object; ``value`` from `values.encode_value`."""
    return encode_record(Record(Kind.WRITE, address, plc, _encode_object(target) + value))


def error_number(record: Record) -> int:
    """Return the error number of a NAK (DriveCom and CiA 402 coding), 0 for any other record."""
    return int.from_bytes(record.data, "big") if record.kind is Kind.NAK else 0


def _check(record: Record) -> None:
    """Raise CodecError for an invalid record; the limits are the same in both directions."""
    kind, address, plc, data = record
    request = kind in (Kind.READ, Kind.WRITE)
    if not allows_size(kind, len(data)):
        raise CodecError(_SUBJECT, "data", f"a length that {kind.name} may have", len(data))
    if kind is Kind.ACK and data != b"\x00\x00":
        raise CodecError(_SUBJECT, "data of ACK", "00 00", data.hex(" "))
    if address != NO_ADDRESS and not (request and 0 <= address <= MAX_ADDRESS):
        raise CodecError(_SUBJECT, "address", "0 to 99, in a request only", address)
    if plc not in (0, 1) or (plc == 1 and not request):
        raise CodecError(_SUBJECT, "PLC bit", "0 or 1, in a request only", plc)


def _encode_object(target: Object) -> bytes:
    if not (0 <= target.number <= 0xFFFF and 0 <= target.subindex <= 0xFF):
        raise CodecError(_SUBJECT, "object", "index to 65535, subindex to 255", tuple(target))
    return target.number.to_bytes(2, "big") + bytes([target.subindex])
