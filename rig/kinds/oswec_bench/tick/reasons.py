"""The bench's own reasons of a stop."""

from rig.realtime.reasons import StopReason, reasons_of


class BenchReason(StopReason):
    """Numbers of the reasons."""

    STALE_LOAD_CELL = (
        9,
        1,
        "the load cells' values were too old",
        "Check the load cell's supply and cable; `rig devices` lists what answers.",
    )
    BRAKE_LOST = (
        37,
        1,
        "the brake's current was not the commanded one",
        "Check the brake's supply and amplifier.",
    )
    STALE_BRAKE = (
        38,
        1,
        "the brake's current was too old",
        "Check the terminal that reads the brake's current.",
    )
    COUPLING_SLIP = (
        39,
        0,
        "motor and shaft differed by more than the possible driveline twist",
        "Tighten the couplings, then check both encoders' zeros.",
    )
    LOAD_CELL_OVERLOAD = (
        40,
        0,
        "the load cell was loaded beyond its range",
        "Unload the cell, check its zero, and use a smaller torque.",
    )
    SHAFT_ENCODER_JUMP = (
        41,
        0,
        "the shaft's encoder jumped: it slipped or lost counts",
        "Check coupling, cable and shield of the encoder.",
    )
    VELOCITY_DISAGREES = (
        44,
        0,
        "the motor did not turn at the commanded velocity",
        "Check the servo's mode, gains and limits; compare both velocities by `rig plot`.",
    )


REASONS = reasons_of(BenchReason)
