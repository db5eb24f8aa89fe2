"""Settings and readings of the conversation with a servo drive."""

from enum import IntEnum
from typing import NamedTuple

from drivers.compax3.objects import ObjectChannel
from drivers.compax3.requests import Timing

NOT_READ = -1


class Phase(IntEnum):
    """Phase of the conversation."""

    UNKNOWN = 0  # the drive is not identified
    OFF = 1
    ENABLING = 2  # enable requested, not confirmed by the status yet
    ON = 3


class ServoSettings(NamedTuple):
    """One drive. Channels have no default, because the objects of a drive are not confirmed."""

    name: str  # for people
    address: int  # 0 to 99, or codec.NO_ADDRESS
    identity: str  # required start of the drive's name
    control: ObjectChannel  # control word 1
    enabled: int  # control word that powers the axis and lets it move: what the stop bits mean
    #               differs between sources (objects.ENABLED: clearing one stops)
    status: ObjectChannel  # status word 1
    error: ObjectChannel  # last error
    set_point: ObjectChannel  # velocity (rad/s) or torque (N m)
    actual: tuple[
        ObjectChannel, ...
    ]  # read cyclically with the status; formats of one family with it
    limit: float  # largest magnitude of a set-point, SI, > 0
    set_point_timeout: float  # s without a new set-point until the drive is disabled, > 0
    max_status_age: float  # s, age of the status from which the drive is disabled, > 0
    enable_timeout: float  # s from the enable request to the status that confirms it, > 0
    timing: Timing


class ServoReading(NamedTuple):
    """The drive's last status and values."""

    values: tuple[float, ...]  # SI, in the order of Settings.actual; 0 before the first
    powered: int  # 1: the axis has power according to the status
    acting: int  # 1: powered by our request, and set-points are sent
    error: int  # error number while the drive is in error (NOT_READ: not read yet), else 0
    limited: int  # 1: the last set-point was clamped to the limit
    age: float  # s since the values were requested; very large before the first
    phase: Phase
