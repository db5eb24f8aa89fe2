"""The WaveBot's own reasons of a stop."""

from rig.realtime.reasons import StopReason, reasons_of


class WaveBotReason(StopReason):
    """Numbers of the reasons."""

    STALE_LOAD_CELL = 9, 1, "the load cells' values were too old"
    STALE_ANALYSER = 10, 1, "the power analyser's values were too old"
    STALE_STATOR = 11, 1, "the stator's position was too old"
    ROTOR_TRAVEL = 18, 1, "the magnetic spring's rotor reached its travel limit"
    POSITION_DISAGREES = 19, 0, "encoder and string pot disagreed"
    STATOR_LATE = 20, 1, "the stator (or the drive) was not ready in time"
    SPRING_STROKE = 24, 1, "the stroke at which the magnetic spring's stator force reverses"
    BUS_UNDERVOLTAGE = 25, 0, "the drive's DC bus ran out of energy"
    BUS_OVERVOLTAGE = 26, 0, "the drive's DC bus took more than the dump resistors burn"
    SURGE_STALE_ENCODER = 27, 0, "the surge encoder's value was too old"
    SURGE_STALE_DRIVE = 28, 0, "the surge drive's values were too old"
    SURGE_DRIVE_FAULT = 29, 0, "the surge drive reported a fault"
    SURGE_DRIVE_DROPPED = 30, 0, "the surge drive switched its power off by itself"
    SURGE_POSITION = 31, 1, "the position limit of surge was reached"
    SURGE_VELOCITY = 32, 1, "the velocity limit of surge was reached"
    SURGE_ENCODER_JUMP = 33, 0, "the surge encoder jumped: it slipped or lost counts"
    SURGE_CURRENT_DISAGREES = 43, 0, "the surge drive's current was not the commanded one"


REASONS = reasons_of(WaveBotReason)
