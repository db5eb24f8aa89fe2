"""The WaveBot's own reasons of a stop."""

from rig.realtime.reasons import StopReason, reasons_of


class WaveBotReason(StopReason):
    """Numbers of the reasons."""

    STALE_LOAD_CELL = (
        9,
        1,
        "the load cells' values were too old",
        "Check the amplifiers' supply and cable; `rig devices` lists what answers.",
    )
    STALE_ANALYSER = (
        10,
        1,
        "the power analyser's values were too old",
        "Check the analyser's network cable and address.",
    )
    STALE_STATOR = (
        11,
        1,
        "the stator's position was too old",
        "Check the actuator's bus and supply; `rig devices` lists what answers.",
    )
    ROTOR_TRAVEL = (
        18,
        1,
        "the magnetic spring's rotor reached its travel limit",
        "Use gains or a sea with a shorter stroke: `rig check`.",
    )
    POSITION_DISAGREES = (
        19,
        0,
        "encoder and string pot disagreed",
        "Check both sensors' zeros, scales and mounting.",
    )
    STATOR_LATE = (
        20,
        1,
        "the stator (or the drive) was not ready in time",
        "Check that the actuator moves freely: `rig home`.",
    )
    SPRING_STROKE = (
        24,
        1,
        "the stroke at which the magnetic spring's stator force reverses",
        "Use gains or a sea with a shorter stroke: `rig check`.",
    )
    BUS_UNDERVOLTAGE = (
        25,
        0,
        "the drive's DC bus ran out of energy",
        "Check the supply; use gains that need less power: `rig check` predicts the bus voltage.",
    )
    BUS_OVERVOLTAGE = (
        26,
        0,
        "the drive's DC bus took more than the dump resistors burn",
        "Check the dump resistors; use gains that absorb less power: `rig check`.",
    )
    SURGE_STALE_ENCODER = (
        27,
        0,
        "the surge encoder's value was too old",
        "Check the encoder's cable and supply; `rig devices` lists what answers.",
    )
    SURGE_STALE_DRIVE = (
        28,
        0,
        "the surge drive's values were too old",
        "Check the drive's bus and supply; `rig devices` lists what answers.",
    )
    SURGE_DRIVE_FAULT = (
        29,
        0,
        "the surge drive reported a fault",
        "Read the drive's fault code in the summary, and its manual.",
    )
    SURGE_DRIVE_DROPPED = (
        30,
        0,
        "the surge drive switched its power off by itself",
        "Check the drive's supply, its enable input and its stop chain.",
    )
    SURGE_POSITION = (
        31,
        1,
        "the position limit of surge was reached",
        "Check the mean drift force and the station keeping of surge.",
    )
    SURGE_VELOCITY = (
        32,
        1,
        "the velocity limit of surge was reached",
        "Check the damping of surge: `rig surge-damping`.",
    )
    SURGE_ENCODER_JUMP = (
        33,
        0,
        "the surge encoder jumped: it slipped or lost counts",
        "Check coupling, cable and shield of the encoder.",
    )
    SURGE_CURRENT_DISAGREES = (
        43,
        0,
        "the surge drive's current was not the commanded one",
        "Check the drive's current loop and its limits.",
    )


REASONS = reasons_of(WaveBotReason)
