"""Emulated units of a modular rig: registers where the rig file has them, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from wired_rigs import write_files

from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load
from rig.config.wiring import WiringError
from rig.config.yaml_source import load_mapping
from rig.kinds.modular.config import RigFile
from rig.kinds.modular.rehearsal.emulation import _modbus_units, emulate_rig
from rig.kinds.modular.tasks import examine, wired_mode
from sim_plant.emulators.io_coupler import IoCoupler
from sim_plant.emulators.modbus_pdu import Table
from sim_plant.emulators.register_map import RegisterMapUnit


class World:
    """A world that only stores its command."""

    def __init__(self) -> None:
        self.wave_trigger = -1

    def actuate(self, wave_trigger: int) -> None:
        self.wave_trigger = wave_trigger


def edited(folder: Path, **wiring: Any) -> RigFile:
    """Return the wired rig with changed keys of its wiring; None removes a key."""
    write_files(folder)
    with (folder / "rig.yaml").open() as stream:
        tree = YAML(typ="safe").load(stream)
    for key, value in wiring.items():
        if value is None:
            del tree["wiring"][key]
        else:
            tree["wiring"][key].update(value)
    with (folder / "rig.yaml").open("w") as stream:
        YAML().dump(tree, stream)
    return load(folder / "rig.yaml", RigFile)[0]


def test_bits_alone_are_a_coupler_with_the_channels_where_the_file_has_them(tmp_path: Path) -> None:
    rig, world = edited(tmp_path), World()
    assert rig.wiring is not None
    units = _modbus_units(rig.wiring, world, {"meter.dc": lambda: -2.5})  # type: ignore[arg-type]
    io = units["inputs"]
    assert isinstance(io, IoCoupler)
    assert units["outputs"] is io
    io.faults.switch("limit_switch_on", True)
    io.advance(1.0)
    assert io.read(Table.DISCRETE_INPUTS, 0, 4) == [0, 0, 0, 1]
    io.write(Table.COILS, 0, [1])
    assert world.wave_trigger == 1
    meter = units["meter"]
    meter.advance(1.0)
    assert isinstance(meter, RegisterMapUnit)
    assert meter.read(Table.INPUT, 0, 3) == [0x0000, 0xC020, 0]  # low word first, then a gap


def test_a_controller_with_everything_is_one_unit(tmp_path: Path) -> None:
    names = ("e_stop", "limit_switch")
    panel = [{"name": name, "at": at, "kind": "u16"} for at, name in enumerate(names)]
    place = {"line": "meter", "table": "holding", "word_order": "low first"}
    trigger = [{"name": "wave_trigger", "at": 0, "kind": "u16"}]
    prepare = [{"first": 0x100, "value": 5}, {"first": 0x101, "value": 7, "write": False}]
    rig = edited(
        tmp_path,
        inputs=place | {"first": 20, "size": 2, "values": panel},
        outputs=place | {"first": 30, "values": trigger, "prepare": prepare},
    )
    world = World()
    assert rig.wiring is not None
    units = _modbus_units(rig.wiring, world, {})  # type: ignore[arg-type]
    unit = units["meter"]
    assert isinstance(unit, RegisterMapUnit)
    assert units["inputs"] is units["outputs"] is unit
    unit.faults.switch("e_stop_on", True)
    unit.advance(1.0)
    assert unit.read(Table.HOLDING, 20, 2) == [1, 0]
    unit.write(Table.HOLDING, 30, [1])
    assert world.wave_trigger == 1
    assert unit.read(Table.HOLDING, 0x101, 1) == [7]  # a status that is not written


def test_one_unit_has_one_word_order(tmp_path: Path) -> None:
    rig = edited(tmp_path, inputs={"line": "meter"})
    assert rig.wiring is not None
    with pytest.raises(OSError, match="line meter, unit 1: an emulated unit has only one word_or"):
        _modbus_units(rig.wiring, World(), {})  # type: ignore[arg-type]


def test_emulated_waves_need_the_trigger_output(tmp_path: Path) -> None:
    edited(tmp_path, outputs=None)
    report = examine(tmp_path / "campaign.yaml")
    assert report.campaign is not None, report.text()
    with pytest.raises(WiringError, match=r"no wiring.outputs, so its emulated wave maker could"):
        wired_mode(report.campaign, emulated=True)
    assert wired_mode(report.campaign, emulated=False).name == "hardware"  # waves made by hand


def test_devices_of_a_rig_alone_need_a_plant_that_has_its_parts(tmp_path: Path) -> None:
    rig = edited(tmp_path)
    plant, locate = load_mapping(tmp_path / "plant.yaml")
    process, setting = emulate_rig(rig, plant, locate)
    assert setting == "calm water"
    assert process.config["plant"]["plant"]["delay_s"] == 0.0  # wires have a delay of their own
    del plant["sensors"]["height"]
    with pytest.raises(ConfigError, match="is not in the simulated plant's sensors"):
        emulate_rig(rig, plant, locate)
