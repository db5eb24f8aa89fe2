"""The bench's devices at the loop's seam: which wire carries what, and what silence looks like."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from rehearsing import CONFIGS, yaml_file

from drivers.errors import CodecError
from rig.config import load
from rig.config.bench_rig_file import BenchRigFile
from rig.execution.hardware import bench_devices, streams
from rig.execution.hardware.bench_devices import BenchDevices
from rig.execution.hardware.bench_job import Job, Loop, job_of_bench
from rig.execution.hardware.job import WiringError
from rig.execution.hardware.messages import SLOTS, BrakeCurrent, Done, Encoders, Inputs, Load, Servo
from rig.kinds.oswec_bench import Command
from rig.processes import mailbox
from rig.processes.mailbox import Mailbox

NAMES = ("servo", "set_point", "load_cell", "brake", "inputs", "analog", "analog_done")
AT_WORK = Command(0, 0.0, 2.5, 0.0, 0.0, 1, 0, 30.0, 0.3, 0)


class Bridge:
    """An encoder bridge whose port is a list of nothing."""

    opens, is_open, trouble, name = 1, True, "", "encoder bridge"

    def __init__(self) -> None:
        self.word: Encoders | None = Encoders(10, 20, time.monotonic())
        self.closed = False

    def open(self) -> None:
        pass

    def now(self) -> float:
        return time.monotonic()

    def take(self, *_: Any) -> list[bytes]:
        return []

    def send(self, data: bytes) -> bool:
        return True

    def opened(self, now: float) -> None:
        pass

    def speak(self, now: float) -> bytes:
        return b""

    def explain(self, now: float) -> str:
        return "encoder bridge: no frame"

    def close(self) -> None:
        self.closed = True


def job(folder: Path, loop: Loop = "velocity", **servo: Any) -> Job:
    shipped = CONFIGS / "rigs" / "oswec_bench_hil.yaml"
    tree = {"extends": str(shipped), "wiring": {"servo": servo}}
    rig, _ = load(yaml_file(folder / "rig.yaml", tree), BenchRigFile)
    return job_of_bench(rig, loop)


class Rig:
    """Devices on mailboxes that a test holds the other ends of."""

    def __init__(self, made: Job, monkeypatch: pytest.MonkeyPatch) -> None:
        fds = {name: mailbox.create() for name in NAMES}
        self.slots = {name: Mailbox(fd, SLOTS[name]) for name, fd in fds.items()}
        self.bridge = Bridge()
        bridge: Any = self.bridge
        stream = streams.Stream(
            bridge, bridge, lambda now: bridge.word, lambda now: None, lambda now: None
        )
        monkeypatch.setattr(bench_devices.streams, "made", lambda *_: stream)
        config = {**made.devices, "mailboxes": fds}
        self.devices: BenchDevices = bench_devices.connect(config, 0.001)

    def say(self, now: float) -> None:
        """Every device says something now."""
        self.bridge.word = Encoders(10, 20, now)
        self.slots["servo"].post(Servo(1.5, 1, 0, now))
        self.slots["load_cell"].post(Load(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, now))
        self.slots["brake"].post(BrakeCurrent(0.25, now))
        self.slots["inputs"].post(Inputs(0, 1, now))
        self.slots["analog_done"].post(Done(now))


def test_a_velocity_command_leaves_through_the_analog_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Offset, gain and clamp are the wiring's: 0.1 + 1.02 x 2.5 V, and 9 V at most."""
    analog = {"offset_v": 0.1, "gain": 1.02, "low_v": -9, "high_v": 9}
    rig = Rig(job(tmp_path, analog=analog), monkeypatch)
    rig.devices.write(AT_WORK)
    told, wanted = rig.slots["analog"].read(), rig.slots["set_point"].read()
    assert told.servo == pytest.approx(0.1 + 1.02 * 2.5)
    assert told.brake == 0.3
    assert (wanted.velocity, wanted.torque, wanted.enable) == (0.0, 0.0, 1)
    assert 0.0 <= time.monotonic() - told.stamp < 1.0
    rig.devices.write(AT_WORK._replace(volts=10.0, brake_current=7.0))
    assert rig.slots["analog"].read()[:2] == (9.0, 1.2)
    rig.devices.write(AT_WORK._replace(enable=0))
    assert rig.slots["analog"].read().servo == 0.1  # what commands nothing
    rig.devices.stop(1)
    assert rig.slots["analog"].read()[:2] == (0.1, 0.0)
    assert rig.slots["set_point"].read()[:3] == (0.0, 0.0, 0)


