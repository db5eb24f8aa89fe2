"""The Modbus emulators against independent clients: pymodbus, and libmodbus by mbpoll."""

from __future__ import annotations

import math
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator

import pytest
from emulator_stage import Stage, until
from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException, ModbusIOException

from sim_plant.emulators.io_coupler import AnalogOutput, CouplerSettings, DigitalInput, IoCoupler
from sim_plant.emulators.link_faults import Severity
from sim_plant.emulators.modbus_rtu import RtuLine
from sim_plant.emulators.modbus_tcp import TcpUnits
from sim_plant.emulators.power_analyser import (
    AnalyserSettings,
    PowerAnalyser,
    Terminals,
    TerminalValues,
)
from sim_plant.emulators.strain_amplifier import AmplifierSettings, StrainAmplifier

MBPOLL = shutil.which("mbpoll")
needs_mbpoll = pytest.mark.skipif(
    MBPOLL is None, reason="mbpoll is not installed: no libmodbus peer (Debian: mbpoll)"
)
FLOATS = ModbusTcpClient.DATATYPE.FLOAT32


def terminals() -> Terminals:
    return Terminals(
        1.0, TerminalValues(310.0, 2.5, -640.0, 0.0), sum=TerminalValues(200.0, 4.0, -700.0, 50.0)
    )


def analyser() -> PowerAnalyser:
    items = (("sum", "P"), ("element_1", "P"), ("element_1", "U"))
    return PowerAnalyser(terminals, AnalyserSettings(update_period=0.05, items=items))


def coupler() -> IoCoupler:
    return IoCoupler(
        CouplerSettings(
            analog=(AnalogOutput("brake", 1.0), AnalogOutput("velocity", 10.0, bipolar=1)),
            inputs=(DigitalInput("estop", "estop_pressed", 0), DigitalInput("end", "end_hit", 1)),
            outputs=("wave_trigger",),
        ),
        read=lambda: {"estop": 1, "end": 0},
    )


@pytest.fixture
def tcp(stage: Stage) -> TcpUnits:
    return stage.show(TcpUnits({1: analyser(), 2: coupler()}))


@pytest.fixture
def client(tcp: TcpUnits) -> Iterator[ModbusTcpClient]:
    with ModbusTcpClient(tcp.host, port=tcp.port, timeout=3.0, retries=0) as client:
        yield client


def two_amplifiers(stage: Stage, **line: object) -> RtuLine:
    units = {
        1: StrainAmplifier(lambda: (101.5, -7.25), AmplifierSettings(rating=2000.0)),
        7: StrainAmplifier(lambda: (5.5,), AmplifierSettings(rating=50.0)),
    }
    return stage.show(RtuLine(stage.line("rs485", **line), units))


def serial_client(line: RtuLine, timeout: float = 1.0) -> ModbusSerialClient:
    port = line.address
    return ModbusSerialClient(
        port, framer=FramerType.RTU, baudrate=115_200, timeout=timeout, retries=0
    )


def floats(client: ModbusTcpClient, registers: list[int]) -> list[float]:
    value = client.convert_from_registers(registers, FLOATS, word_order="big")
    return value if isinstance(value, list) else [value]  # type: ignore[return-value]


def test_items_of_the_analyser(client: ModbusTcpClient, tcp: TcpUnits) -> None:
    def read() -> list[float]:
        return floats(client, client.read_input_registers(2000, count=6, device_id=1).registers)

    assert until(lambda: read() == [-700.0, -640.0, 310.0])
    counters = set()

    def counted() -> bool:
        counters.update(client.read_input_registers(1, count=1, device_id=1).registers)
        return len(counters) > 2

    assert until(counted)
    element = floats(client, client.read_input_registers(100, count=94, device_id=1).registers)
    assert element[:4] == [310.0, 2.5, -640.0, 775.0]
    assert element[5] == pytest.approx(-640.0 / 775.0)
    assert math.isnan(element[46])  # not a quantity of this analyser
    assert floats(client, client.read_input_registers(404, count=2, device_id=1).registers) == [
        -700.0
    ]


def test_missing_registers_are_refused(client: ModbusTcpClient) -> None:
    assert client.read_input_registers(12, count=1, device_id=1).exception_code == 2
    assert client.read_input_registers(190, count=8, device_id=1).exception_code == 2
    assert client.write_register(2000, 1, device_id=1).exception_code == 2
    assert client.write_register(0, 1, device_id=1).isError() is False
    assert client.write_register(0, 9, device_id=1).exception_code == 3
    assert client.write_registers(0, [0, 0], device_id=1).exception_code == 1
    assert client.read_coils(0, count=1, device_id=1).exception_code == 1
    assert client.read_input_registers(0, count=1, device_id=9).exception_code == 11


def test_inputs_and_outputs_of_the_coupler(client: ModbusTcpClient, tcp: TcpUnits) -> None:
    unit = tcp.units[2]
    assert client.read_discrete_inputs(0, count=2, device_id=2).bits[:2] == [True, False]
    unit.faults.switch("estop_pressed")
    unit.faults.switch("end_hit")
    assert client.read_discrete_inputs(0, count=2, device_id=2).bits[:2] == [False, True]
    assert not client.write_registers(0, [0x4000, 0xC000], device_id=2).isError()
    assert client.read_holding_registers(0x200, count=2, device_id=2).registers == [0x4000, 0xC000]
    assert (
        client.write_register(0, 0x8000, device_id=2).exception_code == 3
    )  # unipolar output: negative codes are refused
    assert client.write_register(2, 1, device_id=2).exception_code == 2
    assert not client.write_coil(0, True, device_id=2).isError()
    assert client.read_coils(0x200, count=1, device_id=2).bits[0] is True


