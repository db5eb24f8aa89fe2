"""A poller in its own process, on an emulated Modbus/TCP server whose units are often busy."""

from __future__ import annotations

import asyncio
import os
import random
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from rig.config.pydantic_errors import load
from rig.kinds.wavebot.config import LimitsFile, RigFile
from rig.processes import handover, mailbox
from rig.processes.child import Child
from rig.processes.messages import IoJob, Notice, Ready, Refused, Report, Slot
from rig.wires.job import wired_job
from rig.wires.messages import open_mailboxes
from sim_plant.emulators.io_coupler import CouplerSettings, DigitalInput, IoCoupler
from sim_plant.emulators.modbus_tcp import TcpUnits
from sim_plant.emulators.modbus_unit import Answer, ModbusUnit
from sim_plant.emulators.power_analyser import (
    AnalyserSettings,
    PowerAnalyser,
    Terminals,
    TerminalValues,
)

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
COUPLER = CouplerSettings(
    inputs=(DigitalInput("e_stop", "e_stop", 1), DigitalInput("limit_switch", "limit_switch", 1)),
    outputs=("wave_trigger",),
)
ITEMS: Any = (("element_1", "P"), ("element_2", "P"), ("element_2", "U"))  # ac, dc, bus_voltage
SECONDS = 4.0  # s of observation
SEED = 20170815


class FaultyUnits(TcpUnits):
    """Units of which some answer a share of all requests with an exception."""

    def __init__(self, units: dict[int, ModbusUnit]) -> None:
        super().__init__(units)
        self.random = random.Random(SEED)
        self.faults: dict[int, tuple[float, int]] = {}  # by unit: share of requests, exception
        self.refused = 0
        self.asked = threading.Event()  # by the first request

    def serve(self, unit: int, pdu: bytes) -> Answer | None:
        self.asked.set()
        share, code = self.faults.get(unit, (0.0, 0))
        if self.random.random() < share:
            self.refused += 1
            return Answer(bytes((pdu[0] | 0x80, code)), 0.0)
        return super().serve(unit, pdu)


@contextmanager
def served(units: FaultyUnits) -> Iterator[None]:
    """Run the server in a thread of its own."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    asyncio.run_coroutine_threadsafe(units.start(), loop).result(5.0)
    try:
        yield
    finally:
        asyncio.run_coroutine_threadsafe(units.close(), loop).result(5.0)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


class Observation(NamedTuple):
    """A poller's output as the loop would receive it."""

    oldest: dict[str, float]  # s, by block: largest age after the first value
    values: dict[str, int]  # by block: number of different values
    reports: list[Report]
    refused: int  # requests that were answered by an exception


def poll_units(
    faults: dict[int, tuple[float, int]], folder: Path, timeout_s: float = 8.0
) -> Observation:
    """Poll the analyser (unit 1) and the I/O coupler (unit 2) of the WaveBot on one line.

    The observation lasts `SECONDS` after the poller is ready, or ``timeout_s`` from its first
    request if it never is.
    """
    started = time.monotonic()

    def terminals() -> Terminals:
        flow = TerminalValues(150.0, 2.0, -300.0, 0.0)
        return Terminals(time.monotonic() - started, flow, flow, flow, flow)

    units = FaultyUnits(
        {1: PowerAnalyser(terminals, AnalyserSettings(0.05, items=ITEMS)), 2: IoCoupler(COUPLER)}
    )
    units.faults = faults
    with served(units):
        wiring = load(CONFIGS / "rigs" / "wavebot_hil.yaml", RigFile)[0].wiring
        assert wiring is not None
        line = wiring.lines["io"].model_copy(update={"port": units.port})
        changes = {
            "lines": {**wiring.lines, "io": line},
            "analyser": wiring.analyser.model_copy(update={"line": "io", "unit": 1}),
            "inputs": wiring.inputs.model_copy(update={"unit": 2}),
            "outputs": wiring.outputs.model_copy(update={"unit": 2}),
        }
        pollers = wired_job(wiring.model_copy(update=changes), 1000, {}).io_processes
        (poller,) = (each for each in pollers if each.name == "line io")
        shared = {n: Slot(mailbox.create(), fields) for n, fields in poller.mailboxes.items()}
        fds = [slot.fd for slot in shared.values()]
        lifeline, loop_end = os.pipe()  # as the loop holds it
        job = handover.dumps(IoJob(poller.config, shared, lifeline))
        inherited = (lifeline, *fds)
        child = Child(poller.module, job, inherited, folder / "stderr")
        try:
            slots = open_mailboxes(shared)
            assert units.asked.wait(30.0)  # its process may start slowly
            oldest, values, reports = observe(child, slots, timeout_s)
            return Observation(oldest, values, reports, units.refused)
        finally:
            child.process.terminate()
            child.end(5.0)
            for fd in (lifeline, loop_end, *fds):
                os.close(fd)


