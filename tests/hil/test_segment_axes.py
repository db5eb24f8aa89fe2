"""The slaves of the WaveBot's segment in the loop, on a wire that the test holds in its hands."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import pytest

from controllers.signals import DriveFault
from drivers.cia402.scaling import CurrentScale
from drivers.errors import LinkError
from drivers.ethercat import terminal
from drivers.ethercat.cycle import OPERATIONAL
from drivers.ethercat.frames import decode, encode
from rig.config.pydantic_errors import load
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.hardware.job import build_job
from rig.processes import handover
from rig.wires.messages import NodeHealth
from rig.wires.segment_axes import (
    SegmentAxes,
    SegmentFacts,
    SegmentSettings,
    TerminalOutputs,
    TerminalSource,
)

CONFIGS = Path(__file__).parents[2] / "configs"
RIG, _ = load(CONFIGS / "rigs" / "wavebot_ethercat.yaml", RigFile)
JOB = build_job(RIG)
WKC, SLAVES, DT = 18, 12, 0.001
# Bits as pysoem maps this line: all outputs, then all inputs, in the order of the cable.
OUTPUTS = ((0, 32), (32, 32), (64, 88), (), (), (152, 4), (), (), (), (), (), ())
INPUTS = (
    (160, 120), (280, 120), (400, 56), (), (456, 4), (), (464, 352), (816, 352), (1168, 352),
    (1520, 352), (1872, 352), (2224, 352),
)  # fmt: skip
HEAVE, SURGE, SLEW, SIZE = 20, 35, 58, 322  # bytes: first of each one's inputs; all


class Wire:
    """A wire whose slaves answer with what the test puts into `inputs`."""

    def __init__(self) -> None:
        self.frame = bytearray(1518)
        self.time = 100.0
        self.inputs = bytearray(SIZE)
        self.wkc, self.slaves, self.al_status, self.clock_ns = WKC, SLAVES, OPERATIONAL, 0
        self.outputs = b""
        self.answers: list[bytes] = []

    def now(self) -> float:
        return self.time

    def send(self, frame: bytearray) -> bool:
        data, status, number, *clock = decode(bytes(frame))
        self.outputs = data.data
        al_status = struct.pack("<H", self.al_status)
        clock = [each._replace(data=struct.pack("<Q", self.clock_ns)) for each in clock]
        self.answers = [
            encode(
                (
                    data._replace(data=bytes(self.inputs), wkc=self.wkc),
                    status._replace(data=al_status, wkc=self.slaves),
                    number,
                    *clock,
                )
            )
        ]
        return True

    def receive(self) -> int:
        if not self.answers:
            return 0
        frame = self.answers.pop()
        self.frame[: len(frame)] = frame
        return len(frame)

    def close(self) -> None:
        self.answers = []


class Health:
    """The mailbox of a drive that is well."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    def read(self) -> NodeHealth:
        now = self._wire.time
        return NodeHealth(now, 0, now)


def connected(wire: Wire, reference_clock: int = 0, inputs: Any = INPUTS) -> SegmentAxes:
    settings: SegmentSettings = handover.loads(SegmentSettings, JOB.devices["ethercat"]["settings"])
    scale = CurrentScale(100.0, 0.01, 4000)
    settings = settings._replace(
        axes={name: each._replace(scale=scale) for name, each in settings.axes.items()}
    )
    slots: Any = {f"{name}_health": Health(wire) for name in settings.axes}
    return SegmentAxes(settings, SegmentFacts(OUTPUTS, inputs, reference_clock), wire, slots)


def tick(axes: SegmentAxes, wire: Wire, trigger: int = 0) -> None:
    """Send a frame, let a tick pass, and take its answer."""
    axes.terminals["outputs"].post((trigger, wire.time))
    axes.send(((0.0, 0), (0.0, 0)), ((0.0, 0),))
    wire.time += DT
    axes.receive()


@pytest.fixture
def wire() -> Wire:
    return Wire()


@pytest.fixture
def axes(wire: Wire) -> SegmentAxes:
    """Return the axes of a segment that runs."""
    found = connected(wire)
    tick(found, wire)
    assert found.trouble() == ""
    return found


