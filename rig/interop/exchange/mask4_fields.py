"""One table: which field of the MASK4 data structure is which log field here.

Field names as the test's own scripts read them (public fbWecCntrl repository, MASK4/MHKDRCode;
the MASK4 report (Sandia), 3.2.3 has the used gains in `heaveSignals`, the scripts in
`expParamSignals`). Forces are forces on the body on both sides; power of the analyser's AC side has
the other sign there, and so has the slew force (their spring map flips it).
"""

import math
from typing import NamedTuple

ROTOR_ZERO = math.radians(542.5)  # rad, of their rotor angle where the body is at rest
TTL_HIGH = 10.0  # V, of a trigger that is on; their scripts ask for more than 5
KT_N = 6.1745 * 12.4666  # N/A, of heave: their force "from current" over it is drive current
RATE = 200.0  # Hz, of their slow scope; their scripts count samples by it

OWN = (
    "rigSignals"  # a bus of ours beside theirs: row, phase and attempt of each sample, and its mark
)


class Field(NamedTuple):
    """One field: theirs = factor ours + offset."""

    bus: str
    name: str
    leaf: str  # of our log
    factor: float = 1.0
    offset: float = 0.0
    drive: str = ""  # only with this drive: `cots` or `custom`

    @property
    def path(self) -> str:
        """Bus and name as MATLAB writes them."""
        return f"{self.bus}.{self.name}"


FIELDS = (
    Field("heaveSignals", "heaveEncPos_m", "heave.estimate.position"),
    Field("heaveSignals", "heaveEncVel_m_s", "heave.estimate.velocity"),
    Field("heaveSignals", "heaveForceI_N", "heave.sense.current", KT_N),
    Field("heaveSignals", "heaveForceTRS_N", "load.trs"),
    Field("heaveSignals", "heaveForceLCB_N", "load.lcb"),
    Field("expParamSignals", "heaveKpUsed", "heave.demand.kp"),
    Field("expParamSignals", "heaveKiUsed", "heave.demand.ki"),
    Field("refSignals", "heaveRefRaw_N", "heave.demand.force"),
    Field("refSignals", "dcBusVoltage_V", "drive_command.settings.bus_voltage"),
    Field("magSpringSignals", "forceStatorA_N", "load.stator_a"),
    Field("magSpringSignals", "forceStatorB_N", "load.stator_b"),
    Field("magSpringSignals", "forceSlew_N", "load.slew", -1.0),
    Field("magSpringSignals", "nanoRatePos_percent", "spring_sense.position"),
    Field("magSpringSignals", "rotorAngleEQN437_rad", "load.rotor_angle", 1.0, ROTOR_ZERO),
    Field("magSpringSetpointSignals", "targetSpring_N_m", "spring_command.rate"),
    Field("hbmSignals", "heaveDriveOutSumP", "power.ac", -1.0),
    Field("hbmSignals", "heaveDriveInP", "power.dc", drive="cots"),
    Field("hbmSignals", "expDriveInP", "power.dc", drive="custom"),
    Field(
        "toDriveSGSignals", "switchingPeriod_s", "drive_command.settings.switching_period",
        drive="custom",
    ),
    Field(
        "toDriveSGSignals", "velThreshold_m_s", "drive_command.settings.velocity_threshold",
        drive="custom",
    ),
    Field("fromDriveSGSignals", "voltageDC_V", "power_sense.bus_voltage", drive="custom"),
    Field("fromDriveSGSignals", "heaveEncVel_m_s", "heave.estimate.velocity", drive="custom"),
    Field("fromDriveSGSignals", "currentQ_A", "heave.sense.current", drive="custom"),
)  # fmt: skip

TIMED = ("heaveSignals", "magSpringSignals", "hbmSignals", "toDriveSGSignals", "fromDriveSGSignals")
"""Buses with a time of their own; the others are on that of `heaveSignals`."""

PLACE = ("plan.row", "plan.phase", "plan.attempt")

NEEDED = (
    *("heaveSignals.time", "heaveSignals.heaveEncPos_m", "heaveSignals.heaveEncVel_m_s"),
    *("expParamSignals.heaveKpUsed", "expParamSignals.heaveKiUsed"),
)
"""Without these a file holds no run."""

ELSEWHERE = {
    "expParamSignals.heaveKpUsed": "heaveSignals.heaveKpUsed",
    "expParamSignals.heaveKiUsed": "heaveSignals.heaveKiUsed",
}
"""Where the report has what the scripts read in another bus."""
