"""The bench's devices at the loop's interface: the wire of each command, and silent devices."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from rehearsing import CONFIGS, write_yaml

from drivers.errors import CodecError
from rig.config.pydantic_errors import load
from rig.config.wiring import WiringError
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.hardware import devices as bench_devices
from rig.kinds.oswec_bench.hardware.devices import BenchDevices
from rig.kinds.oswec_bench.hardware.job import Loop, build_job
from rig.kinds.oswec_bench.tick.signals import Command, Sense
from rig.processes import mailbox
from rig.processes.messages import Slot
from rig.realtime.tick_memory import FlatMemory, example
from rig.wires import streams
from rig.wires.job import WiredJob
from rig.wires.messages import (
    EncodersMessage,
    ServoMessage,
    WrenchMessage,
    WriteAcknowledgement,
    open_mailboxes,
)

COMMAND = Command(0, 0.0, 2.5, 0.0, 0.0, 1, 0, 30.0, 0.3, 0)


class Bridge:
    """An encoder bridge whose port never has data."""

    open_count, is_open, problem, name = 1, True, "", "encoder bridge"

    def __init__(self) -> None:
        self.message: EncodersMessage | None = EncodersMessage(10, 20, time.monotonic())
        self.closed = False

    def open(self) -> None:
        pass

    def now(self) -> float:
        return time.monotonic()

    def receive(self, *_: Any) -> list[bytes]:
        return []

    def send(self, data: bytes) -> bool:
        return True

    def on_open(self, now: float) -> None:
        pass

    def next_message(self, now: float) -> bytes:
        return b""

    def explain(self, now: float) -> str:
        return "encoder bridge: no frame"

    def close(self) -> None:
        self.closed = True


def job(folder: Path, loop: Loop = "velocity", **servo: Any) -> WiredJob:
    shipped = CONFIGS / "rigs" / "oswec_bench_hil.yaml"
    tree = {"extends": str(shipped), "wiring": {"servo": servo}}
    rig, _ = load(write_yaml(folder / "rig.yaml", tree), BenchRigFile)
    return build_job(rig, loop)


class Rig:
    """Devices on mailboxes, whose other ends the test uses."""

    def __init__(self, bench_job: WiredJob, monkeypatch: pytest.MonkeyPatch) -> None:
        slots = {
            name: Slot(mailbox.create(), fields)
            for process in bench_job.io_processes
            for name, fields in process.mailboxes.items()
        }
        self.slots = open_mailboxes(slots)
        self.bridge = Bridge()
        bridge: Any = self.bridge
        stream = streams.Stream(
            bridge, bridge, lambda now: bridge.message, lambda now: None, lambda now: None
        )
        monkeypatch.setattr(bench_devices.streams, "create_stream", lambda *_: stream)
        config = {**bench_job.devices, "mailboxes": slots}
        self.devices: BenchDevices = bench_devices.connect(config, 0.001)

    def post_values(self, now: float) -> None:
        """Post a message of every device."""
        self.bridge.message = EncodersMessage(10, 20, now)
        self.slots["servo"].post(ServoMessage(1.5, 1, 0, now))
        self.slots["load_cell"].post(WrenchMessage(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, now))
        self.slots["brake"].post((0.25, now))
        self.slots["inputs"].post((0, 1, now))
        self.slots["analog_done"].post(WriteAcknowledgement(now))


def test_a_velocity_command_goes_to_the_analog_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Offset, gain and clamp are those of the wiring: 0.1 + 1.02 x 2.5 V, and 9 V at most."""
    analog = {"offset_v": 0.1, "gain": 1.02, "low_v": -9, "high_v": 9}
    rig = Rig(job(tmp_path, analog=analog), monkeypatch)
    rig.devices.write(COMMAND)
    analog_outputs, set_point = rig.slots["analog"].read(), rig.slots["set_point"].read()
    assert analog_outputs.servo == pytest.approx(0.1 + 1.02 * 2.5)
    assert analog_outputs.brake == 0.3
    assert (set_point.velocity, set_point.torque, set_point.enable) == (0.0, 0.0, 1)
    assert 0.0 <= time.monotonic() - analog_outputs.stamp < 1.0
    rig.devices.write(COMMAND._replace(volts=10.0, brake_current=7.0))
    assert rig.slots["analog"].read()[:2] == (9.0, 1.2)
    rig.devices.write(COMMAND._replace(enable=0))
    assert rig.slots["analog"].read().servo == 0.1  # the voltage of zero velocity
    rig.devices.stop(1)
    assert rig.slots["analog"].read()[:2] == (0.1, 0.0)
    assert rig.slots["set_point"].read()[:3] == (0.0, 0.0, 0)


