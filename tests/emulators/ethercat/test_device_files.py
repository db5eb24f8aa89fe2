"""The shipped device files describe the slaves that the emulated segment offers by itself."""

from __future__ import annotations

from pathlib import Path

import pytest
from frame_master import FrameMaster

from rig.config.pydantic_errors import load
from rig.config.segment import Pdo, SlaveDevice

DEVICES = Path(__file__).resolve().parents[3] / "configs" / "devices"
SLAVES = {
    "coupler": "coupler",
    "digital_input": "digital_in:4",
    "digital_output": "digital_out:4",
    "encoder": "encoder:2",
    "analog_input": "analog_in",
    "torque_drive": "torque_drive",
    "position_drive": "position_drive",
}


def test_every_file_is_compared() -> None:
    assert {path.stem for path in DEVICES.glob("*.yaml")} == set(SLAVES)


@pytest.mark.parametrize("name", SLAVES)
def test_identity_and_process_data_agree(name: str) -> None:
    device, _ = load(DEVICES / f"{name}.yaml", SlaveDevice)
    (slave,) = FrameMaster(SLAVES[name]).slaves
    identity = slave.params.information.identity
    assert (device.vendor, device.product) == (identity.vendor, identity.product)
    assert device.mailbox == (slave.mailbox is not None)
    if device.type != "terminal":
        return
    known = slave.objects.values
    for pdo in (*device.outputs, *device.inputs):
        mapped = [known[pdo.pdo, sub] for sub in range(1, known[pdo.pdo, 0] + 1)]
        assert [*entries(pdo)] == mapped, hex(pdo.pdo)
    for setting in device.objects:
        assert (setting.object, setting.sub) in known


def entries(pdo: Pdo) -> list[int]:
    """Return what a mapping object has: index, sub-index, bits of each value."""
    found = []
    for value in pdo.values:
        bits = 1 if value.type == "bit" else int(value.type[1:])
        for at in range(value.count):
            found.append(value.object << 16 | value.sub + at << 8 | bits)
    return found
