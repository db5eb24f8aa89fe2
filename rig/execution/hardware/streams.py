"""The bench's devices that speak by themselves or are spoken to byte by byte.

Each is made of what the rig file says of it, as JSON values, and of the few scales that stand
elsewhere in that file.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from drivers.compax3 import servo_signals
from drivers.compax3.codec import NO_ADDRESS, Object
from drivers.compax3.objects import Channel
from drivers.compax3.requests import Timing
from drivers.compax3.servo import Servo
from drivers.compax3.values import Form
from drivers.conversation import Conversation
from drivers.encoder import bridge_reader, unwrap
from drivers.encoder.bridge_reader import BridgeReader
from drivers.encoder.ssi import Protocol
from drivers.force_torque import net_ft, net_reader, wrench
from drivers.force_torque.net_reader import NetReader
from drivers.serial_link import SerialLink
from drivers.serial_link import Settings as SerialSettings
from drivers.udp_link import Settings as UdpSettings
from drivers.udp_link import UdpLink
from rig.execution.hardware.messages import Encoders, Load, SetPoint
from rig.execution.hardware.messages import Servo as ServoWord
from rig.processes.mailbox import Mailbox

NEVER = 1e8  # s: older is what has never come
_BITS = {"net_ft": net_ft.NET_FT_BITS, "axia": net_ft.AXIA_BITS}


class Stream(NamedTuple):
    """One device, its wire, and what it and the loop tell each other."""

    link: SerialLink | UdpLink
    talk: Conversation
    tell: Callable[[float], Any]  # its word at a time (s); None before there is one
    hear: Callable[[float], None]  # take the loop's word
    leave: Callable[[float], None]  # what must be wanted before the line is given back


def _nothing(now: float) -> None:
    """A device that is told nothing."""


def made(kind: str, told: dict[str, Any], slots: dict[str, Mailbox]) -> Stream:
    """The stream of a companion; CodecError for what cannot be."""
    return {"encoders": encoders, "servo": servo, "load_cell": load_cell}[kind](told, slots)


def encoders(told: dict[str, Any], slots: dict[str, Mailbox]) -> Stream:
    """The bridge; ``told`` has beside its wiring `motor_counts` and `shaft_counts` of one turn."""
    motor, shaft = told["motor_counts"], told["shaft_counts"]
    reader = BridgeReader(
        bridge_reader.Settings(
            "encoder bridge",
            _encoder(told["motor"], motor),
            _encoder(told["shaft"], shaft),
            told["least_delay_s"],
            told["window_s"],
            told["silent_s"],
        )
    )
    per_motor, per_shaft = motor / math.tau, shaft / math.tau

    def tell(now: float) -> Encoders | None:
        one, other = reader.read(now)
        age = max(one.age, other.age)
        if age > NEVER:
            return None
        return Encoders(round(one.angle * per_motor), round(other.angle * per_shaft), now - age)

    return Stream(_serial("encoder bridge", told), reader, tell, _nothing, _nothing)


def _encoder(told: dict[str, Any], counts: int) -> bridge_reader.Channel:
    turns = unwrap.Params(counts, told["most_rad_per_s"], told["slack_counts"])
    return bridge_reader.Channel(Protocol[told["protocol"]], turns, float(told["direction"]))


def servo(told: dict[str, Any], slots: dict[str, Mailbox]) -> Stream:
    """The servo drive; ``told`` has beside its wiring the `loop`: velocity or torque.

    Only a word of the loop that was not taken yet renews the set-point: a loop that is gone takes
    the drive down.
    """
    drive = Servo(servo_settings(told))
    torque, wanted = told["loop"] == "torque", slots.get("set_point")
    last = -math.inf

    def tell(now: float) -> ServoWord | None:
        said = drive.read(now)
        if said.age > NEVER:
            return None
        return ServoWord(said.values[0], said.acting, said.error, now - said.age)

    def hear(now: float) -> None:
        nonlocal last
        word: SetPoint | None = wanted.read() if wanted is not None else None
        if word is not None and word.stamp > last:
            last = word.stamp
            drive.command(word.torque if torque else word.velocity, word.enable, now)

    def leave(now: float) -> None:
        drive.command(0.0, 0, now)

    return Stream(_serial("servo drive", told), drive, tell, hear, leave)


def servo_settings(told: dict[str, Any]) -> servo_signals.Settings:
    """What the conversation with the drive is told."""
    torque = told["loop"] == "torque"
    return servo_signals.Settings(
        "servo drive",
        address_of(told),
        told["identity"],
        channel(told["control"]),
        told["enabled_word"],
        channel(told["status"]),
        channel(told["error"]),
        channel(told["torque" if torque else "velocity"]),
        (channel(told["current"]),),
        told["most_n_m" if torque else "most_rad_per_s"],
        told["expiry_s"],
        told["stale_s"],
        told["rising_s"],
        Timing(told["answer_s"], told["quiet_s"]),
    )


def address_of(told: dict[str, Any]) -> int:
    """The drive's address on its line."""
    return NO_ADDRESS if told["address"] is None else int(told["address"])


def channel(told: dict[str, Any]) -> Channel:
    """How a quantity stands in the drive."""
    return Channel(Object(told["index"], told["sub"]), Form[told["form"]], told["per_unit"])


def load_cell(told: dict[str, Any], slots: dict[str, Mailbox]) -> Stream:
    """The load cell; its stream begins with a stop, whoever had it before."""
    reader = NetReader(
        net_reader.Settings(
            "load cell",
            wrench.scale(
                told["counts_per_force"],
                told["counts_per_torque"],
                told["force_unit"],
                told["torque_unit"],
            ),
            _BITS[told["model"]],
            0,
            told["rate_hz"],
            told["quiet_s"],
            told["silence_s"],
        )
    )
    turned = -1.0 if told["turned_over"] else 1.0

    def tell(now: float) -> Load | None:
        (fx, fy, fz, tx, ty, tz), age, _, _, _ = reader.read(now)
        if age > NEVER:
            return None
        return Load(fx, turned * fy, turned * fz, tx, turned * ty, turned * tz, now - age)

    link = UdpLink(UdpSettings("load cell", told["host"], told["port"]))
    return Stream(link, reader, tell, _nothing, _nothing)


def _serial(device: str, told: dict[str, Any]) -> SerialLink:
    return SerialLink(
        SerialSettings(
            device,
            told["port"],
            told["baud"],
            told["parity"],
            told["stop_bits"],
            int(told["rts_cts"]),
            int(told["echo"]),
            int(told["low_latency"]),
        )
    )
