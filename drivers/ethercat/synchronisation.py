"""SYNC0 of a slave with a mailbox: the objects that choose it, and whether the slave took them.

ETG.1020: 0x1C32 for outputs, 0x1C33 for inputs. A slave may lack these objects or not let them be
written: then the registers of its SYNC unit choose alone.
"""

from collections.abc import Callable

from drivers.cia402.arming import SetupStep
from drivers.cia402.drive_objects import Access

OUTPUTS, INPUTS = 0x1C32, 0x1C33
_TYPE, _CYCLE = 1, 2  # sub-indices
_SYNC0 = 2  # type of synchronisation


def sync0_steps(cycle_ns: int) -> tuple[SetupStep, ...]:
    """Return the steps that let a slave work with SYNC0 of a cycle (ns); it may refuse them."""
    return tuple(
        SetupStep(index, sub, kind, f"{index:#06x}:{sub}", value, Access.TRANSIENT, -1)
        for index in (OUTPUTS, INPUTS)
        for sub, kind, value in ((_TYPE, "u16", _SYNC0), (_CYCLE, "u32", cycle_ns))
    )


def sync0_problem(read: Callable[[int, int, str], int | None], cycle_ns: int) -> str:
    """Return why a slave in SAFE_OPERATIONAL does not work with SYNC0; empty if nothing shows it.

    ``read`` returns an object by index, sub-index and type; None: it does not exist.
    """
    chosen = read(OUTPUTS, _TYPE, "u16")
    if chosen not in (None, _SYNC0):
        return (
            f"0x1C32:01 is {chosen}, so it does not work with SYNC0 ({_SYNC0}); the maker's manual "
            "has the objects that choose it"
        )
    cycle = read(OUTPUTS, _CYCLE, "u32")
    if cycle not in (None, 0, cycle_ns):
        return f"0x1C32:02 is {cycle} ns; SYNC0 comes with each tick of the rig, {cycle_ns} ns"
    return ""
