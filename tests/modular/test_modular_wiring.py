"""The wiring of a modular rig: every inconsistency is a problem with file, line, key and value."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from wired_rigs import SENSORS, UNUSED_INPUT, write_files

from rig.config.problems import ConfigError, Problem
from rig.config.pydantic_errors import load
from rig.config.wiring import WiringError
from rig.kinds.modular.config import RigFile
from rig.kinds.modular.hardware.job import build_job

DELETE = object()
METER = ("wiring", "registers", "meter")


@pytest.fixture(name="folder", scope="module")
def of_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wired")
    write_files(folder)
    return folder


def problems(folder: Path, *edits: tuple[tuple[Any, ...], Any]) -> tuple[list[Problem], list[str]]:
    """Return the problems of the rig file with edits of keys, and the lines of the file."""
    with (folder / "rig.yaml").open() as stream:
        tree = YAML(typ="safe").load(stream)
    for (*outer, last), value in edits:
        branch = tree
        for key in outer:
            branch = branch[key]
        if value is DELETE:
            del branch[last]
        else:
            branch[last] = copy.deepcopy(value)
    path = folder / "edited.yaml"
    with path.open("w") as stream:
        YAML().dump(tree, stream)
    try:
        load(path, RigFile)
    except ConfigError as error:
        return list(error.problems), path.read_text().splitlines()
    return [], []


def test_the_files_are_valid(folder: Path) -> None:
    assert problems(folder) == ([], [])
    named = ("sensors", "spare"), UNUSED_INPUT  # an input without a sensor may get one
    assert problems(folder, named) == ([], [])


# In the test of several problems.
FREE = "pitch.analog_1, heave.analog_1, meter.dc, cell.fx, cell.fy, cell.fz, cell.tx, cell.ty"


@pytest.mark.parametrize(
    ("path", "value", "key", "line", "message"),
    [
        (("sensors", "dc_power", "source"), "meter.ac", "sensors.dc_power.source",
         "source: meter.ac", "meter.ac is no value of the wiring; allowed heave.analog_1, "),
        (("sensors", "dc_power", "source"), "meter.angle", "sensors.angle.source",
         "source: meter.angle", "meter.angle is the source of dc_power already; allowed heave.an"),
        (("sensors", "dc_power", "source"), "inputs.e_stop", "sensors.dc_power.source",
         "source: inputs.e_stop", "inputs.e_stop is no value of the wiring"),
        (("sensors", "height", "source"), DELETE, "sensors.height", "height:",
         "has no source, which a rig with wiring needs; allowed heave.analog_1, meter.height"),
        (("sensors", "height"), DELETE, "wiring.registers.meter.values[2]", "name: height",
         "no sensor has the source meter.height: add one, or remove this"),
        (("sensors", "pitch_torque"), DELETE, "wiring.load_cells.cell", "cell:",
         "no sensor has the source cell.fx"),
        (("sensors", "pto_force"), DELETE, "wiring.axes.heave.analog_per_v[1]", "- 100.0",
         "no sensor has the source heave.analog_2"),
        (("wiring", "axes", "pitch", "analog_per_v"), [0.0], "wiring.axes.pitch.analog_per_v[0]",
         "- 0.0", "0 gives no value"),
        (("wiring", "axes", "pitch", "node"), 5, "wiring.axes.heave.node", "node: 5",
         "5 is the number of axes.pitch.node, too; two nodes need two numbers"),
        (("wiring", "axes", "pitch", "objects", "encoder_increments"), 2000,
         "wiring.axes.pitch.objects.encoder_increments", "encoder_increments: 2000",
         "gives 2000 increments per revolution of the motor; allowed at least the "
         "counts_per_revolution of axes.pitch, "),
        (("wiring", "can", "own_node"), 6, "wiring.can.own_node", "own_node: 6",
         "6 is the number of axes.pitch.node, too"),
        (("wiring", "axes", "pitch"), DELETE, "wiring.axes", "axes:",
         "the axis pitch has no drive here"),
        (("wiring", "axes", "heave", "objects", "feed"), 20000,
         "wiring.axes.heave.objects.feed", "feed: 20000",
         "give 20000 counts per revolution of the motor; allowed 1048576, as axes.heave has"),
        (("wiring", "inputs"), DELETE, "wiring.inputs", "wiring:", "missing"),
        (("wiring", "inputs", "values", 0, "name"), "stop", "wiring.inputs.values", "values:",
         "must be e_stop, limit_switch in this order"),
        (("wiring", "outputs", "line"), "oi", "wiring.outputs.line", "line: oi",
         "no such line; there are meter, io"),
        ((*METER, "line"), "metre", "wiring.registers.meter.line", "line: metre",
         "no such line; there are meter, io"),
        ((*METER, "values", 0, "name"), "stamp", "wiring.registers.meter.values[0].name",
         "name: stamp", "this name is the time of every message; allowed any other"),
        ((*METER, "values", 1, "name"), "dc", "wiring.registers.meter.values[1].name",
         "name: dc", "dc is the name of an earlier value; allowed any other"),
        ((*METER, "values", 0, "name"), "DC", "wiring.registers.meter.values[0].name",
         "name: DC", "no name of a signal; allowed [a-z][a-z0-9_]*"),
        ((*METER, "values", 1, "at"), 7, "wiring.registers.meter.values[1].at", "at: 7",
         "7 is beyond the block: i32 takes 2 of its size = 8; allowed at + 2 <= size"),
        ((*METER, "values", 2, "kind"), "bit", "wiring.registers.meter.values[2].kind",
         "kind: bit", "bit is not in a table input; allowed u16, i16, u32, i32, f32"),
        ((*METER, "size"), 126, "wiring.registers.meter.size", "size: 126",
         "126 cannot be read at once; allowed up to 125"),
        ((*METER, "first"), 65530, "wiring.registers.meter.first", "first: 65530",
         "65530 + size = 8 is beyond the last address, 65535"),
        (("wiring", "load_cells", "cell", "force_unit"), "oz",
         "wiring.load_cells.cell.force_unit", "force_unit: oz", "'oz' is not known; allowed lbf"),
        (("wiring", "axes", "heave", "scaling"), "volts", "wiring.axes.heave.scaling",
         "scaling: volts", "'volts' is not known; allowed amc, rated_torque, rated_current"),
    ],
)  # fmt: skip
def test_an_inconsistency_is_named(
    path: tuple[Any, ...], value: Any, key: str, line: str, message: str, folder: Path
) -> None:
    found, lines = problems(folder, (path, value))
    matching = [each for each in found if each.key == key]
    assert matching, [(each.key, each.message) for each in found]
    assert message in matching[0].message
    assert line in lines[matching[0].line - 1]
    assert matching[0].file.endswith("edited.yaml")


@pytest.mark.parametrize(
    ("field", "name", "message"),
    [
        ("registers", "heave", "this name is one of the axes; allowed any other"),
        ("registers", "heave_health", "this name is of the drive of heave; allowed any other"),
        ("registers", "inputs", "this name is of every rig; allowed any other"),
        ("load_cells", "meter", "this name is one of the registers; allowed any other"),
        ("registers", "class", "no name of a signal"),
    ],
)
def test_a_name_that_is_taken_is_refused(field: str, name: str, message: str, folder: Path) -> None:
    with (folder / "rig.yaml").open() as stream:
        part = next(iter(YAML(typ="safe").load(stream)["wiring"][field].values()))
    found, lines = problems(folder, (("wiring", field, name), part))
    (problem,) = (each for each in found if each.key == f"wiring.{field}.{name}")
    assert message in problem.message
    assert f"{name}:" in lines[problem.line - 1]


def test_all_inconsistencies_are_reported_at_once(folder: Path) -> None:
    found, _ = problems(
        folder,
        (("sensors", "dc_power", "source"), "meter.angle"),
        (("sensors", "elevation", "source"), DELETE),
        (("wiring", "axes", "heave", "objects", "feed"), 20000),
    )
    assert {each.key for each in found} == {
        "sensors.angle.source",
        "sensors.elevation",
        "wiring.axes.heave.objects.feed",
        "wiring.axes.pitch.analog_per_v[0]",
        "wiring.registers.meter.values[0]",
    }
    free = next(each.message for each in found if each.key == "sensors.elevation")
    assert free.endswith(f"allowed {FREE}")


def test_a_rig_without_wiring_may_name_sources_and_cannot_be_wired(folder: Path) -> None:
    assert problems(folder, (("wiring",), DELETE)) == ([], [])
    rig, _ = load(folder / "edited.yaml", RigFile)
    assert rig.sensors["dc_power"].source == "meter.dc"
    with pytest.raises(WiringError, match="float on wires has no wiring: it can only be rehearsed"):
        build_job(rig)


def test_the_job_follows_from_the_wiring(folder: Path) -> None:
    rig, _ = load(folder / "rig.yaml", RigFile)
    job = build_job(rig)
    names = {process.name: set(process.mailboxes) for process in job.io_processes}
    assert names == {
        "can": {"heave_health", "pitch_health"},
        "cell": {"cell"},
        "line meter": {"meter"},
        "line io": {"inputs", "outputs", "outputs_done"},
    }
    assert [each[0] for each in job.devices["sensors"]] == list(SENSORS)
    assert job.devices["sensors"][0] == ["pto_force", "heave", 1, 10.0, 3.0]
    assert job.devices["sensors"][-1] == ["pitch_torque", "cell", 5, 1.0, 0.0]
    (meter,) = (each for each in job.io_processes if each.name == "line meter")
    # The unit of a value is known where the sensor neither scales nor shifts it.
    assert dict(meter.mailboxes["meter"]) == {"dc": "W", "angle": "1", "height": "m", "stamp": "s"}