def test_without_an_analog_output_the_command_goes_to_the_drives_object(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """37.5 rev/s of the motor at 10 V (OSWEC thesis, eq. 3.2)."""
    rig = Rig(job(tmp_path, analog=None), monkeypatch)
    rig.devices.write(COMMAND)
    assert rig.slots["analog"].read().servo == 0.0
    rad_per_s = rig.slots["set_point"].read().velocity
    assert rad_per_s == pytest.approx(0.25 * 37.5 * 2.0 * 3.141592653589793)


def test_a_torque_session_commands_the_drives_torque(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """16.845 N m/A at the output of a 15:1 gearbox: 1.123 at the motor."""
    rig = Rig(job(tmp_path, "torque"), monkeypatch)
    rig.devices.write(COMMAND._replace(mode=1, volts=0.0, current=3.0))
    set_point = rig.slots["set_point"].read()
    assert (set_point.velocity, set_point.enable) == (0.0, 1)
    assert set_point.torque == pytest.approx(3.369)
    assert rig.slots["analog"].read().servo == 0.0


def test_every_value_has_its_age(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(job(tmp_path), monkeypatch)
    now = time.monotonic()
    rig.post_values(now)
    rig.slots["load_cell"].post(WrenchMessage(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, now - 5.0))
    sense = rig.devices.read(0.0)
    assert sense.encoders[:2] == (10, 20)
    assert sense.servo[:3] == (1.5, 1, 0)
    assert sense.load[:6] == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert sense.brake.current == 0.25
    assert sense.panel[:2] == (0, 1)
    for message in (sense.encoders, sense.servo, sense.brake, sense.panel):
        assert 0.0 <= message.age < 2.0
    assert 5.0 <= sense.load.age < 7.0
    rig.slots["analog_done"].post(
        WriteAcknowledgement(now - 3.0)
    )  # its output is no longer written
    assert 3.0 <= rig.devices.read(0.0).brake.age < 5.0
    rig.devices.close()
    assert rig.bridge.closed


def test_every_reading_is_stored_in_any_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No number of an earlier tick is left over."""
    rig = Rig(job(tmp_path), monkeypatch)
    rig.post_values(time.monotonic())
    memory = FlatMemory(sense=example(Sense), command=COMMAND)
    sense = memory.bytes_of("sense")
    sense[:] = bytes(b"\x77" * len(sense))
    rig.devices.use(memory)
    rig.devices.read_in_place(0.0)
    assert 0x7777777777777777 not in sense.cast("q").tolist()
    assert memory.get("sense").encoders[:2] == (10, 20)
    rig.devices.write_in_place()
    assert rig.slots["set_point"].read().enable == COMMAND.enable == 1


def test_silent_devices_are_named_before_the_first_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench_devices, "WARM_UP_TIMEOUT_S", 0.05)
    rig = Rig(job(tmp_path), monkeypatch)
    rig.post_values(time.monotonic() - 10.0)
    rig.slots["brake"].post((0.0, time.monotonic() + 10.0))
    with pytest.raises(
        OSError, match=r"encoders \(.*no frame\), servo, load_cell, inputs, analog_done in"
    ):
        rig.devices.warm_up(0.001)
    assert rig.slots["set_point"].read().enable == 0  # commands at rest were posted


def test_a_rig_without_wires_is_refused_by_name() -> None:
    rig, _ = load(CONFIGS / "rigs" / "oswec_bench.yaml", BenchRigFile)
    with pytest.raises(WiringError, match="no wiring: it can only be rehearsed"):
        build_job(rig)


def test_the_load_cell_may_be_mounted_the_other_way_round() -> None:
    settings: dict[str, Any] = {
        "host": "127.0.0.1", "port": 49152, "model": "net_ft", "rate_hz": 0.0,
        "counts_per_force": 1000.0, "counts_per_torque": 1000.0, "force_unit": "N",
        "torque_unit": "N-m", "quiet_s": 0.05, "silence_s": 0.2, "turned_over": True,
    }  # fmt: skip
    stream = streams.create_stream("load_cell", settings, {})
    assert stream.read_message(1.0) is None
    reader: Any = stream.conversation
    reader._counts, reader._sample_time = (1000.0, 2000.0, 3000.0, 4000.0, 5000.0, 6000.0), 0.9
    assert stream.read_message(1.0)[:6] == (1.0, -2.0, -3.0, 4.0, -5.0, -6.0)
    with pytest.raises(CodecError, match="times"):
        streams.create_stream("load_cell", {**settings, "silence_s": 0.0}, {})
