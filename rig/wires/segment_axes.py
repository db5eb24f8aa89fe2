"""The drives and terminals of a rig's EtherCAT segment in the loop: one frame a tick.

The newest answer is taken first, and all outputs are sent with the next frame.
`rig.wires.segment_slaves.segment_axes` returns the configuration.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

from drivers.cia402.positioning_drive import PositioningSettings
from drivers.cia402.torque_drive import TorqueDriveSettings
from drivers.errors import CodecError, LinkError
from drivers.ethercat import terminal
from drivers.ethercat.clock import ClockParams, Follower
from drivers.ethercat.cycle import FrameLink, SegmentCycle
from drivers.ethercat.frames import CyclicFrame
from drivers.ethercat.link import Link
from drivers.ethercat.position_actuator import ActuatorSettings, PositionActuator
from drivers.ethercat.process_image import Area, expected_wkc, image_bytes
from drivers.ethercat.terminal import TerminalEntry
from drivers.ethercat.torque_axis import TorqueAxis, TorqueAxisSettings
from rig.processes import handover
from rig.processes.mailbox import Mailbox
from rig.wires.drive_axes import AxisRequest, DriveAxes, HealthLimits, current_scale
from rig.wires.messages import WHOLE_NUMBERS, block_message, message_type

Reader = Callable[[memoryview], float]
_MAX_FOREIGN = 10  # frames of another master
_MAX_OFFSETS = 86_400  # seconds whose clock offsets are kept
_NEVER = -1e9  # s, earlier than any clock reading
_NO_AREA = Area(0, 0)


class TerminalSettings(NamedTuple):
    """The process data of a slave that is no drive."""

    outputs: tuple[TerminalEntry, ...]
    inputs: tuple[TerminalEntry, ...]


class AddedSource(NamedTuple):
    """A value of the process data that is added to another."""

    slave: int  # its place in the line
    value: str
    scale: float


class TerminalSource(NamedTuple):
    """A value of a block, and where it is in the process data."""

    name: str
    unit: str
    slave: int  # its place in the line
    value: str
    scale: float
    offset: float
    low: float
    high: float
    added: tuple[AddedSource, ...]

    @property
    def parts(self) -> "tuple[AddedSource, ...]":
        """The values whose sum it is."""
        return (AddedSource(self.slave, self.value, self.scale), *self.added)


class SegmentSettings(NamedTuple):
    """Constants of the segment; current scales and places are known after its set-up."""

    interface: str
    slaves: tuple[str, ...]  # names, in the order of the line
    limits: HealthLimits
    lost: float  # s, age of inputs that means a lost segment
    actuator_divider: int  # ticks per command to an actuator
    clock: ClockParams  # with which the loop follows the segment's clock, if that leads
    axes: dict[str, TorqueDriveSettings]
    actuators: dict[str, PositioningSettings]
    terminals: tuple[TerminalSettings, ...]  # of each slave; drives have none
    blocks: dict[str, tuple[TerminalSource, ...]]
    written: tuple[str, ...]  # names of the blocks that the loop writes


class SegmentFacts(NamedTuple):
    """Findings of the service: areas of each slave as `Area`, or empty, and the clock."""

    outputs: tuple[tuple[int, ...], ...]
    inputs: tuple[tuple[int, ...], ...]
    reference_clock: int  # station whose clock all follow, 0: none

    def areas(self) -> tuple[tuple[Area | None, Area | None], ...]:
        """Return outputs and inputs of each slave."""
        pairs = zip(self.outputs, self.inputs, strict=True)
        return tuple(
            (Area(*out) if out else None, Area(*into) if into else None) for out, into in pairs
        )


class TerminalInputs:
    """The newest valid values of a block of terminals, as a mailbox has them."""

    def __init__(
        self,
        sources: Sequence[TerminalSource],
        readers: Sequence[Reader],
        checks: Sequence[tuple[Reader, int]],
    ) -> None:
        """``readers``: of the values in the rig's units; ``checks``: status and its wrong bits."""
        self._type: Any = message_type(block_message((one.name, one.unit) for one in sources))
        self._sources = tuple(
            (read, one.low, one.high, one.unit in WHOLE_NUMBERS)
            for one, read in zip(sources, readers, strict=True)
        )
        self._checks = tuple(checks)
        never = [0 if one.unit in WHOLE_NUMBERS else float("nan") for one in sources]
        self._message = self._type(*never, _NEVER)

    def take(self, image: memoryview, sampled: float) -> None:
        """Take the values of an image, sampled at a time (s), unless one is wrong."""
        for status, mask in self._checks:
            if int(status(image)) & mask:
                return
        values: list[float] = []
        for read, low, high, whole in self._sources:
            value = read(image)
            if not low <= value <= high:
                return
            values.append(int(value) if whole else value)
        self._message = self._type(*values, sampled)

    def read(self) -> Any:
        """Return the newest valid message."""
        return self._message


