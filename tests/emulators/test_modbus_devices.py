"""Analyser, amplifier and coupler: clocks, watchdog, faults."""

from __future__ import annotations

import math
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest
from emulator_stage import Stage, until

from sim_plant.emulators.io_coupler import AnalogOutput, CouplerSettings, IoCoupler
from sim_plant.emulators.modbus_pdu import ModbusRefusalError, Table
from sim_plant.emulators.modbus_tcp import TcpUnits
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.module_watchdog import ModuleWatchdog, Status
from sim_plant.emulators.power_analyser import (
    AnalyserSettings,
    PowerAnalyser,
    Terminals,
    TerminalValues,
)
from sim_plant.emulators.strain_amplifier import AmplifierSettings, StrainAmplifier


def value(unit: ModbusUnit, table: Table, address: int) -> float:
    data = struct.pack(">HH", *unit.read(table, address, 2))
    return float(struct.unpack(">f", data)[0])


def moving(clock: list[float]) -> Terminals:
    """Power rises by 100 W each second."""
    return Terminals(clock[0], TerminalValues(power=100.0 * clock[0]))


def run(unit: ModbusUnit, clock: list[float], until_: float, step: float = 0.001) -> None:
    while clock[0] < until_ - 1.0e-9:
        clock[0] = round(clock[0] + step, 6)
        unit.advance(clock[0])


def test_analyser_publishes_delayed_period_means() -> None:
    clock = [0.0]
    settings = AnalyserSettings(update_period=0.2, lag=0.05)
    unit = PowerAnalyser(lambda: moving(clock), settings)
    run(unit, clock, 1.04)
    assert value(unit, Table.INPUT, 104) == pytest.approx(100.0 * 0.7, abs=0.2)  # 0.6 to 0.8 s
    counter = unit.read(Table.INPUT, 1, 1)[0]
    run(unit, clock, 1.06)
    assert value(unit, Table.INPUT, 104) == pytest.approx(100.0 * 0.9, abs=0.2)
    assert unit.read(Table.INPUT, 1, 1)[0] == counter + 1
    upper, lower = unit.read(Table.INPUT, 2, 2)
    assert upper << 16 | lower == pytest.approx(1050, abs=3)  # ms of the analyser's clock


def test_each_period_of_the_source_is_published_once() -> None:
    reading = [Terminals(0.0, TerminalValues(power=1.0))]
    unit = PowerAnalyser(lambda: reading[0], AnalyserSettings(update_period=0.0))
    for k in range(10):
        unit.advance(0.01 * k)
    assert unit.updates == 1
    reading[0] = Terminals(0.1, TerminalValues(power=2.0))
    unit.advance(0.2)
    unit.advance(0.3)
    assert (unit.updates, value(unit, Table.INPUT, 104)) == (2, 2.0)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [("over_range", math.inf), ("no_data", math.nan), ("frozen_values", 0.0)],
)
def test_faults_of_the_analyser(fault: str, expected: float) -> None:
    clock = [0.0]
    unit = PowerAnalyser(lambda: moving(clock), AnalyserSettings(update_period=0.1))
    unit.faults.switch(fault)
    run(unit, clock, 0.5)
    assert value(unit, Table.INPUT, 104) == pytest.approx(expected, nan_ok=True)


def test_a_stuck_counter() -> None:
    clock = [0.0]
    unit = PowerAnalyser(lambda: moving(clock), AnalyserSettings(update_period=0.1))
    unit.faults.switch("counter_stuck")
    run(unit, clock, 0.35)
    assert unit.read(Table.INPUT, 1, 1) == [0]
    assert value(unit, Table.INPUT, 104) > 10.0


def test_stuck_values_with_a_running_counter() -> None:
    clock = [0.0]
    unit = PowerAnalyser(lambda: moving(clock), AnalyserSettings(update_period=0.1))
    run(unit, clock, 0.35)
    before = value(unit, Table.INPUT, 104)
    assert before > 10.0
    unit.faults.switch("stuck_values")
    run(unit, clock, 0.75)
    assert unit.read(Table.INPUT, 1, 1) == [7]
    assert value(unit, Table.INPUT, 104) == before


def test_every_other_request_is_refused_as_busy() -> None:
    unit = StrainAmplifier(lambda: (1.0,), AmplifierSettings(2.0))
    unit.faults.switch("half_busy")
    request = bytes((3, 1, 0, 0, 2))
    answers = [unit.serve(request, 0.001 * k) for k in range(6)]
    codes = [answer.pdu[:2] if answer is not None else b"" for answer in answers]
    assert [code == bytes((0x83, 6)) for code in codes] == [False, True] * 3


