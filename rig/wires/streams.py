"""The devices with wires of their own, which send by themselves or are addressed byte by byte.

Each stream is created from the device's part of the rig file, as JSON values, and from the few
scales that are elsewhere in that file.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from drivers.compax3 import servo_signals
from drivers.compax3.codec import NO_ADDRESS, Object
from drivers.compax3.objects import ObjectChannel
from drivers.compax3.requests import Timing
from drivers.compax3.servo import Servo
from drivers.compax3.values import NumberFormat
from drivers.conversation import Conversation
from drivers.encoder import bridge_reader, unwrap
from drivers.encoder.bridge_reader import BridgeReader
from drivers.encoder.ssi import SsiProtocol
from drivers.force_torque import net_ft, net_reader, wrench
from drivers.force_torque.net_reader import NetReader
from drivers.serial_link import SerialLink, SerialSettings
from drivers.udp_link import UdpLink, UdpSettings
from rig.processes.mailbox import Mailbox
from rig.wires.messages import EncodersMessage, ServoMessage, SetPointMessage, WrenchMessage

NEVER_AGE_S = 1e8  # s: a value that never came is older
_BITS = {"net_ft": net_ft.NET_FT_BITS, "axia": net_ft.AXIA_BITS}


class Stream(NamedTuple):
    """One device: its wire, its protocol, and its messages from and to the loop."""

    link: SerialLink | UdpLink
    conversation: Conversation
    read_message: Callable[[float], Any]  # the device's message at a time (s); None: none yet
    forward_command: Callable[[float], None]  # send the loop's last command on at a time (s)
    release: Callable[[float], None]  # command that must go out before the line is closed


def _do_nothing(now: float) -> None:
    """Send nothing: the device takes no commands."""


def encoder_stream(settings: dict[str, Any], slots: dict[str, Mailbox]) -> Stream:
    """Return the stream of the encoder bridge.

    ``settings``: its wiring, and `motor_counts` and `shaft_counts` of one turn.
    """
    motor, shaft = settings["motor_counts"], settings["shaft_counts"]
    reader = BridgeReader(
        bridge_reader.BridgeSettings(
            "encoder bridge",
            _encoder_channel(settings["motor"], motor),
            _encoder_channel(settings["shaft"], shaft),
            settings["least_delay_s"],
            settings["window_s"],
            settings["silent_s"],
        )
    )
    per_motor, per_shaft = motor / math.tau, shaft / math.tau

    def read_message(now: float) -> EncodersMessage | None:
        one, other = reader.read(now)
        age = max(one.age, other.age)
        if age > NEVER_AGE_S:
            return None
        return EncodersMessage(
            round(one.angle * per_motor), round(other.angle * per_shaft), now - age
        )

    return Stream(
        _serial_link("encoder bridge", settings), reader, read_message, _do_nothing, _do_nothing
    )


def _encoder_channel(settings: dict[str, Any], counts: int) -> bridge_reader.EncoderChannel:
    turns = unwrap.Params(counts, settings["most_rad_per_s"], settings["slack_counts"])
    return bridge_reader.EncoderChannel(
        SsiProtocol[settings["protocol"]], turns, float(settings["direction"])
    )


def servo_stream(settings: dict[str, Any], slots: dict[str, Mailbox]) -> Stream:
    """Return the stream of the servo drive.

    ``settings``: its wiring, and the `loop` (velocity or torque). Only a new message of the loop
    renews the set-point: without the loop the drive is switched off.
    """
    drive = Servo(servo_settings(settings))
    torque, slot = settings["loop"] == "torque", slots.get("set_point")
    last = -math.inf

    def read_message(now: float) -> ServoMessage | None:
        reading = drive.read(now)
        if reading.age > NEVER_AGE_S:
            return None
        return ServoMessage(reading.values[0], reading.acting, reading.error, now - reading.age)

    def forward_command(now: float) -> None:
        nonlocal last
        message: SetPointMessage | None = slot.read() if slot is not None else None
        if message is not None and message.stamp > last:
            last = message.stamp
            drive.command(message.torque if torque else message.velocity, message.enable, now)

    def release(now: float) -> None:
        drive.command(0.0, 0, now)

    return Stream(
        _serial_link("servo drive", settings), drive, read_message, forward_command, release
    )


def servo_settings(settings: dict[str, Any]) -> servo_signals.ServoSettings:
    """Return the settings of the conversation with the drive."""
    torque = settings["loop"] == "torque"
    return servo_signals.ServoSettings(
        "servo drive",
        NO_ADDRESS if settings["address"] is None else int(settings["address"]),
        settings["identity"],
        drive_channel(settings["control"]),
        settings["enabled_word"],
        drive_channel(settings["status"]),
        drive_channel(settings["error"]),
        drive_channel(settings["torque" if torque else "velocity"]),
        (drive_channel(settings["current"]),),
        settings["most_n_m" if torque else "most_rad_per_s"],
        settings["expiry_s"],
        settings["stale_s"],
        settings["rising_s"],
        Timing(settings["answer_s"], settings["quiet_s"]),
    )


def drive_channel(settings: dict[str, Any]) -> ObjectChannel:
    """Return the object, format and scale of a quantity in the drive."""
    return ObjectChannel(
        Object(settings["index"], settings["sub"]),
        NumberFormat[settings["form"]],
        settings["per_unit"],
    )


def load_cell_stream(settings: dict[str, Any], slots: dict[str, Mailbox]) -> Stream:
    """Return the stream of the load cell; it begins with a stop of any earlier stream."""
    reader = NetReader(
        net_reader.NetFtSettings(
            "load cell",
            wrench.make_scale(
                settings["counts_per_force"],
                settings["counts_per_torque"],
                settings["force_unit"],
                settings["torque_unit"],
            ),
            _BITS[settings["model"]],
            0,
            settings["rate_hz"],
            settings["quiet_s"],
            settings["silence_s"],
        )
    )
    sign = -1.0 if settings["turned_over"] else 1.0

    def read_message(now: float) -> WrenchMessage | None:
        (fx, fy, fz, tx, ty, tz), age, _, _, _ = reader.read(now)
        if age > NEVER_AGE_S:
            return None
        return WrenchMessage(fx, sign * fy, sign * fz, tx, sign * ty, sign * tz, now - age)

    link = UdpLink(UdpSettings("load cell", settings["host"], settings["port"]))
    return Stream(link, reader, read_message, _do_nothing, _do_nothing)


class StreamType(NamedTuple):
    """A kind of stream: its constructor, and the mailboxes of its poller."""

    create: Callable[[dict[str, Any], dict[str, Mailbox]], Stream]
    mailboxes: dict[str, type]  # the first holds the messages of the device


STREAM_TYPES = {
    "encoders": StreamType(encoder_stream, {"encoders": EncodersMessage}),
    "servo": StreamType(servo_stream, {"servo": ServoMessage, "set_point": SetPointMessage}),
    "load_cell": StreamType(load_cell_stream, {"load_cell": WrenchMessage}),
}


def create_stream(kind: str, settings: dict[str, Any], slots: dict[str, Mailbox]) -> Stream:
    """Return the stream of an I/O process or the loop; CodecError for impossible settings."""
    return STREAM_TYPES[kind].create(settings, slots)


def _serial_link(device: str, settings: dict[str, Any]) -> SerialLink:
    line = (settings[key] for key in ("port", "baud", "parity", "stop_bits"))
    flags = (int(settings[key]) for key in ("rts_cts", "echo", "low_latency"))
    return SerialLink(SerialSettings(device, *line, *flags))
