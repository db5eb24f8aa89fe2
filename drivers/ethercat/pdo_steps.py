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
    empty, *rest = pdo_list_steps(assigned, (pdo,))
    return (empty, *mapping_steps(f"PDO {pdo:#06x}", pdo, entries), *rest)


def pdo_list_steps(assigned: int, pdos: tuple[int, ...]) -> tuple[SetupStep, ...]:
    """Return the steps that make these PDOs, as the slave has them, those of a sync manager.

    ``assigned``: `OUTPUTS` or `INPUTS`; ``pdos``: indices of their mappings. Without one the slave
    may lack the list: the areas of its process data show whether it has taken the step.
    """
    name = f"{assigned:#06x}"
    empty = SetupStep(assigned, 0, "u8", f"{name} count", 0, Access.TRANSIENT, -1)
    if not pdos:
        return (empty,)
    return (
        empty,
        *(
            SetupStep(assigned, place, "u16", f"{name} PDO {place}", pdo, Access.SET, -1)
            for place, pdo in enumerate(pdos, 1)
        ),
        SetupStep(assigned, 0, "u8", f"{name} count", len(pdos), Access.SET, -1),
    )
