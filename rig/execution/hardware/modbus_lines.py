"""The processes that poll a rig's Modbus lines, as companions of its loop."""

from collections.abc import Iterable, Mapping
from typing import Any

from rig.config.wiring import AnyLine, Registers
from rig.execution.hardware.messages import DONE, SLOTS
from rig.processes.io_processes import IoProcess


def modbus_pollers(
    lines: Mapping[str, AnyLine],
    blocks: Mapping[str, Registers],
    written: Iterable[str],
    expiry: float,
) -> list[IoProcess]:
    """A poller a line, for the blocks on it; those in ``written`` go out, the others come in.

    ``expiry``: age (s) from which what the loop wanted is let go.
    """
    by_line: dict[str, list[dict[str, Any]]] = {}
    for name, registers in blocks.items():
        block = _block(name, registers, name in written)
        by_line.setdefault(registers.line, []).append(block)
    found = []
    for line, several in by_line.items():
        settings = lines[line].model_dump()
        kind = settings.pop("kind")
        config = {
            "kind": kind,
            "settings": {key.removesuffix("_s"): value for key, value in settings.items()},
            "blocks": several,
            "expiry": expiry,
        }
        blocks_here = tuple(block["name"] for block in several)
        done = tuple(f"{name}{DONE}" for name in blocks_here if f"{name}{DONE}" in SLOTS)
        names = (*blocks_here, *done)
        found.append(IoProcess(f"line {line}", f"{__package__}.modbus_poller", config, names))
    return found


def _block(name: str, registers: Registers, written: bool) -> dict[str, Any]:
    return {
        "name": name,
        "unit": registers.unit,
        "table": registers.table,
        "first": registers.first,
        "size": registers.size,
        "high_first": registers.word_order == "high first",
        "period": registers.period_s,
        "counter": registers.counter,
        "written": written,
        "prepare": [list(one.model_dump().values()) for one in registers.prepare],
        "values": [[v.name, v.at, v.kind, v.scale, v.low, v.high] for v in registers.values],
    }
