"""The warm-up of the wires, which lasts until every node answers every SYNC."""

from __future__ import annotations

import math
import struct
import time
from collections import namedtuple
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from drivers.canopen.bus_cycle import SYNC
from drivers.canopen.link import Frame
from drivers.cia402.scaling import CurrentScale
from rig.config.pydantic_errors import load
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.hardware.devices import WaveBotDevices
from rig.kinds.wavebot.hardware.job import build_job
from rig.kinds.wavebot.tick import Command, Sense
from rig.processes import handover
from rig.realtime.tick_memory import FlatMemory, example
from rig.wires import drive_axes
from rig.wires.can_axes import CanAxes, CanAxesSettings

DT = 0.001
RIG = Path(__file__).resolve().parents[2] / "configs" / "rigs" / "wavebot_hil.yaml"
JOB = build_job(load(RIG, RigFile)[0])
HEAVE, SURGE, STATOR = 5, 6, 9
DIVIDER = 10  # of the stator's status


class Slot:
    """A mailbox with one message of the present time."""

    def __init__(self, fields: Sequence[Sequence[str]]) -> None:
        self._message = namedtuple("Message", [name for name, _ in fields])  # type: ignore[misc]

    def read(self) -> Any:
        return self._message(*[0] * (len(self._message._fields) - 1), time.monotonic())

    def post(self, message: Any) -> None:
        pass


class Bus:
    """The three nodes of a WaveBot; ``through(sync)``: nodes whose queued answers arrive."""

    has_backlog = False

    def __init__(self, through: Callable[[int], set[int]]) -> None:
        self.sent: list[int] = []
        self.syncs = 0
        self.closed = False
        self._through = through
        self._queued: dict[int, list[Frame]] = {HEAVE: [], SURGE: [], STATOR: []}

    def now(self) -> float:
        return self.syncs * DT

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        cob_ids = [cob_id for cob_id, _ in frames]
        self.sent += cob_ids
        if SYNC in cob_ids:
            self.syncs += 1
            for node in (HEAVE, SURGE):
                status = struct.pack("<Hhi", 0x0250, 0, self.syncs)
                analog = struct.pack("<hh", 0, 0)
                self._queued[node] += [Frame(0x180 + node, status), Frame(0x380 + node, analog)]
            if self.syncs % DIVIDER == 0:
                self._queued[STATOR].append(
                    Frame(0x180 + STATOR, struct.pack("<Hbi", 0x0250, 1, self.syncs))
                )
        return ()

    def drain(self) -> list[Frame]:
        frames: list[Frame] = []
        for node in self._through(self.syncs):
            frames += self._queued[node]
            self._queued[node] = []
        return frames

    def close(self) -> None:
        self.closed = True


@pytest.fixture(scope="module")
def config() -> CanAxesSettings:
    settings: CanAxesSettings = handover.loads(CanAxesSettings, JOB.devices["can"]["nodes"])
    scale = CurrentScale(100.0, 0.01, 4000)
    return settings._replace(
        axes={
            name: axis._replace(drive=axis.drive._replace(scale=scale))
            for name, axis in settings.axes.items()
        }
    )


def create_devices(config: CanAxesSettings, bus: Bus) -> WaveBotDevices:
    slots: Any = {
        name: Slot(fields)
        for process in JOB.io_processes
        for name, fields in process.mailboxes.items()
    }
    return WaveBotDevices(CanAxes(config, bus, slots), slots, JOB.devices["trigger_divider"])


@pytest.fixture(autouse=True)
def no_sleep(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "sleep", lambda seconds: None)


def test_the_rig_file_sets_how_often_each_node_answers(config: CanAxesSettings) -> None:
    assert [axis.slow_divider for axis in config.axes.values()] == [20, 20]
    assert config.actuators["stator"].status_divider == 10


def test_the_warm_up_ends_with_a_sync_and_the_first_tick_finds_the_answers(
    config: CanAxesSettings,
) -> None:
    bus = Bus(lambda syncs: {HEAVE, SURGE, STATOR})
    devices = create_devices(config, bus)
    devices.warm_up(DT)
    last = [one for one in bus.sent if one != 0x700 + config.own_node][-1]
    assert last == SYNC
    assert bus.syncs <= DIVIDER + 2
    sense = devices.read(0.0)
    assert sense.heave.counts == sense.surge.counts == bus.syncs
    # This bus's clock advances with SYNC, whose time is taken before it is sent.
    assert sense.heave.encoder_age == pytest.approx(DT)
    assert sense.heave.enabled == sense.surge.enabled == 0


def test_the_warm_up_waits_for_late_nodes(config: CanAxesSettings) -> None:
    bus = Bus(lambda syncs: {HEAVE, STATOR} | ({SURGE} if syncs > 700 else set()))
    devices = create_devices(config, bus)
    devices.warm_up(DT)
    sense = devices.read(0.0)
    assert bus.syncs > 700
    assert sense.surge.encoder_age <= 5 * DT


def test_the_warm_up_waits_for_a_stalled_bus(config: CanAxesSettings) -> None:
    """All nodes answer at first, then none for 60 SYNCs: no run begins with old values."""

    def through(syncs: int) -> set[int]:
        axes = {HEAVE, SURGE} if syncs < 8 or syncs > 68 else set[int]()
        return axes | ({STATOR} if syncs > 20 else set())

    bus = Bus(through)
    devices = create_devices(config, bus)
    devices.warm_up(DT)
    assert bus.syncs > 68
    sense = devices.read(0.0)
    assert max(sense.heave.encoder_age, sense.surge.encoder_age) <= 5 * DT


@pytest.mark.parametrize("silent", [{HEAVE}, {SURGE}, {STATOR}, {HEAVE, STATOR}])
def test_nodes_that_do_not_answer_are_named(
    config: CanAxesSettings, silent: set[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drive_axes, "WARM_UP_TIMEOUT_S", 0.2)
    names = {HEAVE: "heave", SURGE: "surge", STATOR: "stator"}
    bus = Bus(lambda syncs: set(names) - silent)
    expected = ", ".join(names[node] for node in sorted(silent))
    with pytest.raises(OSError, match=f"no process data from {expected} in 0.2 s"):
        create_devices(config, bus).warm_up(DT)


def test_no_drive_is_enabled(config: CanAxesSettings) -> None:
    bus = Bus(lambda syncs: {HEAVE, SURGE, STATOR})
    devices = create_devices(config, bus)
    devices.warm_up(DT)
    assert [axis.explain() for axis in devices._drives._axes.values()] == ["NOT_REQUESTED"] * 2
    assert math.isclose(devices.read(0.0).heave.current, 0.0)


def test_every_reading_is_stored_in_any_memory(config: CanAxesSettings) -> None:
    """No number of an earlier tick is left over, and the elevation stays unknown."""
    bus = Bus(lambda syncs: {HEAVE, SURGE, STATOR})
    devices = create_devices(config, bus)
    devices.warm_up(DT)
    memory = FlatMemory(sense=example(Sense), command=example(Command))
    sense = memory.bytes_of("sense")
    sense[:] = bytes(b"\x77" * len(sense))
    devices.use(memory)
    devices.read_in_place(0.0)
    assert 0x7777777777777777 not in sense.cast("q").tolist()
    stored = memory.get("sense")
    assert stored.heave.counts == bus.syncs
    assert math.isnan(stored.wave.elevation)
    memory.set("command", example(Command)._replace(wave_trigger=1))
    posted: list[Any] = []
    devices._trigger.post = posted.append  # type: ignore[method-assign]
    devices.write_in_place()
    assert [trigger for trigger, _ in posted] == [1]
