"""A loop at 1 kHz and its service on one end of a veth pair, an emulated segment on the other.

`unshare -Urn python segment_loop.py SCENARIO` prints one line of JSON: what the loop saw.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from drivers.cia402 import scaling, state_machine
from drivers.cia402.arming import SetupStep, format_mismatches
from drivers.cia402.torque_drive import TORQUE_MODE, TorqueDriveSettings
from drivers.ethercat.cycle import SegmentCycle
from drivers.ethercat.frames import CyclicFrame
from drivers.ethercat.link import Link
from drivers.ethercat.pdo_steps import (
    FIRST_INPUT_PDO,
    FIRST_OUTPUT_PDO,
    INPUTS,
    OUTPUTS,
    only_pdo_steps,
)
from drivers.ethercat.process_image import Area, expected_wkc, image_bytes, read_bit, write_bit
from drivers.ethercat.service import AlState, Service, SlaveSetup
from drivers.ethercat.torque_axis import OUTPUTS as DRIVE_OUTPUTS
from drivers.ethercat.torque_axis import TorqueAxis, TorqueAxisSettings
from drivers.ethercat.torque_axis import inputs as drive_inputs

MASTER_END, SEGMENT_END = "ecmaster", "ecslaves"
LINE = (
    "coupler", "torque_drive", "digital_in:4", "digital_out:4", "digital_in:2", "digital_out:2",
    "analog_in", "encoder:2",
)  # fmt: skip
DRIVE, DIGITAL_IN, DIGITAL_OUT = 1, 2, 3
TICK = 0.001
WATCHDOG_MS = 2000.0  # the emulator shares a busy host with the loop
MACHINE = state_machine.Params(1.0, 1, 0, 0, 20, state_machine.Deadlines(0, *[2000] * 11))


class Bench:
    """Service, cycle and drive, and the console of the emulator."""

    def __init__(self, emulator: subprocess.Popen[str]) -> None:
        self._emulator = emulator
        self.service = Service(MASTER_END)
        self.identities = self.service.find()
        drive = (
            *only_pdo_steps(OUTPUTS, FIRST_OUTPUT_PDO, DRIVE_OUTPUTS),
            *only_pdo_steps(INPUTS, FIRST_INPUT_PDO, drive_inputs(0)),
            SetupStep(0x6060, 0, "i8", "mode_of_operation", TORQUE_MODE, 0, -1),
            SetupStep(0x6007, 0, "i16", "abort_connection", 1, 0, -1),
        )
        self.mismatches = self.service.configure(
            [
                SlaveSetup(name, drive if place == DRIVE else (), WATCHDOG_MS * (place == DRIVE))
                for place, name in enumerate(LINE)
            ]
        )
        self.areas = self.service.areas()
        frame = CyclicFrame(image_bytes(self.areas), None)
        self.cycle = SegmentCycle(Link(MASTER_END), frame, expected_wkc(self.areas))
        outputs, inputs = self.areas[DRIVE]
        assert outputs is not None
        assert inputs is not None
        peak = self.service.read(DRIVE, 0x20D8, 0x0C, "u16")
        assert peak is not None
        scale = scaling.amc_current(peak, 10.0)
        self.axis = TorqueAxis(
            TorqueAxisSettings(TorqueDriveSettings(MACHINE, scale, 0.1), outputs, inputs)
        )
        self.ages: list[float] = []
        self._due = time.perf_counter()

    def command(self, text: str) -> Any:
        assert self._emulator.stdin is not None
        assert self._emulator.stdout is not None
        self._emulator.stdin.write(text + "\n")
        self._emulator.stdin.flush()
        return json.loads(self._emulator.stdout.readline())

    def tick(self, current: float = 0.0, enable: int = 0) -> None:
        """Wait for the next tick and exchange process data."""
        self._due = max(self._due + TICK, time.perf_counter() - 0.1)
        time.sleep(max(0.0, self._due - time.perf_counter()))
        now = self.cycle.receive()
        self.ages.append(now - self.cycle.sampled)
        self.axis.take(self.cycle.inputs, self.cycle.sampled)
        self.axis.command(self.cycle.outputs, current, enable, now)
        self.cycle.send()

    def until(
        self, condition: Callable[[], object], current: float = 0.0, enable: int = 0
    ) -> float:
        """Tick until a condition is true; return the time that it took."""
        began = time.perf_counter()
        while not condition():
            assert time.perf_counter() - began < 10.0, (self.cycle.state, self.axis.explain())
            self.tick(current, enable)
        return time.perf_counter() - began

    def is_operational(self) -> bool:
        return self.cycle.state.is_operational(len(LINE))

    def reach_op(self) -> float:
        """Run the cycle while the service asks for OP, as another process would."""
        for _ in range(5):
            self.tick()
        asking = threading.Thread(target=self.service.request, args=(AlState.OPERATIONAL,))
        asking.start()
        took = self.until(self.is_operational)
        asking.join()
        return took

    def act(self, current: float) -> None:
        """Enable the drive and let the current settle."""
        self.until(lambda: self.axis.read(self.cycle.receive()).acting, current, 1)
        for _ in range(100):
            self.tick(current, 1)


def area(found: Area | None) -> Area:
    assert found is not None
    return found


def run_cycle(bench: Bench) -> dict[str, Any]:
    took = bench.reach_op()
    bench.act(2.0)
    cycle = bench.cycle
    wired = []
    for pattern in (0b0101, 0b1010):
        for bit in range(4):
            place = area(bench.areas[DIGITAL_OUT].outputs).first_bit + bit
            write_bit(cycle.outputs, place, pattern >> bit & 1)
        for _ in range(20):
            bench.tick(2.0, 1)
        first = area(bench.areas[DIGITAL_IN].inputs).first_bit
        wired.append(sum(read_bit(cycle.inputs, first + bit) << bit for bit in range(4)))
    before = cycle.wrong_wkc, cycle.lost
    bench.ages.clear()
    for _ in range(3000):
        bench.tick(2.0, 1)
    reading = bench.axis.read(cycle.receive())
    return {
        "mismatches": [format_mismatches(each) for each in bench.mismatches],
        "names": [each.name for each in bench.identities],
        "to_op_s": took,
        "wired": wired,
        "current": reading.current,
        "counts": reading.counts,
        "wrong": [cycle.wrong_wkc - before[0], cycle.lost - before[1], cycle.foreign],
        "age": sorted(bench.ages)[len(bench.ages) // 2],
        "status": [each.state for each in bench.service.status()],
    }


def run_stall(bench: Bench) -> dict[str, Any]:
    """A wire that stands still for 25 ms while the service talks, too."""
    bench.reach_op()
    bench.act(1.0)
    bench.ages.clear()
    bench.command("inject segment stall")
    for _ in range(200):
        bench.tick(1.0, 1)
    old = [place for place, age in enumerate(bench.ages) if age > 0.010]
    return {
        "oldest": max(bench.ages),
        "ticks_until_normal": next(
            (i for i, age in enumerate(bench.ages[old[-1] + 1 :]) if age < 0.003), 99
        ),
        "median_after": sorted(bench.ages[-100:])[50],
        "wrong": bench.cycle.wrong_wkc,
    }


def run_unplugged(bench: Bench) -> dict[str, Any]:
    """A drive without its cable: inputs age, the drive loses its permission, and gets none back."""
    bench.reach_op()
    bench.act(1.0)
    answers = bench.cycle.wrong_wkc
    bench.command("inject torque_drive unplugged")
    for _ in range(1200):
        bench.tick(1.0, 1)
    lost = bench.axis.read(bench.cycle.receive())
    state = bench.cycle.state
    bench.command("clear torque_drive unplugged")
    for _ in range(200):
        bench.tick(1.0, 1)
    back = bench.axis.read(bench.cycle.receive())
    return {
        "slaves": state.slaves,
        "wrong": bench.cycle.wrong_wkc - answers,
        "lost_age": lost.age,
        "lost_acting": lost.acting,
        "back_acting": back.acting,
        "why": bench.axis.explain(),
    }


SCENARIOS: dict[str, Callable[[Bench], dict[str, Any]]] = {
    "cycle": run_cycle,
    "stall": run_stall,
    "unplugged": run_unplugged,
}


@contextmanager
def bench() -> Iterator[Bench]:
    for command in (
        f"ip link add {MASTER_END} type veth peer name {SEGMENT_END}",
        f"ip link set {MASTER_END} up",
        f"ip link set {SEGMENT_END} up",
    ):
        subprocess.run(command.split(), check=True, capture_output=True)
    emulator = subprocess.Popen(
        [sys.executable, "-m", "sim_plant.emulators.ethercat", SEGMENT_END, "--slaves",
         ",".join(LINE)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert emulator.stdout is not None
        emulator.stdout.readline()
        found = Bench(emulator)
        try:
            yield found
        finally:
            found.cycle.close()
            found.service.close()
    finally:
        emulator.terminate()
        emulator.wait()


if __name__ == "__main__":
    with bench() as found:
        print(json.dumps(SCENARIOS[sys.argv[1]](found)))
