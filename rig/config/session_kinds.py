"""The kinds of session that a bench or a flap can run, and what the rows of each are made of."""

from typing import Literal, NamedTuple


class Demand(NamedTuple):
    """What the rows of a session must and may have."""

    loop: Literal["velocity", "torque"]
    amplitude: str  # the column of the amplitude
    columns: tuple[str, ...]  # those that may stand beside it and the period
    needed: tuple[str, ...] = ()  # those that must
    irregular: bool = False  # the reference may be irregular
    correction: bool = False  # the position may be corrected
    feedback: bool = False  # the torque loop may be closed
    flap: Literal["", "free", "coupled"] = ""  # it needs a flap, its rigid coupling out or in
    waves: bool = False  # the amplitude is that of waves


_BRAKED = ("damping_n_m_s_per_rad", "brake_current_a")
SESSIONS = {
    "driveline": Demand("velocity", "amplitude_deg", _BRAKED, irregular=True, correction=True),
    "velocity_constant": Demand("velocity", "amplitude_deg", ()),
    "brake_map": Demand("velocity", "amplitude_deg", ("brake_current_a",)),
    "losses": Demand("velocity", "amplitude_deg", _BRAKED),
    "torque_constant": Demand("torque", "current_amplitude_a", ("brake_current_a",)),
    "torque_tracking": Demand(
        "torque", "torque_amplitude_n_m", ("brake_current_a",), feedback=True
    ),
    "flap_free_decay": Demand("torque", "release_deg", (), flap="free"),
    "flap_hydrostatic": Demand("velocity", "amplitude_deg", (), flap="coupled"),
    "flap_rao": Demand("torque", "wave_amplitude_m", (), irregular=True, flap="free", waves=True),
    "flap_pto_sweep": Demand(
        "torque",
        "wave_amplitude_m",
        (),
        ("pto_damping_n_m_s_per_rad",),
        irregular=True,
        flap="coupled",
        waves=True,
    ),
}
"""The kinds of session, each with what its rows are made of."""
