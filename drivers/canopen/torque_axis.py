"""A drive in cyclic synchronous torque mode: what is told and heard of it from tick to tick.

Per tick one command (controlword, target) goes out before SYNC, and the status that the SYNC before
brought (statusword, torque, position) has come in; mode display and error code come on a divider.
An emergency message brings its error code earlier than that: with the fault itself.
The conversation owns no bus: it takes frames and gives frames.
"""

from typing import NamedTuple

from drivers.canopen import cia402, emcy, pdo, scaling
from drivers.canopen.cia402_table import Goal
from drivers.canopen.codec_error import CodecError
from drivers.canopen.statusword import FAULT, FAULT_REACTION, decode

TORQUE_MODE = 10  # cyclic synchronous torque, 0x6060
_SAFE, _ENABLED = int(Goal.SAFE), int(Goal.ENABLED)
_NEVER = -1e9  # s, before any clock began


class Settings(NamedTuple):
    """One drive on the bus."""

    node: int  # 1 to 127
    machine: cia402.Params
    scale: scaling.CurrentScale
    slow_age: float  # s, > 0: age from which mode display and error code say nothing
    analog: tuple[float, ...] = ()  # units per raw step of each analog input in TPDO 3, if any
    slow_every: int = 1  # SYNCs from one mode display and error code to the next


class Reading(NamedTuple):
    """What the drive said last."""

    counts: int  # encoder, unwrapped
    current: float  # A, drive current
    acting: int  # 1: OPERATION ENABLED by our permission, in torque mode
    error: int  # 0x603F while the drive is in fault (0xFFFF: it does not say), else 0
    age: float  # s, since the SYNC that sampled it; very large before the first
    analog: tuple[float, ...]  # analog inputs, scaled, of the same SYNC
    analog_age: float  # s


_ANALOG = tuple(pdo.Entry(0x201A, sub, "i16", f"analog input {sub}") for sub in (1, 2, 3, 4))


class Layouts(NamedTuple):
    """The PDOs of a torque axis."""

    command: pdo.Layout
    status: pdo.Layout
    slow: pdo.Layout
    analog: pdo.Layout | None


def layouts(node: int, inputs: int) -> Layouts:
    """PDOs of the node with so many analog inputs (0 to 4)."""
    return Layouts(
        pdo.layout(pdo.rpdo_cob_id(1, node), pdo.AXIS_COMMAND),
        pdo.layout(pdo.tpdo_cob_id(1, node), pdo.AXIS_STATUS),
        pdo.layout(pdo.tpdo_cob_id(2, node), pdo.AXIS_SLOW_STATUS),
        pdo.layout(pdo.tpdo_cob_id(3, node), _ANALOG[:inputs]) if inputs else None,
    )


class TorqueAxis:
    """The conversation with one drive."""

    def __init__(self, settings: Settings) -> None:
        self.refused = 0  # frames of a wrong length
        self.held = 0  # set of scaling.Held: why the last command is not what was asked
        self._settings = settings
        self._pdo = layouts(settings.node, len(settings.analog))
        self._emergency = emcy.BASE + settings.node
        self.each_sync = {
            self._emergency: 0,
            self._pdo.status.cob_id: 1,
            self._pdo.slow.cob_id: settings.slow_every,
        }
        if self._pdo.analog is not None:
            self.each_sync[self._pdo.analog.cob_id] = 1
        self._machine = cia402.start(0, 0)
        self._arm = self._reset = 0
        self._enable = 0
        self._acting = 0
        self._counts = 0
        self._seen = False
        self._statusword = self._raw = 0
        self._sampled = self._slow_at = self._analog_at = _NEVER
        self._shown = self._error = self._urgent = 0
        self._analog: tuple[float, ...] = (0.0,) * len(settings.analog)

    def take(self, cob_id: int, data: bytes, sampled: float) -> None:
        """A frame of ours, and when (s) the SYNC was sent that it answers."""
        try:
            if cob_id == self._pdo.status.cob_id:
                self._statusword, self._raw, position = pdo.unpack(self._pdo.status, data)
                counts = scaling.unwrapped(self._counts, position) if self._seen else position
                self._counts, self._seen, self._sampled = counts, True, sampled
            elif cob_id == self._pdo.slow.cob_id:
                self._shown, self._error = pdo.unpack(self._pdo.slow, data)
                self._slow_at = sampled
            elif self._pdo.analog is not None and cob_id == self._pdo.analog.cob_id:
                raw = pdo.unpack(self._pdo.analog, data)
                pairs = zip(raw, self._settings.analog, strict=True)
                self._analog = tuple(value * scale for value, scale in pairs)
                self._analog_at = sampled
            elif cob_id == self._emergency:
                self._urgent = emcy.decode(cob_id, data).code
        except CodecError:
            self.refused += 1

    def read(self, now: float) -> Reading:
        """What is known at ``now`` (s)."""
        faulty = decode(self._statusword) in (FAULT, FAULT_REACTION)
        return Reading(
            self._counts,
            scaling.current_feedback(self._settings.scale, self._raw),
            self._acting,
            (self._error or self._urgent or 0xFFFF) if faulty else 0,
            now - self._sampled,
            self._analog,
            now - self._analog_at,
        )

    def command(self, current: float, enable: int, now: float) -> tuple[int, bytes]:
        """COB-ID and bytes that ask for a drive current (A); ``enable`` 1: the drive shall be on.

        Each time ``enable`` rises is one request to go up: a drive that then trips or drops stays
        down until it falls and rises again.
        """
        if enable == 1 and self._enable == 0:
            self._arm += 1
        self._enable = enable
        raw = scaling.current_command(self._settings.scale, current)
        self.held = raw.held
        self._machine, told = cia402.step(
            self._settings.machine,
            self._machine,
            cia402.Inputs(
                self._statusword,
                now - self._sampled,
                self._shown if now - self._slow_at <= self._settings.slow_age else 0,
                TORQUE_MODE,
                _ENABLED if enable == 1 else _SAFE,
                self._arm,
                self._reset,
                0,
                raw.value,
            ),
        )
        self._acting = told.acting
        command = self._pdo.command
        return command.cob_id, pdo.pack(command, told.controlword, told.setpoint)

    def reset(self) -> None:
        """Ask once for the reset of a fault; it gives no permission to go up."""
        self._reset += 1

    def explain(self) -> str:
        """Why the drive is kept down, for people; empty if it is not."""
        return cia402.explain(self._machine)