def test_without_an_analog_output_it_leaves_through_the_drives_object(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """37.5 rev/s of the motor at 10 V (OSWEC thesis, eq. 3.2)."""
    rig = Rig(job(tmp_path, analog=None), monkeypatch)
    rig.devices.write(AT_WORK)
    assert rig.slots["analog"].read().servo == 0.0
    rad_per_s = rig.slots["set_point"].read().velocity
    assert rad_per_s == pytest.approx(0.25 * 37.5 * 2.0 * 3.141592653589793)


def test_a_torque_session_commands_the_drives_torque(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """16.845 N m/A at the output of a 15:1 gearbox: 1.123 at the motor."""
    rig = Rig(job(tmp_path, "torque"), monkeypatch)
    rig.devices.write(AT_WORK._replace(mode=1, volts=0.0, current=3.0))
    wanted = rig.slots["set_point"].read()
    assert (wanted.velocity, wanted.enable) == (0.0, 1)
    assert wanted.torque == pytest.approx(3.369)
    assert rig.slots["analog"].read().servo == 0.0


def test_every_value_comes_with_its_age(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(job(tmp_path), monkeypatch)
    now = time.monotonic()
    rig.say(now)
    rig.slots["load_cell"].post(Load(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, now - 5.0))
    sense = rig.devices.read(0.0)
    assert sense.encoders[:2] == (10, 20)
    assert sense.servo[:3] == (1.5, 1, 0)
    assert sense.load[:6] == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert sense.brake.current == 0.25
    assert sense.panel[:2] == (0, 1)
    for word in (sense.encoders, sense.servo, sense.brake, sense.panel):
        assert 0.0 <= word.age < 2.0
    assert 5.0 <= sense.load.age < 7.0
    rig.slots["analog_done"].post(Done(now - 3.0))  # its output is no longer written
    assert 3.0 <= rig.devices.read(0.0).brake.age < 5.0
    rig.devices.close()
    assert rig.bridge.closed


def test_what_says_nothing_is_named_before_the_first_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench_devices, "WARM_UP", 0.05)
    rig = Rig(job(tmp_path), monkeypatch)
    rig.say(time.monotonic() - 10.0)
    rig.slots["brake"].post(BrakeCurrent(0.0, time.monotonic() + 10.0))
    with pytest.raises(
        OSError, match=r"encoders \(.*no frame\), servo, load_cell, inputs, analog_done in"
    ):
        rig.devices.warm_up(0.001)
    assert rig.slots["set_point"].read().enable == 0  # it was given its rest


def test_a_rig_without_wires_is_refused_by_name() -> None:
    rig, _ = load(CONFIGS / "rigs" / "oswec_bench.yaml", BenchRigFile)
    with pytest.raises(WiringError, match="no wiring: it can only be rehearsed"):
        job_of_bench(rig)


def test_the_load_cell_may_be_mounted_the_other_way_round() -> None:
    told: dict[str, Any] = {
        "host": "127.0.0.1", "port": 49152, "model": "net_ft", "rate_hz": 0.0,
        "counts_per_force": 1000.0, "counts_per_torque": 1000.0, "force_unit": "N",
        "torque_unit": "N-m", "quiet_s": 0.05, "silence_s": 0.2, "turned_over": True,
    }  # fmt: skip
    stream = streams.made("load_cell", told, {})
    assert stream.tell(1.0) is None
    talk: Any = stream.talk
    talk._counts, talk._sampled = (1000.0, 2000.0, 3000.0, 4000.0, 5000.0, 6000.0), 0.9
    assert stream.tell(1.0)[:6] == (1.0, -2.0, -3.0, 4.0, -5.0, -6.0)
    with pytest.raises(CodecError, match="times"):
        streams.made("load_cell", {**told, "silence_s": 0.0}, {})
