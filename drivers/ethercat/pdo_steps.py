"""Steps that map and assign the process data of a slave with a CoE mailbox (ETG.1000, part 6)."""

from drivers.cia402.arming import SetupStep, mapping_steps
from drivers.cia402.drive_objects import Access
from drivers.cia402.process_data import Entry

OUTPUTS, INPUTS = 0x1C12, 0x1C13  # the sync managers' lists of PDOs
FIRST_OUTPUT_PDO, FIRST_INPUT_PDO = 0x1600, 0x1A00


def only_pdo_steps(assigned: int, pdo: int, entries: tuple[Entry, ...]) -> tuple[SetupStep, ...]:
    """Return the steps that make one PDO with these entries the only one of a sync manager.

    ``assigned``: `OUTPUTS` or `INPUTS`; ``pdo``: index of its mapping. The order: no PDO, the
    mapping, the PDO, the count of PDOs.
    """
    name = f"{assigned:#06x}"
    return (
        SetupStep(assigned, 0, "u8", f"{name} count", 0, Access.TRANSIENT, -1),
        *mapping_steps(f"PDO {pdo:#06x}", pdo, entries),
        SetupStep(assigned, 1, "u16", f"{name} PDO", pdo, Access.SET, -1),
        SetupStep(assigned, 0, "u8", f"{name} count", 1, Access.SET, -1),
    )