def test_swapped_words_of_a_known_voltage_are_not_plausible() -> None:
    unit = PowerAnalyser(
        lambda: Terminals(0.0, TerminalValues(voltage=230.0)), AnalyserSettings(update_period=0.0)
    )
    unit.advance(0.0)
    unit.faults.switch("swapped_words")
    assert not 1.0 < abs(value(unit, Table.INPUT, 100)) < 1000.0


def test_an_amplifier_holds_between_its_samples() -> None:
    load = [1.0]
    unit = StrainAmplifier(lambda: load, AmplifierSettings(rating=100.0, rate=10.0))
    unit.advance(0.01)
    load[0] = 2.0
    unit.advance(0.09)
    assert value(unit, Table.HOLDING, 0x100) == 1.0
    unit.advance(0.11)
    assert value(unit, Table.HOLDING, 0x100) == 2.0
    assert unit.samples == 2


@pytest.mark.parametrize(
    ("fault", "expected", "counts"),
    [
        ("saturated", 100.0, 100_000),
        ("saturated_negative", -100.0, -100_000),
        ("nan", math.nan, 0x7FFFFFFF),
    ],
)
def test_faults_of_an_amplifier(fault: str, expected: float, counts: int) -> None:
    unit = StrainAmplifier(lambda: (3.0,), AmplifierSettings(rating=100.0))
    unit.faults.switch(fault)
    unit.advance(1.0)
    assert value(unit, Table.HOLDING, 0x100) == pytest.approx(expected, nan_ok=True)
    registers = struct.pack(">HH", *unit.read(Table.HOLDING, 0x300, 2))
    assert struct.unpack(">i", registers)[0] == counts


def test_a_load_beyond_the_rating_saturates() -> None:
    unit = StrainAmplifier(lambda: (-500.0,), AmplifierSettings(rating=100.0))
    unit.advance(1.0)
    assert value(unit, Table.HOLDING, 0x100) == -100.0


def started(now: float = 0.0) -> ModuleWatchdog:
    dog = ModuleWatchdog()
    dog.write(0x1000, 5, now)
    dog.write(0x1003, 1, now)
    return dog


def test_the_watchdogs_registers() -> None:
    """WAGO 750 manuals, section MODBUS functions, registers 0x1000 to 0x1008."""
    dog = started()
    assert dog.read(0x1006) == Status.ACTIVE
    for address in (0x1000, 0x1001):
        with pytest.raises(ModbusRefusalError):
            dog.write(address, 9, 0.1)  # not while it runs
    dog.write(0x1003, 1, 0.4)  # the same value is no trigger
    assert not dog.check_expired(0.49)
    assert dog.check_expired(0.5)
    assert not dog.check_expired(0.6)
    assert dog.read(0x1006) == Status.EXHAUSTED
    dog.write(0x1007, 1, 1.0)
    assert dog.read(0x1006) == Status.ACTIVE
    dog.write(0x1005, 0xAAAA, 1.1)
    dog.write(0x1005, 0x5555, 1.1)
    assert dog.read(0x1006) == Status.NOT_ACTIVE
    assert not dog.check_expired(99.0)


def test_watchdog_is_renewed_by_changes_and_masked_functions() -> None:
    dog = ModuleWatchdog()
    dog.write(0x1003, 1, 0.0)
    assert dog.status is Status.NOT_ACTIVE  # no time is set
    dog.write(0x1000, 5, 0.0)
    dog.write(0x1001, 1 << 15, 0.0)
    dog.on_request(16, 0.0)
    assert dog.status is Status.NOT_ACTIVE
    dog.write(0x1003, 2, 0.0)
    dog.on_request(16, 0.3)
    dog.on_request(3, 0.7)
    assert not dog.check_expired(0.79)
    assert dog.read(0x1004) == 2  # 0.2 s were left when it was fed
    assert dog.check_expired(0.8)


def test_alternative_watchdog_is_renewed_by_any_request() -> None:
    dog = ModuleWatchdog()
    dog.write(0x1000, 2, 0.0)
    dog.write(0x100A, 1, 0.0)
    dog.on_request(3, 0.0)
    assert dog.check_expired(0.2)
    dog.on_request(3, 1.0)
    assert dog.status is Status.ACTIVE


