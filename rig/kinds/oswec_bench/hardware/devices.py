"""A bench's real devices behind the loop's device interface.

The tick reads the frames that came from the encoder bridge. Every other device has an I/O process:
the tick reads its last value and age from a mailbox and posts the commands for it. This module
alone translates between the messages of the wires and the signals of the loop.
"""

import time
from typing import Any, NamedTuple

from controllers.blocks import clamp
from drivers.compax3 import analog_command
from drivers.conversation import Exchange
from rig.kinds.oswec_bench.tick import Sense
from rig.kinds.oswec_bench.tick.signals import Command
from rig.processes import handover
from rig.processes.mailbox import Mailbox
from rig.realtime.devices import FlatDevices
from rig.wires import streams
from rig.wires.messages import SetPointMessage, open_mailboxes
from rig.wires.streams import Stream

MAILBOX_INPUTS = ("servo", "load_cell", "brake", "inputs", "analog_done")
WARM_UP_TIMEOUT_S = 3.0  # s in which every device must give a value
_MAX_WARM_UP_AGE_S = 0.1  # s, of every value at the end of the warm-up


class BenchDeviceSettings(NamedTuple):
    """Scales from the loop's volts and amperes to the commands on the wires."""

    analog: int  # 1: the velocity command goes through the analog output; 0: to the drive itself
    output: analog_command.Params  # calibration of the analog output, volts over volts
    velocity_per_volt: float  # rad/s at the motor per volt
    torque_per_ampere: float  # N m at the motor, nominal
    max_brake_current: float  # A, limit of the brake's output


class BenchDevices(FlatDevices):
    """All devices of a bench on their wires."""

    def __init__(
        self, config: BenchDeviceSettings, encoders: Stream, slots: dict[str, Mailbox]
    ) -> None:
        """``encoders``: not opened yet, or unread frames would be lost in its port."""
        self._config = config
        self._encoders = encoders
        self._bridge = Exchange(encoders.link, encoders.conversation)
        self._slots = slots
        self._rest = analog_command.rest_voltage(config.output)
        super().__init__(Sense, Command)

    def warm_up(self, dt: float) -> None:
        """Wait for a fresh value of every device; OSError names those without one.

        The command mailboxes get commands at rest first. LinkError if the encoder bridge cannot be
        opened.
        """
        self._encoders.link.open()
        until = time.monotonic() + WARM_UP_TIMEOUT_S
        while True:
            self._release()
            now = self._bridge.step()
            silent = [name for name in MAILBOX_INPUTS if self._silent(name, now)]
            encoders = self._encoders.read_message(now)
            if encoders is None or now - encoders.stamp > _MAX_WARM_UP_AGE_S:
                why = self._encoders.conversation.explain(now) or self._encoders.link.problem
                silent.insert(0, f"encoders ({why})")
            if not silent:
                return
            if now > until:
                raise OSError(f"nothing new from {', '.join(silent)} in {WARM_UP_TIMEOUT_S:g} s")
            time.sleep(dt)

    def _silent(self, name: str, now: float) -> bool:
        message = self._slots[name].read()
        return message is None or now - message.stamp > _MAX_WARM_UP_AGE_S

    def attach(self, sense: Any, command: Any) -> None:
        self._sense, self._command = sense, command

    def read_in_place(self, now: float) -> None:
        slots = self._slots  # read before the time, or a later post would give a negative age
        current, acting, error, servo_stamp = slots["servo"].read()
        cell = slots["load_cell"].read()
        brake, brake_stamp = slots["brake"].read()
        e_stop, limit_switch, panel_stamp = slots["inputs"].read()
        # A brake that no longer takes commands is as lost as one that gives no values.
        brake_stamp = min(brake_stamp, slots["analog_done"].read().stamp)
        time_now = self._bridge.step()
        motor, shaft, encoder_stamp = self._encoders.read_message(time_now)
        sense = self._sense
        sense.encoders(motor, shaft, time_now - encoder_stamp)
        sense.servo(current, acting, error, time_now - servo_stamp)
        sense.load(cell.fx, cell.fy, cell.fz, cell.tx, cell.ty, cell.tz, time_now - cell.stamp)
        sense.brake(brake, time_now - brake_stamp)
        sense.panel(e_stop, limit_switch, time_now - panel_stamp)

    def write_in_place(self) -> None:
        config, now, command = self._config, time.monotonic(), self._command
        (volts,), (current,), (enable,) = command.volts(), command.current(), command.enable()
        (brake_current,) = command.brake_current()
        torque = current * config.torque_per_ampere
        velocity, output = 0.0, self._rest
        if config.analog == 0:
            velocity = volts * config.velocity_per_volt
        elif enable == 1:
            output = analog_command.to_volts(config.output, volts).volts
        self._slots["set_point"].post(SetPointMessage(velocity, torque, enable, now))
        brake = clamp(brake_current, 0.0, config.max_brake_current)
        self._slots["analog"].post((output, brake, now))

    def stop(self, reason: int) -> None:
        self._release()

    def close(self) -> None:
        self._encoders.link.close()

    def _release(self) -> None:
        now = time.monotonic()
        self._slots["set_point"].post(SetPointMessage(0.0, 0.0, 0, now))
        self._slots["analog"].post((self._rest, 0.0, now))


def connect(config: dict[str, Any], dt: float) -> BenchDevices:
    """Return the devices for a configuration of `rig.kinds.oswec_bench.hardware.job`."""
    settings: BenchDeviceSettings = handover.loads(BenchDeviceSettings, config["devices"])
    slots = open_mailboxes(config["mailboxes"])
    encoders = streams.create_stream("encoders", config["streams"]["encoders"], slots)
    return BenchDevices(settings, encoders, slots)