def test_two_units_on_one_line_and_none_on_the_third(stage: Stage) -> None:
    line = two_amplifiers(stage, baud=19_200)
    with serial_client(line) as client:
        assert floats(
            client, client.read_holding_registers(0x100, count=4, device_id=1).registers
        ) == [101.5, -7.25]
        assert client.read_holding_registers(0x300, count=2, device_id=7).registers == [0, 5500]
        assert client.read_holding_registers(0x50, count=2, device_id=7).exception_code == 2
        assert client.write_register(0x100, 1, device_id=7).exception_code == 2
    with serial_client(line, timeout=0.2) as client:
        with pytest.raises(ModbusIOException):
            client.read_holding_registers(0x100, count=2, device_id=3)
        assert floats(
            client, client.read_holding_registers(0x100, count=2, device_id=7).registers
        ) == [5.5]


def test_late_answer_shifts_the_answers_of_a_simple_client(stage: Stage) -> None:
    """RTU has no transaction number, so hosts need a guard against late answers."""
    line = two_amplifiers(stage)
    line.units[1].late_by = 0.25
    line.units[1].faults.switch("late_answers")
    with serial_client(line, timeout=0.1) as client:
        with pytest.raises(ModbusIOException):
            client.read_holding_registers(0x100, count=2, device_id=1)
        line.units[1].faults.clear()
        assert until(lambda: client.socket.in_waiting >= 9)  # type: ignore[union-attr]


def test_line_noise_only_affects_requests_during_it(stage: Stage) -> None:
    line = two_amplifiers(stage)
    with serial_client(line, timeout=0.1) as client:
        line.link.switch("corrupt")
        lost = 0
        for _ in range(8):
            try:
                client.read_holding_registers(0x100, count=2, device_id=1)
            except ModbusException:
                lost += 1
        struck = line.link.counts()
        assert struck.get("device.corrupt", 0) + struck.get("host.corrupt", 0) >= lost
        line.link.clear()

        def reads() -> bool:
            try:
                response = client.read_holding_registers(0x100, count=2, device_id=1)
            except ModbusException:
                return False
            return not response.isError() and floats(client, response.registers) == [101.5]

        assert until(reads)


def test_cut_connection_returns_on_the_same_port(client: ModbusTcpClient, tcp: TcpUnits) -> None:
    tcp.link.switch("disconnect")
    assert until(lambda: not tcp.connections)
    with pytest.raises((ModbusException, OSError)):
        client.read_input_registers(0, count=1, device_id=1)
    tcp.link.clear()

    def back() -> bool:
        try:
            return not client.read_input_registers(0, count=1, device_id=1).isError()
        except (ModbusException, OSError):
            return False

    assert until(back)


def test_frozen_and_delayed_answers(client: ModbusTcpClient, tcp: TcpUnits) -> None:
    tcp.link.switch("freeze", toward="host")
    client.comm_params.timeout_connect = 0.1
    with pytest.raises(ModbusException):
        client.read_input_registers(0, count=1, device_id=1)
    tcp.link.clear()
    tcp.link.set_severity(Severity(delay=0.2), toward="device")
    tcp.link.switch("delay", toward="device")
    client.comm_params.timeout_connect = 3.0
    start = time.monotonic()
    assert not client.read_input_registers(0, count=1, device_id=1).isError()
    assert time.monotonic() - start >= 0.2


def test_invalid_header_ends_only_its_connection(client: ModbusTcpClient, tcp: TcpUnits) -> None:
    with socket.create_connection((tcp.host, tcp.port), timeout=3.0) as other:
        other.sendall(b"GET / HTTP/1.1\r\n\r\n")
        assert until(lambda: tcp.bad_headers == 1)
    assert not client.read_input_registers(0, count=1, device_id=1).isError()


def mbpoll(*arguments: str) -> str:
    assert MBPOLL is not None
    done = subprocess.run(
        [MBPOLL, *arguments, "-1", "-0", "-q"],
        capture_output=True,
        text=True,
        timeout=20,
        check=False,
    )
    return done.stdout + done.stderr


@needs_mbpoll
def test_libmodbus_reads_and_writes_over_tcp(tcp: TcpUnits) -> None:
    to = ("-m", "tcp", "-p", str(tcp.port), "-o", "5", tcp.host)
    assert until(lambda: "-700" in mbpoll("-a", "1", "-t", "3:float", "-B", "-r", "2000", *to))
    assert "Written 1 references" in mbpoll("-a", "2", "-t", "4", "-r", "0", *to, "1000")
    assert "1000" in mbpoll("-a", "2", "-t", "4", "-r", "512", *to)
    assert "Illegal data address" in mbpoll("-a", "1", "-t", "3", "-r", "50", *to)
    assert "[0]: \t1\n" in mbpoll("-a", "2", "-t", "1", "-r", "0", *to)


@needs_mbpoll
def test_libmodbus_reads_over_the_line(stage: Stage) -> None:
    line = two_amplifiers(stage)
    to = ("-m", "rtu", "-b", "115200", "-P", "none", "-o", "5", line.address)
    assert "101.5" in mbpoll("-a", "1", "-t", "4:float", "-B", "-r", "256", *to)
    assert "5500" in mbpoll("-a", "7", "-t", "4:int", "-B", "-r", "768", *to)
    assert "Illegal data address" in mbpoll("-a", "7", "-t", "4", "-r", "80", *to)