def test_values_of_terminals_are_scaled_means(axes: SegmentAxes, wire: Wire) -> None:
    samples = [100_000 + 10 * n for n in range(10)]
    wire.inputs[SLEW : SLEW + 44] = struct.pack("<HH10i", 0, 1, *samples)
    tick(axes, wire)
    cells = axes.terminals["cells"].read()
    assert cells.slew == pytest.approx(2.3841861e-3 * 100_045)
    assert wire.time - cells.stamp == pytest.approx(DT)


@pytest.mark.parametrize("status", [0x40, 0x01, 0x02])
def test_a_value_with_an_error_is_not_used_and_ages(
    axes: SegmentAxes, wire: Wire, status: int
) -> None:
    wire.inputs[SLEW : SLEW + 44] = struct.pack("<HH10i", 0, 1, *[1000] * 10)
    tick(axes, wire)
    wire.inputs[SLEW : SLEW + 44] = struct.pack("<HH10i", status, 1, *[5000] * 10)
    for _ in range(20):
        tick(axes, wire)
    cells = axes.terminals["cells"].read()
    assert cells.slew == pytest.approx(2.3841861)
    assert wire.time - cells.stamp == pytest.approx(21 * DT)


def test_a_value_out_of_its_range_is_not_used(axes: SegmentAxes, wire: Wire) -> None:
    wire.inputs[SLEW : SLEW + 44] = struct.pack("<HH10i", 0, 1, *[11_000_000] * 10)
    before = axes.terminals["cells"].read().stamp
    tick(axes, wire)
    assert axes.terminals["cells"].read().stamp == before  # 26 kN, and 25 kN are allowed


def test_before_the_first_answer_values_are_none_and_old(wire: Wire) -> None:
    cells = connected(wire).terminals["cells"].read()
    assert math.isnan(cells.slew)
    assert wire.time - cells.stamp > 1e6


def test_bits_are_whole_numbers_and_outputs_go_with_the_next_frame(
    axes: SegmentAxes, wire: Wire
) -> None:
    wire.inputs[57] = 0b0010  # bits 456 to 459: the second input
    tick(axes, wire, trigger=1)
    panel = axes.terminals["inputs"].read()
    assert (panel.e_stop, panel.limit_switch) == (0, 1)
    assert type(panel.limit_switch) is int
    assert wire.outputs[19] & 0x0F == 1  # bits 152 to 155
    tick(axes, wire, trigger=0)
    assert wire.outputs[19] & 0x0F == 0


def test_outputs_with_scale_and_offset_are_in_the_numbers_of_the_terminal() -> None:
    source = TerminalSource("valve", "V", 0, "channel", 0.5, 2.0, -1e9, 1e9, ())
    image = memoryview(bytearray(2))
    TerminalOutputs(image, [source], [terminal.writer(terminal.Place(0, "i16"))]).post((7.0, 0.0))
    assert struct.unpack("<h", image) == (10,)  # 7 V = 0.5 V * 10 + 2 V


def test_a_terminal_with_other_process_data_than_described_is_refused_by_name(wire: Wire) -> None:
    inputs = (*INPUTS[:4], (456, 2), *INPUTS[5:])
    with pytest.raises(LinkError, match="inputs does not exchange what its device file says"):
        connected(wire, inputs=inputs)


@pytest.mark.parametrize(
    ("heave", "what"), [((160, 112), "expected 120 from a whole byte, got 112"), ((), "got 0")]
)
def test_a_drive_with_other_process_data_than_mapped_is_refused_by_name(
    wire: Wire, heave: tuple[int, ...], what: str
) -> None:
    with pytest.raises(LinkError, match=f"heave does not exchange what the drivers.*{what}"):
        connected(wire, inputs=(heave, *INPUTS[1:]))


def test_more_process_data_than_a_frame_has_are_refused(wire: Wire) -> None:
    inputs = (*INPUTS[:-1], (2224, 12_000))
    with pytest.raises(LinkError, match="expected 1 to 1400 bytes, got 1778"):
        connected(wire, inputs=inputs)


def test_a_slave_that_shows_its_own_number_is_in_op(axes: SegmentAxes, wire: Wire) -> None:
    wire.al_status = 0x28  # bit 5: an explicit device ID
    tick(axes, wire)
    assert faults(axes) == [0, 0]


def faults(axes: SegmentAxes) -> list[int]:
    return [axes.sense(name, axes.read(name)).fault for name in axes.names]


