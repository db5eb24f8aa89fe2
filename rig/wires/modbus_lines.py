"""The I/O processes that poll a rig's Modbus lines."""

from collections.abc import Iterable, Mapping
from typing import Any

from rig.config.wiring import AnyLine, Registers
from rig.processes.io_processes import IoProcess
from rig.wires.messages import ACKNOWLEDGEMENT_SUFFIX, MESSAGE_TYPES

# Fields of `TcpSettings` and `RtuSettings` (drivers.modbus.line) whose keys in the rig file differ.
_LINE_FIELDS = {"timeout_s": "timeout", "slowest_s": "max_response_time"}


def modbus_pollers(
    lines: Mapping[str, AnyLine],
    blocks: Mapping[str, Registers],
    written: Iterable[str],
    expiry: float,
) -> list[IoProcess]:
    """Return a poller for each line with blocks; it writes those in ``written``, reads the others.

    ``expiry``: age (s) of a command of the loop beyond which the poller writes zeros.
    """
    by_line: dict[str, list[dict[str, Any]]] = {}
    for name, registers in blocks.items():
        block = _block_settings(name, registers, name in written)
        by_line.setdefault(registers.line, []).append(block)
    processes = []
    for line, line_blocks in by_line.items():
        settings = lines[line].model_dump()
        kind = settings.pop("kind")
        config = {
            "kind": kind,
            "settings": {_LINE_FIELDS.get(key, key): value for key, value in settings.items()},
            "blocks": line_blocks,
            "expiry": expiry,
        }
        block_names = tuple(block["name"] for block in line_blocks)
        acknowledgements = tuple(
            f"{name}{ACKNOWLEDGEMENT_SUFFIX}"
            for name in block_names
            if f"{name}{ACKNOWLEDGEMENT_SUFFIX}" in MESSAGE_TYPES
        )
        names = (*block_names, *acknowledgements)
        processes.append(IoProcess(f"line {line}", f"{__package__}.modbus_poller", config, names))
    return processes


def _block_settings(name: str, registers: Registers, written: bool) -> dict[str, Any]:
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
        "prepare": [list(each.model_dump().values()) for each in registers.prepare],
        "values": [[v.name, v.at, v.kind, v.scale, v.low, v.high] for v in registers.values],
    }
