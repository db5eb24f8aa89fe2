"""`python -m sim_plant.emulators.ethercat IFACE`: an emulated EtherCAT segment, for testing only.

It prints a line of JSON when it is ready and for each command that it reads from its standard
input: `inject SLAVE FAULT [VALUE]`, `clear SLAVE FAULT`, `faults`, `report`. The slave `segment`
has the faults of the whole line, `link` those of the cable to the master (both directions).
"""

from __future__ import annotations

import argparse
import json
import os
import select
import signal
import sys
from pathlib import Path
from typing import Any

from sim_plant.emulators.ethercat import wire as wires
from sim_plant.emulators.ethercat.line import NAMES, BenchLine
from sim_plant.emulators.ethercat.segment import Segment
from sim_plant.emulators.ethercat.slave import Slave
from sim_plant.emulators.ethercat.wire import Wire
from sim_plant.emulators.link_faults import FAULTS as LINK_FAULTS

TRADE_MARK = (
    "EtherCAT is a registered trade mark and patented technology, licensed by Beckhoff Automation"
    " GmbH. No conformance is claimed."
)
DEFAULT_SLAVES = (
    "coupler,torque_drive,position_drive,digital_in:4,digital_out:4,analog_in,encoder:2"
)
COMMANDS = "inject SLAVE FAULT [VALUE], clear SLAVE FAULT, faults, report"
PACKAGE_FOLDERS = ("rig/configs/devices", "configs/devices")  # installed, source tree
INPUT_PERIOD = 50  # polls between two looks at the standard input


def find_devices() -> Path:
    """Return the folder of the device files. Raises FileNotFoundError."""
    root = Path(__file__).resolve().parents[3]
    for name in PACKAGE_FOLDERS:
        if (root / name).is_dir():
            return root / name
    raise FileNotFoundError(f"no device files in {', '.join(PACKAGE_FOLDERS)} of {root}")


class Console:
    """Commands on the standard input while the segment runs."""

    def __init__(self, line: BenchLine, wire: Wire) -> None:
        self._line, self._wire = line, wire
        self._open = True
        self._text = b""
        self._count = 0
        self.stopped = False

    def poll(self) -> bool:
        """Execute the commands that wait; return whether to stop."""
        self._count += 1
        if self._count % INPUT_PERIOD == 0 and self._open:
            readable, _, _ = select.select([0], (), (), 0.0)
            if readable:
                data = os.read(0, 4096)
                self._open = bool(data)
                self._text += data
                *lines, self._text = self._text.split(b"\n")
                for each in lines:
                    print(json.dumps(self.execute(each.decode())), flush=True)
        return self.stopped

    def execute(self, command: str) -> dict[str, Any]:
        """Return the answer to one command."""
        try:
            match command.split():
                case ["inject", slave, fault, *value] if len(value) <= 1:
                    self._switch(slave, fault, _number(value[0]) if value else None)
                case ["clear", slave, fault]:
                    self._clear(slave, fault)
                case ["report"]:
                    return self._line.report()
                case ["faults"]:
                    return self._faults()
                case _:
                    raise ValueError(COMMANDS)
        except ValueError as error:
            return {"error": str(error)}
        return {"done": command}

    def _find(self, name: str) -> Segment | Slave:
        segment = self._line.segment
        if name == "segment":
            return segment
        if name not in segment.slaves:
            raise ValueError(f"no slave {name!r}; there are {', '.join(segment.slaves)}")
        return segment.slaves[name]

    def _switch(self, name: str, fault: str, value: float | None) -> None:
        if name == "link":
            self._wire.link.switch(fault)
        else:
            self._find(name).inject(fault, value)

    def _clear(self, name: str, fault: str) -> None:
        if name == "link":
            self._wire.link.switch(fault, False)
        else:
            self._find(name).clear(fault)

    def _faults(self) -> dict[str, Any]:
        segment = self._line.segment
        found = {
            name: {fault.name: fault.effect for fault in self._find(name).faults()}
            for name in ("segment", *segment.slaves)
        }
        return {**found, "link": LINK_FAULTS}


def _number(text: str) -> float:
    """Return a number: decimal with or without a fraction, or hexadecimal after 0x."""
    return float(int(text, 16)) if text.lower().startswith("0x") else float(text)


def main() -> int:
    """Run the segment until SIGTERM or Ctrl-C; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m sim_plant.emulators.ethercat",
        description="An emulated EtherCAT segment on a network interface, for testing only.",
        epilog=TRADE_MARK,
    )
    parser.add_argument("interface", help="it must be up: one end of a veth pair, or a free card")
    parser.add_argument("--slaves", default=DEFAULT_SLAVES, help=f"in order: {', '.join(NAMES)}")
    parser.add_argument("--devices", type=Path, help="folder of the device files (EDS)")
    parser.add_argument("--capture", type=Path, help="pcap file of all frames")
    parser.add_argument("--spin", action="store_true", help="poll without sleeping")
    options = parser.parse_args()
    try:
        devices = options.devices or find_devices()
        line = BenchLine(options.slaves.split(","), devices, wires.clock)
        wire = Wire(line.segment, options.interface, capture=options.capture)
        console = Console(line, wire)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: setattr(console, "stopped", True))
        print(
            json.dumps({"ready": options.interface, "slaves": list(line.segment.slaves)}),
            flush=True,
        )
        wire.serve(console.poll, spin=options.spin)
    except (OSError, ValueError) as error:
        print(f"{parser.prog}: {options.interface}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