def observe(child: Child, slots: dict[str, Any], timeout_s: float) -> tuple[Any, Any, Any]:
    oldest = {"analyser": 0.0, "inputs": 0.0}
    stamps = {name: set[float]() for name in oldest}
    reports: list[Report] = []
    until = time.monotonic() + timeout_s
    while time.monotonic() < until and child.alive():
        new = child.read_reports()
        reports += new
        if any(isinstance(report, Ready) for report in new):
            until = time.monotonic() + SECONDS
        for name, block_stamps in stamps.items():
            message = slots[name].read()
            if message is not None:
                block_stamps.add(message.stamp)
                oldest[name] = max(oldest[name], time.monotonic() - message.stamp)
        time.sleep(0.002)
    reports += child.read_reports()
    counts = {name: len(block_stamps) for name, block_stamps in stamps.items()}
    return oldest, counts, reports


def message_text(observation: Observation) -> str:
    return "\n".join(
        report[0] for report in observation.reports if isinstance(report, Notice | Refused)
    )


def analyser_age_limit() -> float:
    """Return the age of the analyser's values (s) from which the emulated WaveBot is stopped."""
    return load(CONFIGS / "limits" / "wavebot_hil.yaml", LimitsFile)[0].loop.analyser_age_stop_s


@pytest.mark.realtime
@pytest.mark.paired
@pytest.mark.parametrize("code", [5, 6])
def test_half_busy_units_keep_giving_values(code: int, tmp_path: Path) -> None:
    """Requests for the analyser's counter and values and the coupler's set-up are repeated."""
    observation = poll_units({1: (0.5, code), 2: (0.5, code)}, tmp_path)
    print(observation.oldest, observation.values, observation.refused)
    assert observation.refused > 100
    assert message_text(observation) == ""
    assert isinstance(observation.reports[-1], Ready)
    assert observation.oldest["analyser"] < 0.5 * analyser_age_limit()
    assert observation.oldest["inputs"] < 0.5
    assert observation.values["analyser"] > 0.7 * SECONDS / 0.05  # it averages over 50 ms
    assert observation.values["inputs"] > 0.3 * SECONDS / 0.02


@pytest.mark.realtime
@pytest.mark.paired
def test_an_always_busy_unit_is_reported_and_delays_no_other(tmp_path: Path) -> None:
    alone = poll_units({}, tmp_path)
    observation = poll_units({1: (1.0, 6)}, tmp_path)
    assert observation.values["analyser"] == 0
    assert "analyser: " in message_text(observation)
    assert "refused with exception 6, busy" in message_text(observation)
    (refused,) = [each for each in observation.reports if isinstance(each, Refused)]
    assert "analyser" in refused.why
    assert "inputs" not in refused.why
    assert observation.oldest["inputs"] < alone.oldest["inputs"] + 0.1


@pytest.mark.parametrize(
    ("code", "name"), [(2, "illegal address"), (4, "device failure"), (3, "illegal value")]
)
def test_a_persistent_exception_is_named_and_not_repeated(
    code: int, name: str, tmp_path: Path
) -> None:
    observation = poll_units({1: (1.0, code)}, tmp_path, 1.5)
    assert 3 <= observation.refused <= 10  # after pauses that double
    assert f"refused with exception {code}, {name}" in message_text(observation)
