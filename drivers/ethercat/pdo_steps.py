"""Steps that map and assign the process data of a slave with a CoE mailbox (ETG.1000, part 6)."""

from drivers.cia402.arming import SetupStep
from drivers.cia402.drive_objects import Access
from drivers.cia402.process_data import Entry
from drivers.ethercat.process_image import SIZES

OUTPUTS, INPUTS = 0x1C12, 0x1C13  # the sync managers' lists of PDOs
FIRST_OUTPUT_PDO, FIRST_INPUT_PDO = 0x1600, 0x1A00


def mapping_steps(assigned: int, pdo: int, entries: tuple[Entry, ...]) -> tuple[SetupStep, ...]:
    """Return the steps that make one PDO with these entries the only one of a sync manager.

    ``assigned``: `OUTPUTS` or `INPUTS`; ``pdo``: index of its mapping. The order: no PDO, no
    entries, entries, their count, the PDO, the count of PDOs.
    """
    name = f"PDO {pdo:#06x}"

    def step(index: int, sub: int, kind: str, what: str, value: int, access: Access) -> SetupStep:
        return SetupStep(index, sub, kind, what, value, access, -1)

    return (
        step(assigned, 0, "u8", f"{assigned:#06x} count", 0, Access.TRANSIENT),
        step(pdo, 0, "u8", f"{name} count", 0, Access.TRANSIENT),
        *(
            step(pdo, sub, "u32", f"{name} entry {sub}", _word(entry), Access.SET)
            for sub, entry in enumerate(entries, start=1)
        ),
        step(pdo, 0, "u8", f"{name} count", len(entries), Access.SET),
        step(assigned, 1, "u16", f"{assigned:#06x} PDO", pdo, Access.SET),
        step(assigned, 0, "u8", f"{assigned:#06x} count", 1, Access.SET),
    )


def _word(entry: Entry) -> int:
    return entry.object << 16 | entry.sub << 8 | 8 * SIZES[entry.type]
