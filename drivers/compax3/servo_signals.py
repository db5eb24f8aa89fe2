"""What a servo drive's conversation is told before it begins, and what it gives."""

from enum import IntEnum
from typing import NamedTuple

from drivers.compax3.objects import Channel
from drivers.compax3.requests import Timing

NOT_READ = -1


class Phase(IntEnum):
    """Where the conversation stands."""

    UNKNOWN = 0  # not named yet, or not any more
    OFF = 1
    RISING = 2  # asked up, and the status does not say so yet
    ON = 3


class Settings(NamedTuple):
    """One drive. Channels have no default: which objects a drive has is not confirmed."""

    name: str  # for people
    address: int  # 0 to 99, or codec.NO_ADDRESS
    identity: str  # what its name must begin with
    control: Channel  # control word 1
    enabled: int  # control word that powers the axis and lets it move: what the stop bits mean
    #               differs between sources (objects.ENABLED: clearing one stops)
    status: Channel  # status word 1
    error: Channel  # last error
    set_point: Channel  # velocity (rad/s) or torque (N m)
    actual: tuple[Channel, ...]  # read cyclically with the status; formats of one family with it
    limit: float  # magnitude that no set-point exceeds, in SI, > 0
    expiry: float  # s, in which a set-point must be renewed, > 0
    stale: float  # s, age of the status from which the drive is taken down, > 0
    rising: float  # s, in which an axis that is asked up must say so, > 0
    timing: Timing


class Reading(NamedTuple):
    """What the drive said last."""

    values: tuple[float, ...]  # SI, in the order of Settings.actual; 0 before the first
    powered: int  # 1: the status says that the axis has power
    acting: int  # 1: powered by our request, and set-points go out
    error: int  # its error number while it is in error (NOT_READ: not read yet), else 0
    held: int  # 1: the last set-point was cut to the limit
    age: float  # s, since the values were asked for; very large before the first
    phase: Phase
