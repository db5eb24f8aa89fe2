"""All emulators of a bench in one process, and every fault they list."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from sim_plant.emulators import (
    compax3_drive,
    digital_ft,
    encoder_bridge,
    encoder_words,
    io_coupler,
    link_faults,
    modbus_unit,
    net_ft,
    power_analyser,
    strain_amplifier,
)
from sim_plant.emulators.compax3 import Compax3
from sim_plant.emulators.compax3_drive import DriveInput
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.digital_ft import DigitalFt
from sim_plant.emulators.encoder_bridge import EncoderBridge, ShaftAngles
from sim_plant.emulators.encoder_words import Encoder
from sim_plant.emulators.ft_calibration import Wrench
from sim_plant.emulators.io_coupler import AnalogOutput, CouplerSettings, DigitalInput, IoCoupler
from sim_plant.emulators.modbus_rtu import RtuLine
from sim_plant.emulators.modbus_tcp import TcpUnits
from sim_plant.emulators.net_ft import NetFt, NetFtSettings
from sim_plant.emulators.power_analyser import PowerAnalyser, Terminals
from sim_plant.emulators.running import Emulator, running
from sim_plant.emulators.schedule import precise_loop
from sim_plant.emulators.serial_line import SerialLine, SerialLineSettings
from sim_plant.emulators.strain_amplifier import AmplifierSettings, StrainAmplifier

LISTS = {
    "link": link_faults.FAULTS,
    "modbus unit": modbus_unit.FAULTS,
    "power analyser": power_analyser.FAULTS,
    "strain amplifier": strain_amplifier.FAULTS,
    "coupler": io_coupler.FAULTS,
    "Compax3": compax3_drive.FAULTS,
    "encoder": encoder_words.FAULTS,
    "encoder bridge": encoder_bridge.FAULTS,
    "Digital F/T": digital_ft.FAULTS,
    "Net F/T": net_ft.FAULTS,
}


def line(path: Path, baud: int = 115_200) -> SerialLine:
    return SerialLine(SerialLineSettings(path, baud))


def bench(folder: Path, outputs: dict[str, float]) -> dict[str, Emulator]:
    """A bench whose brake and ±10 V command come from one coupler."""
    coupler = IoCoupler(
        CouplerSettings(
            analog=(AnalogOutput("brake", 2.0), AnalogOutput("command", 10.0, bipolar=1)),
            inputs=(DigitalInput("estop", "estop_pressed", 0),),
        ),
        read=lambda: {"estop": 1},
        write=outputs.__setitem__,
    )
    clock = asyncio.get_running_loop().time
    return {
        "analyser": TcpUnits({1: PowerAnalyser(lambda: Terminals(clock()))}),
        "outputs": TcpUnits({1: coupler}),
        "amplifiers": RtuLine(
            line(folder / "amplifiers"),
            {1: StrainAmplifier(lambda: (1.0,), AmplifierSettings(rating=2000.0))},
        ),
        "drive": Compax3(
            line(folder / "drive"),
            lambda: DriveInput(analog=outputs.get("command", 0.0)),
            outputs.__setitem__,
        ),
        "encoders": EncoderBridge(
            line(folder / "encoders", 460_800),
            lambda: ShaftAngles(clock(), 1.0, 2.0),
            Encoder(),
            Encoder(),
        ),
        "digital load cell": DigitalFt(line(folder / "ft", 1_250_000), Wrench),
        "net load cell": NetFt(Wrench, NetFtSettings(port=0, tcp_port=0, http_port=0)),
    }


def test_a_bench_starts_and_leaves_nothing_behind(tmp_path: Path) -> None:
    outputs: dict[str, float] = {}

    async def start_all() -> dict[str, str]:
        async with running(bench(tmp_path, outputs)) as addresses:
            await asyncio.sleep(0.1)
            names = {path.name for path in tmp_path.iterdir()}
            assert names == {"amplifiers", "drive", "encoders", "ft"}
        assert asyncio.all_tasks() == {asyncio.current_task()}
        return addresses

    loop = precise_loop()
    addresses = loop.run_until_complete(start_all())
    loop.close()
    assert addresses["drive"] == str(tmp_path / "drive")
    assert addresses["outputs"].startswith("127.0.0.1:")
    assert list(tmp_path.iterdir()) == []
    assert outputs["brake"] == outputs["velocity"] == outputs["enabled"] == 0.0


def test_failed_start_closes_the_other_emulators(tmp_path: Path) -> None:
    async def start_all() -> None:
        emulators = bench(tmp_path, {})
        (tmp_path / "ft").write_text("mine")
        async with running(emulators):
            raise AssertionError("not reached")

    loop = precise_loop()
    with pytest.raises(FileExistsError):
        loop.run_until_complete(start_all())
    loop.close()
    assert [path.name for path in tmp_path.iterdir()] == ["ft"]


def test_failing_emulator_is_reported(tmp_path: Path) -> None:
    def broken() -> DriveInput:
        if failures is None:
            return DriveInput()
        raise ZeroDivisionError

    failures: list[object] | None = None

    async def start_all() -> None:
        nonlocal failures
        drive = Compax3(line(tmp_path / "drive"), broken, lambda channel, value: None)
        async with running({"drive": drive}):
            failures = []
            asyncio.get_running_loop().set_exception_handler(
                lambda loop, context: failures.append(context["exception"])
            )
            await asyncio.sleep(0.05)

    loop = precise_loop()
    loop.run_until_complete(start_all())
    loop.close()
    assert [type(failure) for failure in failures or []] == [ZeroDivisionError]


@pytest.mark.parametrize("device", LISTS)
def test_every_fault_has_a_name_and_a_description(device: str) -> None:
    for name, failures in LISTS[device].items():
        assert name == name.lower()
        assert " " not in name
        assert len(failures) > 10, name


def test_faults_are_switched_by_name() -> None:
    faults = DeviceFaults(encoder_words.FAULTS)
    assert faults.descriptions() == encoder_words.FAULTS
    faults.switch("stuck")
    assert (faults.is_on("stuck"), faults.is_on("invalid")) == (True, False)
    faults.clear()
    assert not faults.is_on("stuck")
    with pytest.raises(ValueError, match="gremlins"):
        faults.switch("gremlins")