class TerminalOutputs:
    """The outputs of a block of terminals, which go with every frame."""

    def __init__(
        self,
        image: memoryview,
        sources: Sequence[TerminalSource],
        writers: Sequence[Callable[[memoryview, float], None]],
    ) -> None:
        self._image = image
        self._writers = tuple(
            (write, one.scale, one.offset) for one, write in zip(sources, writers, strict=True)
        )

    def post(self, message: Sequence[float]) -> None:
        """Store the values of a message, whose last field is its time."""
        for (write, scale, offset), value in zip(self._writers, message, strict=False):
            write(self._image, (value - offset) / scale)


class SegmentAxes(DriveAxes):
    """All slaves of a segment."""

    def __init__(
        self,
        settings: SegmentSettings,
        facts: SegmentFacts,
        link: FrameLink,
        slots: Mapping[str, Mailbox],
    ) -> None:
        """``slots``: the mailboxes of the drives' health, among others."""
        areas = facts.areas()
        try:
            frame = CyclicFrame(image_bytes(areas), facts.reference_clock or None)
        except CodecError as error:
            raise LinkError(f"EtherCAT on {settings.interface}: {error}") from error
        self._cycle = SegmentCycle(link, frame, expected_wkc(areas))
        by_name = dict(zip(settings.slaves, areas, strict=True))
        self._axes = {
            name: _mapped(name, by_name[name], partial(_torque_axis, each))
            for name, each in settings.axes.items()
        }
        self._actuators = {
            name: _mapped(name, by_name[name], partial(_position_actuator, each))
            for name, each in settings.actuators.items()
        }
        self._settings = settings
        self._ticks_per_second = max(1, 1_000_000_000 // settings.clock.cycle_ns)
        self._sent, self._taken, self._was_operational = 0, _NEVER, False
        self._clock = Follower(settings.clock)
        self._offsets: list[tuple[float, int, float]] = []
        if facts.reference_clock:
            self.clock_correction = self._clock.correction
        drives = {*settings.axes, *settings.actuators}
        places = [
            ({}, {}) if name in drives else _places(name, each, area)
            for name, each, area in zip(settings.slaves, settings.terminals, areas, strict=True)
        ]
        self.terminals: dict[str, Any] = {}
        self._inputs: list[TerminalInputs] = []
        for name, sources in settings.blocks.items():
            if name in settings.written:
                writers = [terminal.writer(places[one.slave][0][one.value]) for one in sources]
                self.terminals[name] = TerminalOutputs(self._cycle.outputs, sources, writers)
                continue
            inputs = [inputs for _, inputs in places]
            readers = [_scaled_reader(one, inputs) for one in sources]
            checks = [
                (terminal.reader(inputs[slave][entry.name]), entry.invalid_mask)
                for slave in dict.fromkeys(each.slave for one in sources for each in one.parts)
                for entry in settings.terminals[slave].inputs
                if entry.invalid_mask
            ]
            block = TerminalInputs(sources, readers, checks)
            self.terminals[name] = block
            self._inputs.append(block)
        super().__init__(
            self._axes, self._actuators, settings.actuator_divider, settings.limits, slots
        )

    def receive(self) -> float:
        cycle = self._cycle
        self.time = cycle.receive()
        if cycle.sampled != self._taken:
            if self.clock_correction is not None and cycle.state.time_ns:
                self._follow_clock(cycle.state.time_ns)
            self._taken = sampled = cycle.sampled
            inputs = cycle.inputs
            for axis in self._axes.values():
                axis.take(inputs, sampled)
            for actuator in self._actuators.values():
                actuator.take(inputs, sampled)
            for block in self._inputs:
                block.take(inputs, sampled)
        return self.time

    def take_time(self) -> float:
        self.time = self._cycle.now()
        return self.time

    def send(self, axes: Sequence[AxisRequest], actuators: Sequence[AxisRequest] = ()) -> None:
        now, outputs = self.time, self._cycle.outputs
        for axis, (current, enable) in zip(self._axes.values(), axes, strict=True):
            axis.command(outputs, current, enable, now)
        if actuators and self._sent % self._actuator_divider == 0:
            for actuator, (target, enable) in zip(self._actuators.values(), actuators, strict=True):
                actuator.command(outputs, target, enable, now)
        self._cycle.send()
        self._sent += 1

    def _follow_clock(self, time_ns: int) -> None:
        """Compute the correction from the newest frame; keep offset and drift once a second."""
        self._clock.take(time_ns)
        state = self._clock.state
        if state.ticks % self._ticks_per_second == 0 and len(self._offsets) < _MAX_OFFSETS:
            drift = 1e6 * state.drift_ns / self._clock.params.cycle_ns
            self._offsets.append((self.time, state.offset_ns, drift))

    def wire_report(self) -> dict[str, Any]:
        """Return frames and ages, and with a leading clock its offset and drift each second."""
        report: dict[str, Any] = {"ethercat": self._cycle.statistics()}
        if self.clock_correction is not None:
            report["clock"] = {
                "shift_ns": self._clock.params.shift_ns,
                "columns": ["monotonic_s", "offset_ns", "drift_ppm"],
                "rows": self._offsets,
            }
        return report

    def command_nothing(self) -> None:
        self._send_rest(lambda actuator: actuator.command(self._cycle.outputs, 0.0, 0, self.time))

    def release(self) -> None:
        self._send_rest(lambda actuator: actuator.release(self._cycle.outputs, self.time))

    def _send_rest(self, rest: Callable[[PositionActuator], None]) -> None:
        """Send no current to the axes, and to each actuator what ``rest`` stores."""
        for axis in self._axes.values():
            axis.command(self._cycle.outputs, 0.0, 0, self.time)
        for actuator in self._actuators.values():
            rest(actuator)
        self._cycle.send()

    def warm_up(self, dt: float) -> None:
        """Run cycles until every drive answers and all slaves are in OP.

        With a leading clock they follow it, and the loop's deadlines begin where theirs end.
        """
        super().warm_up(dt)
        self._clock.move_to(self._pace.due_ns)

    def trouble(self) -> str:
        if self._is_operational() and self._cycle.foreign <= _MAX_FOREIGN:
            self._was_operational = True
            return ""
        state, names = self._cycle.state, self._settings.slaves
        if self._cycle.foreign > _MAX_FOREIGN:
            return f"EtherCAT on {self._settings.interface}: another master sends frames, too"
        if state.slaves == 0:
            return f"EtherCAT on {self._settings.interface}: no frame comes back"
        if state.slaves != len(names):
            return (
                f"EtherCAT on {self._settings.interface}: {state.slaves} of {len(names)} slaves "
                "answer; the cable is cut or a slave has no power"
            )
        return (
            f"EtherCAT on {self._settings.interface}: not all slaves reach OP "
            f"(AL status {state.al_status:#06x}, by bitwise or)"
        )

    def close(self) -> None:
        self._cycle.close()

    def _is_lost(self, name: str) -> bool:
        """Return whether the segment left OP, is silent, or is used by another master as well.

        All axes lose it then. Another master could write their outputs, too.
        """
        if self._was_operational:
            cycle = self._cycle
            is_silent = self.time - cycle.sampled > self._settings.lost
            if is_silent or cycle.foreign > _MAX_FOREIGN or not self._is_operational():
                return True
        return super()._is_lost(name)

    def _is_operational(self) -> bool:
        return self._cycle.state.is_operational(len(self._settings.slaves))


def _torque_axis(drive: TorqueDriveSettings, outputs: Area, inputs: Area) -> TorqueAxis:
    return TorqueAxis(TorqueAxisSettings(drive, outputs, inputs))


def _position_actuator(drive: PositioningSettings, outputs: Area, inputs: Area) -> PositionActuator:
    return PositionActuator(ActuatorSettings(drive, outputs, inputs))


T = TypeVar("T")


def _mapped(
    name: str, areas: tuple[Area | None, Area | None], create: Callable[[Area, Area], T]
) -> T:
    """Return a drive on its areas; LinkError if they are not those of the mapped values."""
    outputs, inputs = areas
    try:
        return create(outputs or _NO_AREA, inputs or _NO_AREA)
    except CodecError as error:
        text = f"{name} does not exchange what the drivers have mapped: {error}"
        raise LinkError(text) from error


Places = dict[str, terminal.Place]


def _scaled_reader(source: TerminalSource, inputs: Sequence[Places]) -> Reader:
    """Return the function that reads a value in the rig's unit."""
    parts = [(terminal.reader(inputs[each.slave][each.value]), each.scale) for each in source.parts]
    offset = source.offset
    if len(parts) == 1:
        ((read, scale),) = parts
        return lambda image: scale * read(image) + offset
    return lambda image: sum(scale * read(image) for read, scale in parts) + offset


def _places(
    name: str, settings: TerminalSettings, areas: tuple[Area | None, Area | None]
) -> tuple[Places, Places]:
    """Return the places of a terminal's outputs and inputs; LinkError if it has others."""
    outputs, inputs = areas
    try:
        return terminal.places(settings.outputs, outputs), terminal.places(settings.inputs, inputs)
    except CodecError as error:
        text = f"{name} does not exchange what its device file says: {error}"
        raise LinkError(text) from error


def connect(
    config: dict[str, Any], facts: dict[str, Any], slots: Mapping[str, Mailbox]
) -> SegmentAxes:
    """Return the slaves for a configuration of `segment_slaves.segment_axes`.

    ``facts``: those of the segment's service. LinkError if the interface cannot be opened, or if a
    terminal exchanges other values than its device file has.
    """
    settings: SegmentSettings = handover.loads(SegmentSettings, config["settings"])
    axes = {
        name: each._replace(scale=current_scale(config["scales"][name], facts["drives"][name]))
        for name, each in settings.axes.items()
    }
    settings = settings._replace(axes=axes)
    found: SegmentFacts = handover.build(SegmentFacts, facts["segment"], "facts", {})
    return SegmentAxes(settings, found, Link(settings.interface), slots)