def test_a_running_segment_has_no_fault(axes: SegmentAxes) -> None:
    assert faults(axes) == [0, 0]


LOST = [DriveFault.FIELDBUS_LOST.value] * 2
FAULTY = 0x0238  # statusword: fault
STATUS_OF_HEAVE = struct.Struct("<HhibH")  # statusword, torque, position, mode, error code


def test_a_fault_that_a_drive_reports_stays_its_own(axes: SegmentAxes, wire: Wire) -> None:
    STATUS_OF_HEAVE.pack_into(wire.inputs, HEAVE, FAULTY, 0, 0, 10, 0x2310)
    tick(axes, wire)
    assert faults(axes) == [DriveFault.GENERAL.value, 0]
    wire.al_status = 0x1C  # the fault makes the drive leave OP
    tick(axes, wire)
    assert faults(axes) == [DriveFault.GENERAL.value, DriveFault.FIELDBUS_LOST.value]


@pytest.mark.parametrize("code", [0x7500, 0x8130, 0x8250, 0x8700])
def test_a_drive_that_reports_a_lost_bus_only_confirms_it(
    axes: SegmentAxes, wire: Wire, code: int
) -> None:
    STATUS_OF_HEAVE.pack_into(wire.inputs, HEAVE, FAULTY, 0, 0, 10, code)
    tick(axes, wire)
    assert faults(axes) == [DriveFault.GENERAL.value, 0]  # the segment is well
    wire.al_status = 0x1C
    tick(axes, wire)
    assert faults(axes) == LOST


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"slaves": 3}, "3 of 12 slaves answer; the cable is cut or a slave has no power"),
        ({"al_status": 0x1C}, "not all slaves reach OP (AL status 0x001c, by bitwise or)"),
    ],
)
def test_a_slave_that_is_gone_or_left_op_is_a_fault_in_the_next_tick(
    axes: SegmentAxes, wire: Wire, changed: dict[str, int], text: str
) -> None:
    for name, value in changed.items():
        setattr(wire, name, value)
    tick(axes, wire)
    assert faults(axes) == LOST
    assert text in axes.trouble()


def test_a_wrong_working_counter_is_a_fault_after_the_time_of_the_rig_file(
    axes: SegmentAxes, wire: Wire
) -> None:
    wire.wkc = WKC - 3
    seen = []
    for _ in range(110):
        tick(axes, wire)
        seen.append(faults(axes) == LOST)
    # lost_ms: 100; the last right frame is two ticks old at the first wrong one
    assert seen.index(True) == pytest.approx(99, abs=1)
    assert axes.wire_report()["ethercat"]["wrong_working_counter"] == 110


@pytest.mark.parametrize("change", [{"restarts": 1}, {"heartbeat_time": 0.0}, {"stamp": 0.0}])
def test_a_drive_that_its_service_lost_is_lost(
    axes: SegmentAxes, wire: Wire, change: dict[str, Any]
) -> None:
    axes._health["surge"].read = lambda: Health(wire).read()._replace(**change)  # type: ignore[method-assign]
    tick(axes, wire)
    assert faults(axes) == [0, DriveFault.FIELDBUS_LOST.value]


def test_frames_of_another_master_are_a_fault(axes: SegmentAxes, wire: Wire) -> None:
    for _ in range(11):
        wire.answers.append(bytes(60))
        axes.receive()
    tick(axes, wire)
    assert faults(axes) == LOST
    assert "another master sends frames, too" in axes.trouble()


def test_the_loop_follows_a_leading_clock(wire: Wire) -> None:
    axes = connected(wire, reference_clock=0x1001)
    assert axes.clock_correction is not None
    wire.clock_ns = 7_000_000_600_000  # 100 us after half a cycle
    tick(axes, wire)
    assert axes.clock_correction() == -100_000  # the first: at once
    assert axes.clock_correction() == 0  # only once for a frame
    wire.clock_ns += 1_020_000
    tick(axes, wire)
    assert axes.clock_correction() == -(1200 + 6)  # 1/100 of 120 us, and the drift
    report = axes.wire_report()["clock"]
    assert (report["shift_ns"], report["columns"][0]) == (500_000, "monotonic_s")


def test_without_a_leading_clock_the_loop_keeps_its_own(axes: SegmentAxes) -> None:
    assert axes.clock_correction is None
    assert "clock" not in axes.wire_report()
