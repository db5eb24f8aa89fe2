"""The Digital F/T: start, stream, stop, calibration, and a decoder written from the manual."""

from __future__ import annotations

import struct
import time
from pathlib import Path

import numpy as np
import pytest
import serial
from emulator_stage import Stage, until
from pymodbus.client import ModbusSerialClient

from sim_plant.emulators.digital_ft import DigitalFt, DigitalFtSettings, encode_sample
from sim_plant.emulators.ft_calibration import Calibration, Gages, Wrench, calibration_registers
from sim_plant.emulators.serial_line import SerialLine, SerialLineSettings

START = bytes.fromhex("0A 46 55 A3 9D")  # ATI 9610-05-1030
LOAD = Wrench(120.0, -45.0, 300.0, 4.0, -7.5, 11.0)


def device(wrench: Wrench = LOAD, line: SerialLine | None = None, **settings: object) -> DigitalFt:
    sensor = DigitalFtSettings(**settings)  # type: ignore[arg-type]
    line = line or SerialLine(SerialLineSettings(Path("/nowhere/ft"), 1_250_000))
    return DigitalFt(line, lambda: wrench, sensor)


def gages(data: bytes) -> list[int]:
    """Undo the order of the manual: G0 G2 G4 G1 G3 G5."""
    g0, g2, g4, g1, g3, g5 = struct.unpack(">6h", data[:12])
    return [g0, g1, g2, g3, g4, g5]


def test_a_sample_bit_by_bit() -> None:
    sensor = encode_sample([1, 2, 3, 4, 5, -1], error=False)
    assert sensor.hex(" ") == "00 01 00 03 00 05 00 02 00 04 ff ff 0d"  # sum 0x20d, its low 7 bits
    assert encode_sample([1, 2, 3, 4, 5, -1], error=True)[12] == 0x8D


def test_calibration_registers_convert_samples_back_to_the_load() -> None:
    """F = M (g - bias) / counts per unit, with M read from the registers."""
    calibration = Calibration()
    data = struct.pack(">169H", *calibration_registers(calibration))
    assert data[:8].rstrip(b"\0") == b"FT00000"
    assert data[8:40].rstrip(b"\0") == b"SI-700-30"
    matrix = np.array(struct.unpack(">36f", data[64:208])).reshape(6, 6)
    per_force, per_torque = struct.unpack(">ii", data[234:242])
    gage_counts = gages(device().samples(1))
    counts = matrix @ (np.array(gage_counts) - np.array(calibration.bias))
    computed = counts / np.array([per_force] * 3 + [per_torque] * 3)
    # half a count of every gage, at most
    allowed = 0.5 * np.abs(matrix).sum(axis=1) / np.array([per_force] * 3 + [per_torque] * 3)
    assert np.all(np.abs(computed - np.array(LOAD)) <= allowed)
    assert np.all(allowed < [0.05, 0.05, 0.1, 0.003, 0.003, 0.003])


def test_a_load_beyond_the_gages_saturates() -> None:
    counts, saturated = Gages(Calibration()).read(Wrench(fz=1.0e5))
    assert saturated
    assert max(map(abs, counts)) >= 32767
    assert device(Wrench(fz=float("nan"))).samples(1)[12] & 0x80


@pytest.mark.parametrize(
    ("fault", "values", "error", "right_sum"),
    [
        ("saturated", [32767] * 6, True, True),
        ("status_error", None, True, True),
        ("wrong_sum", None, False, False),
    ],
)
def test_faults_of_samples(
    fault: str, values: list[int] | None, error: bool, right_sum: bool
) -> None:
    sensor = device()
    healthy = gages(sensor.samples(1))
    sensor.faults.switch(fault)
    data = sensor.samples(1)
    assert gages(data) == (values or healthy)
    assert bool(data[12] & 0x80) is error
    assert (sum(data[:12]) & 0x7F == data[12] & 0x7F) is right_sum


def test_a_dead_gage_and_a_frozen_sensor() -> None:
    loads = [LOAD, Wrench(fz=9.0)]
    sensor = DigitalFt(SerialLine(SerialLineSettings(Path("/nowhere/ft"), 1)), lambda: loads.pop(0))
    first = sensor.samples(1)
    sensor.faults.switch("frozen_values")
    assert sensor.samples(1) == first
    sensor.faults.switch("gage_dead")
    assert gages(sensor.samples(1))[3] == -32768


def find_sample_start(data: bytes) -> int | None:
    """Return the offset at which three consecutive samples have the right sum."""
    for place in range(13):
        three = [data[place + 13 * k : place + 13 * k + 13] for k in range(3)]
        if all(len(s) == 13 and sum(s[:12]) & 0x7F == s[12] & 0x7F for s in three):
            return place
    return None


def test_stream_and_stop_bytes_on_the_line(stage: Stage) -> None:
    line = stage.line("ft", baud=1_250_000, bits_per_byte=11)
    sensor = stage.show(device(line=line, rate=2000.0))
    with serial.Serial(sensor.address, 1_250_000, parity="E", timeout=5.0) as port:
        port.write(START)
        data = port.read(13 * 200)
        assert data[:3] == bytes.fromhex("0A 46 01")
        assert gages(data[5:18]) == gages(sensor.samples(1))
        begin = find_sample_start(data[100:])
        assert begin is not None
        first = 100 + begin
        assert all(
            data[k : k + 13] == data[first : first + 13] for k in range(first, len(data) - 13, 13)
        )
        port.write(bytes(10))  # too few bytes to stop the stream
        assert len(port.read(13 * 50)) == 13 * 50
        port.write(bytes(10))
        assert until(lambda: not sensor.streaming)
        time.sleep(0.1)
        port.reset_input_buffer()
        port.write(START)
        assert port.read(3) == bytes.fromhex("0A 46 01")


def test_registers_by_an_independent_client(stage: Stage) -> None:
    sensor = stage.show(device(line=stage.line("ft", baud=1_250_000, bits_per_byte=11)))
    with ModbusSerialClient(sensor.address, baudrate=1_250_000, timeout=3.0, retries=0) as client:
        first = client.read_holding_registers(0xE3, count=125, device_id=10).registers
        rest = client.read_holding_registers(0xE3 + 125, count=44, device_id=10).registers
        assert first + rest == calibration_registers(Calibration())
        assert client.read_holding_registers(6, count=6, device_id=10).registers == [32768] * 6
        assert client.read_input_registers(0x27, count=6, device_id=10).registers == [0] * 6
        assert client.write_registers(0, [600], device_id=10).exception_code == 4  # locked
        assert client.write_registers(0xE3, [0], device_id=10).exception_code == 2
    with serial.Serial(sensor.address, timeout=3.0) as port:
        port.write(bytes.fromhex("0A 6A AA FF 1D"))
        assert port.read(3) == bytes.fromhex("0A 6A 01")
    with ModbusSerialClient(sensor.address, baudrate=1_250_000, timeout=3.0, retries=0) as client:
        assert not client.write_registers(0, [600], device_id=10).isError()


def test_stream_faults(stage: Stage) -> None:
    line = stage.line("ft", baud=1_250_000, bits_per_byte=11)
    sensor = stage.show(device(line=line, rate=1000.0))
    with serial.Serial(sensor.address, 1_250_000, timeout=5.0) as port:
        port.write(START)
        assert len(port.read(130)) == 130
        sensor.faults.switch("deaf_to_jam")
        port.write(bytes(14))
        assert len(port.read(1300)) == 1300
        sensor.faults.switch("stream_stops")
        time.sleep(0.05)
        port.reset_input_buffer()
        time.sleep(0.05)
        assert port.in_waiting == 0
