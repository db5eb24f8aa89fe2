"""The bench's own reasons of a stop."""

from enum import IntEnum

from rig.realtime.reasons import trip_reason


class BenchReason(IntEnum):
    """Numbers of the reasons."""

    STALE_LOAD_CELL = 9
    BRAKE_LOST = 37
    STALE_BRAKE = 38
    COUPLING_SLIP = 39
    LOAD_CELL_OVERLOAD = 40
    SHAFT_ENCODER_JUMP = 41
    VELOCITY_DISAGREES = 44


REASONS = (
    trip_reason(BenchReason.STALE_LOAD_CELL, 1, "the load cells' values were too old"),
    trip_reason(BenchReason.BRAKE_LOST, 1, "the brake's current was not the commanded one"),
    trip_reason(BenchReason.STALE_BRAKE, 1, "the brake's current was too old"),
    trip_reason(
        BenchReason.COUPLING_SLIP,
        0,
        "motor and shaft differed by more than the possible driveline twist",
    ),
    trip_reason(BenchReason.LOAD_CELL_OVERLOAD, 0, "the load cell was loaded beyond its range"),
    trip_reason(
        BenchReason.SHAFT_ENCODER_JUMP,
        0,
        "the shaft's encoder jumped: it slipped or lost counts",
    ),
    trip_reason(
        BenchReason.VELOCITY_DISAGREES,
        0,
        "the motor did not turn at the commanded velocity",
    ),
)
