"""Steps that map the process data of a CANopen node, and its heartbeat consumer (CiA 301)."""

from drivers.canopen.pdo import Layout
from drivers.cia402.arming import SetupError, SetupStep, in_range, mapping_steps
from drivers.cia402.drive_objects import Access

_OFF = 1 << 31  # of a PDO's COB-ID: the PDO does not exist
_PDO_ID = 0xA000_07FF  # that bit, 29-bit frame, identifier; the drive owns bit 30 (remote requests)


def heartbeat_consumer(node: int, milliseconds: int) -> int:
    """Return the value of 0x1016:1 with which a drive monitors the heartbeat of ``node``."""
    if not (1 <= node <= 127 and 1 <= milliseconds <= 0xFFFF):
        raise SetupError(f"heartbeat_consumer: node {node}, {milliseconds} ms")
    return node << 16 | milliseconds


def rpdo_steps(number: int, pdo: Layout, transmission: int, deadline: int) -> tuple[SetupStep, ...]:
    """Return the steps that remap RPDO ``number`` (1 to 512) with a ``deadline`` (ms, > 0).

    The drive's reaction to a missed deadline is its 0x6007 or specific to the manufacturer. Whether
    a drive monitors the event timer of an RPDO differs between manufacturers, so test it.
    """
    if not 1 <= deadline <= 0xFFFF:
        raise SetupError(f"RPDO{number} deadline: {deadline} ms is not 1 to 65535")
    return _remap("RPDO", 0x1400, 0x1600, number, pdo, transmission, deadline)


def tpdo_steps(number: int, pdo: Layout, transmission: int) -> tuple[SetupStep, ...]:
    """Return the steps that remap TPDO ``number`` (1 to 512).

    The drive sends it on every ``transmission``-th SYNC (1 to 240).
    """
    if not 1 <= transmission <= 240:
        raise SetupError(f"TPDO{number} transmission type: {transmission} is not 1 to 240")
    return _remap("TPDO", 0x1800, 0x1A00, number, pdo, transmission, None)


def silent_tpdo_step(number: int, cob_id: int) -> SetupStep:
    """Return the step that disables a TPDO which is on by default but not in the bus budget."""
    return SetupStep(
        *_communication_index("TPDO", 0x1800, number), 1, "u32", f"TPDO{number} COB-ID",
        cob_id | _OFF, Access.SET, _OFF,
    )  # fmt: skip


def _communication_index(kind: str, base: int, number: int) -> tuple[int]:
    if not 1 <= number <= 512:
        raise SetupError(f"{kind}{number}: not 1 to 512")
    return (base + number - 1,)


def _remap(
    kind: str,
    comm_base: int,
    map_base: int,
    number: int,
    pdo: Layout,
    transmission: int,
    deadline: int | None,
) -> tuple[SetupStep, ...]:
    """Return the steps in the order of CiA 301.

    The order is: off, no entries, entries, their count, type and times, on.
    """
    (comm,), (mapping,) = (
        _communication_index(kind, comm_base, number),
        _communication_index(kind, map_base, number),
    )
    name = f"{kind}{number}"

    def step(index: int, sub: int, of: str, what: str, value: int, access: Access) -> SetupStep:
        what = f"{name} {what}"
        mask = _PDO_ID if (index, sub) == (comm, 1) else -1
        return SetupStep(index, sub, of, what, in_range(what, of, value), access, mask)

    steps = [
        step(comm, 1, "u32", "COB-ID", pdo.cob_id | _OFF, Access.TRANSIENT),
        *mapping_steps(name, mapping, pdo.entries),
        step(comm, 2, "u8", "transmission type", transmission, Access.SET),
    ]
    if deadline is not None:
        steps.append(step(comm, 5, "u16", "deadline", deadline, Access.SET))
    steps.append(step(comm, 1, "u32", "COB-ID", pdo.cob_id, Access.SET))
    return tuple(steps)
