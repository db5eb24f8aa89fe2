"""The kinds of session of a bench or a flap, and the columns that their rows have."""

from typing import Literal, NamedTuple


class SessionRequirements(NamedTuple):
    """Columns that the rows of a kind of session must and may have, and its options."""

    loop: Literal["velocity", "torque"]
    amplitude_column: str
    optional_columns: tuple[str, ...]  # in addition to amplitude and period
    required_columns: tuple[str, ...] = ()  # in addition to amplitude and period
    allows_irregular: bool = False  # the reference may be irregular
    allows_correction: bool = False  # the position may be corrected
    allows_feedback: bool = False  # the torque loop may be closed
    flap_coupling: Literal["", "free", "coupled"] = ""  # rigid coupling of the flap; "": no flap
    needs_waves: bool = False  # the amplitude is that of waves


_BRAKE_COLUMNS = ("damping_n_m_s_per_rad", "brake_current_a")
SESSION_KINDS = {
    "driveline": SessionRequirements(
        "velocity", "amplitude_deg", _BRAKE_COLUMNS, allows_irregular=True, allows_correction=True
    ),
    "velocity_constant": SessionRequirements("velocity", "amplitude_deg", ()),
    "brake_map": SessionRequirements("velocity", "amplitude_deg", ("brake_current_a",)),
    "losses": SessionRequirements("velocity", "amplitude_deg", _BRAKE_COLUMNS),
    "torque_constant": SessionRequirements("torque", "current_amplitude_a", ("brake_current_a",)),
    "torque_tracking": SessionRequirements(
        "torque", "torque_amplitude_n_m", ("brake_current_a",), allows_feedback=True
    ),
    "flap_free_decay": SessionRequirements("torque", "release_deg", (), flap_coupling="free"),
    "flap_hydrostatic": SessionRequirements(
        "velocity", "amplitude_deg", (), flap_coupling="coupled"
    ),
    "flap_rao": SessionRequirements(
        "torque",
        "wave_amplitude_m",
        (),
        allows_irregular=True,
        flap_coupling="free",
        needs_waves=True,
    ),
    "flap_pto_sweep": SessionRequirements(
        "torque",
        "wave_amplitude_m",
        (),
        ("pto_damping_n_m_s_per_rad",),
        allows_irregular=True,
        flap_coupling="coupled",
        needs_waves=True,
    ),
}
"""The requirements of each kind of session."""
