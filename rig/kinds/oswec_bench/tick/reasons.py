"""The bench's own reasons of a stop."""

from rig.realtime.reasons import StopReason, reasons_of


class BenchReason(StopReason):
    """Numbers of the reasons."""

    STALE_LOAD_CELL = 9, 1, "the load cells' values were too old"
    BRAKE_LOST = 37, 1, "the brake's current was not the commanded one"
    STALE_BRAKE = 38, 1, "the brake's current was too old"
    COUPLING_SLIP = 39, 0, "motor and shaft differed by more than the possible driveline twist"
    LOAD_CELL_OVERLOAD = 40, 0, "the load cell was loaded beyond its range"
    SHAFT_ENCODER_JUMP = 41, 0, "the shaft's encoder jumped: it slipped or lost counts"
    VELOCITY_DISAGREES = 44, 0, "the motor did not turn at the commanded velocity"


REASONS = reasons_of(BenchReason)