def module(written: dict[str, float]) -> IoCoupler:
    settings = CouplerSettings(analog=(AnalogOutput("brake", 2.0),), outputs=("waves",))
    return IoCoupler(settings, write=written.__setitem__)


def wire(unit: IoCoupler, pdu: str, now: float) -> bytes:
    reply = unit.serve(bytes.fromhex(pdu), now)
    assert reply is not None
    return reply.pdu


def test_expired_module_refuses_outputs_until_restart() -> None:
    written: dict[str, float] = {}
    unit = module(written)
    for pdu in ("06 1000 0003", "06 1003 0001", "06 0000 7FFF", "05 0000 FF00"):
        assert wire(unit, pdu, 0.0) == bytes.fromhex(pdu)
    assert written == {"brake": 2.0, "waves": 1.0}
    unit.advance(0.31)
    assert written == {"brake": 0.0, "waves": 0.0}
    assert wire(unit, "03 0200 0001", 0.4) == bytes.fromhex("03 02 0000")
    assert wire(unit, "03 1006 0001", 0.4) == bytes.fromhex("03 02 0002")
    assert wire(unit, "06 0000 7FFF", 0.4) == bytes.fromhex("86 04")
    wire(unit, "06 1008 55AA", 0.5)
    assert wire(unit, "06 0000 4000", 0.5) == bytes.fromhex("06 0000 4000")
    assert written["brake"] == pytest.approx(2.0 * 0x4000 / 0x7FFF)


@pytest.mark.parametrize(
    ("fault", "status", "brake"),
    [("watchdog_off", 0, 2.0), ("watchdog_dead", 1, 2.0), ("outputs_dead", 2, 0.0)],
)
def test_faults_of_the_module(fault: str, status: int, brake: float) -> None:
    written: dict[str, float] = {}
    unit = module(written)
    unit.faults.switch(fault)
    for pdu in ("06 1000 0003", "06 1003 0001", "06 0000 7FFF"):
        wire(unit, pdu, 0.0)
    unit.advance(1.0)
    assert wire(unit, "03 1006 0001", 1.0)[-1] == status
    assert written["brake"] == brake


def test_outputs_are_zeroed_when_the_host_is_killed(stage: Stage) -> None:
    written: dict[str, float] = {}
    fallen: list[float] = []

    def write(channel: str, amps: float) -> None:
        if written.get(channel) and amps == 0.0:
            fallen.append(time.monotonic())
        written[channel] = amps

    settings = CouplerSettings(analog=(AnalogOutput("brake", 2.0),))
    server = stage.show(TcpUnits({1: IoCoupler(settings, write=write)}))
    script = Path(__file__).with_name("killed_client.py")
    host = subprocess.Popen([sys.executable, str(script), str(server.port), "5"])
    try:
        assert until(lambda: written.get("brake", 0.0) > 0.49, within=20.0)
    finally:
        host.kill()
        host.wait()
    killed = time.monotonic()
    assert until(lambda: bool(fallen))
    # The last beat was at most one period before the kill (or more, on a busy machine).
    assert fallen[0] - killed < 0.5 + 0.3
    assert written["brake"] == 0.0


def test_watchdog_closes_connections_if_configured(stage: Stage) -> None:
    unit = module({})
    server = stage.show(TcpUnits({1: unit}))
    with socket.create_connection((server.host, server.port), timeout=5.0) as host:
        for k, (address, word) in enumerate(((0x1009, 1), (0x1000, 2), (0x1003, 1))):
            host.sendall(struct.pack(">HHHBBHH", k, 0, 6, 1, 6, address, word))
        received = b""
        while len(received) < 36:
            received += host.recv(36)
        assert until(lambda: not server.connections)
    assert unit.watchdog.status is Status.EXHAUSTED


def test_stuck_outputs_read_back_the_written_values() -> None:
    written: dict[str, float] = {}
    unit = module(written)
    wire(unit, "06 0000 1000", 0.0)
    before = dict(written)
    unit.faults.switch("outputs_stuck")
    wire(unit, "06 0000 7FFF", 0.0)
    assert written == before
    assert wire(unit, "03 0200 0001", 0.0) == bytes.fromhex("03 02 7FFF")


def test_a_drifting_amplifier() -> None:
    unit = StrainAmplifier(lambda: (0.0,), AmplifierSettings(rating=100.0))
    unit.faults.switch("drift")
    unit.advance(1.0)
    unit.advance(3.0)
    assert value(unit, Table.HOLDING, 0x100) == pytest.approx(2.0)
