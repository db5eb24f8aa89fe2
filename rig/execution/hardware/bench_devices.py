"""A bench's real devices behind the loop's seam: encoders in the tick, the others in mailboxes.

The tick takes what frames of the encoder bridge have come. Of every other device, which has a
process beside the loop, it reads the last value and its age, and leaves what it wants of it.
Only here are the words of the wires and those of the loop turned into each other.
"""

import time
from typing import Any

from controllers.blocks import clamp
from controllers.signals import PanelSense
from drivers.compax3 import analog_command
from drivers.conversation import Exchange
from rig.execution.hardware import streams
from rig.execution.hardware.bench_settings import Config
from rig.execution.hardware.messages import SLOTS, Analog, SetPoint
from rig.execution.hardware.streams import Stream
from rig.kinds.oswec_bench import BrakeSense, Command, EncoderSense, Sense, ServoSense, WrenchSense
from rig.processes import handover
from rig.processes.mailbox import Mailbox

BESIDE = ("servo", "load_cell", "brake", "inputs", "analog_done")
WARM_UP = 3.0  # s in which every device must have said something
_SETTLED = 0.1  # s: no value is older when it has


class BenchDevices:
    """All devices of a bench on their wires."""

    def __init__(self, config: Config, encoders: Stream, slots: dict[str, Mailbox]) -> None:
        """``encoders``: not opened yet; frames that nobody takes would be lost in its port."""
        self._config = config
        self._encoders = encoders
        self._bridge = Exchange(encoders.link, encoders.talk)
        self._slots = slots
        self._rest = analog_command.rest(config.output)

    def warm_up(self, dt: float) -> None:
        """Wait for a fresh value of every device; OSError names those without one.

        The mailboxes for the commands are given their rest first. LinkError if the encoder bridge
        is not there.
        """
        self._encoders.link.open()
        until = time.monotonic() + WARM_UP
        while True:
            self._release()
            here = self._bridge.turn()
            silent = [name for name in BESIDE if self._silent(name, here)]
            counted = self._encoders.tell(here)
            if counted is None or here - counted.stamp > _SETTLED:
                why = self._encoders.talk.explain(here) or self._encoders.link.trouble
                silent.insert(0, f"encoders ({why})")
            if not silent:
                return
            if here > until:
                raise OSError(f"nothing new from {', '.join(silent)} in {WARM_UP:g} s")
            time.sleep(dt)

    def _silent(self, name: str, here: float) -> bool:
        word = self._slots[name].read()
        return word is None or here - word.stamp > _SETTLED

    def read(self, now: float) -> Sense:
        slots = self._slots  # before the time: what is posted after it would be of an age below 0
        current, acting, error, told = slots["servo"].read()
        fx, fy, fz, tx, ty, tz, weighed = slots["load_cell"].read()
        brake, measured = slots["brake"].read()
        e_stop, limit_switch, looked = slots["inputs"].read()
        # A brake that can no longer be told anything is as lost as one that says nothing.
        measured = min(measured, slots["analog_done"].read().stamp)
        here = self._bridge.turn()
        motor, shaft, counted = self._encoders.tell(here)
        return Sense(
            EncoderSense(motor, shaft, here - counted),
            ServoSense(current, acting, error, here - told),
            WrenchSense(fx, fy, fz, tx, ty, tz, here - weighed),
            BrakeSense(brake, here - measured),
            PanelSense(e_stop, limit_switch, here - looked),
        )

    def write(self, command: Command) -> None:
        _, _, volts, _, current, enable, _, _, brake_current, _, _, _ = command
        config, here = self._config, time.monotonic()
        torque = current * config.torque_per_ampere
        velocity, output = 0.0, self._rest
        if config.analog == 0:
            velocity = volts * config.velocity_per_volt
        elif enable == 1:
            output = analog_command.to_volts(config.output, volts).volts
        self._slots["set_point"].post(SetPoint(velocity, torque, enable, here))
        brake = clamp(brake_current, 0.0, config.brake_most)
        self._slots["analog"].post(Analog(output, brake, here))

    def stop(self, reason: int) -> None:
        self._release()

    def close(self) -> None:
        self._encoders.link.close()

    def _release(self) -> None:
        here = time.monotonic()
        self._slots["set_point"].post(SetPoint(0.0, 0.0, 0, here))
        self._slots["analog"].post(Analog(self._rest, 0.0, here))


def connect(config: dict[str, Any], dt: float) -> BenchDevices:
    """The devices for what `rig.execution.hardware.bench_job` makes."""
    made: Config = handover.loads(Config, config["devices"])
    slots = {name: Mailbox(fd, SLOTS[name]) for name, fd in config["mailboxes"].items()}
    encoders = streams.made("encoders", config["encoders"], slots)
    return BenchDevices(made, encoders, slots)
