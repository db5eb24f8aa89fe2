"""The WaveBot's own reasons of a stop."""

from enum import IntEnum

from rig.realtime.reasons import trip_reason


class WaveBotReason(IntEnum):
    """Numbers of the reasons."""

    STALE_LOAD_CELL = 9
    STALE_ANALYSER = 10
    STALE_STATOR = 11
    ROTOR_TRAVEL = 18
    POSITION_DISAGREES = 19
    STATOR_LATE = 20
    SPRING_STROKE = 24
    BUS_UNDERVOLTAGE = 25
    BUS_OVERVOLTAGE = 26
    SURGE_STALE_ENCODER = 27
    SURGE_STALE_DRIVE = 28
    SURGE_DRIVE_FAULT = 29
    SURGE_DRIVE_DROPPED = 30
    SURGE_POSITION = 31
    SURGE_VELOCITY = 32
    SURGE_ENCODER_JUMP = 33
    SURGE_CURRENT_DISAGREES = 43


_NUMBER_CATEGORY_TEXT = (
    (WaveBotReason.STALE_LOAD_CELL, 1, "the load cells' values were too old"),
    (WaveBotReason.STALE_ANALYSER, 1, "the power analyser's values were too old"),
    (WaveBotReason.STALE_STATOR, 1, "the stator's position was too old"),
    (WaveBotReason.ROTOR_TRAVEL, 1, "the magnetic spring's rotor reached its travel limit"),
    (WaveBotReason.POSITION_DISAGREES, 0, "encoder and string pot disagreed"),
    (WaveBotReason.STATOR_LATE, 1, "the stator (or the drive) was not ready in time"),
    (
        WaveBotReason.SPRING_STROKE,
        1,
        "the stroke at which the magnetic spring's stator force reverses",
    ),
    (WaveBotReason.BUS_UNDERVOLTAGE, 0, "the drive's DC bus ran out of energy"),
    (WaveBotReason.BUS_OVERVOLTAGE, 0, "the drive's DC bus took more than the dump resistors burn"),
    (WaveBotReason.SURGE_STALE_ENCODER, 0, "the surge encoder's value was too old"),
    (WaveBotReason.SURGE_STALE_DRIVE, 0, "the surge drive's values were too old"),
    (WaveBotReason.SURGE_DRIVE_FAULT, 0, "the surge drive reported a fault"),
    (WaveBotReason.SURGE_DRIVE_DROPPED, 0, "the surge drive switched its power off by itself"),
    (WaveBotReason.SURGE_POSITION, 1, "the position limit of surge was reached"),
    (WaveBotReason.SURGE_VELOCITY, 1, "the velocity limit of surge was reached"),
    (WaveBotReason.SURGE_ENCODER_JUMP, 0, "the surge encoder jumped: it slipped or lost counts"),
    (
        WaveBotReason.SURGE_CURRENT_DISAGREES,
        0,
        "the surge drive's current was not the commanded one",
    ),
)
REASONS = tuple(trip_reason(*entry) for entry in _NUMBER_CATEGORY_TEXT)
