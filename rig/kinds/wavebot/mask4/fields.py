"""Table that maps fields of the MASK4 data structure to log fields.

Field names are those that the test's own scripts read (public fbWecCntrl repository,
MASK4/MHKDRCode). The used gains are in `heaveSignals` in the MASK4 report (Sandia), 3.2.3, and in
`expParamSignals` in the scripts. Forces are forces on the body in both formats. The power of the
analyser's AC side and the slew force have the opposite sign in MASK4 (its spring map flips the
slew force).
"""

import math
from typing import NamedTuple

ROTOR_ZERO = math.radians(542.5)  # rad, MASK4 rotor angle of the body at rest
TTL_HIGH = 10.0  # V, trigger on; the MASK4 scripts compare with 5 V
NEWTONS_PER_AMPERE = 6.1745 * 12.4666
"""Heave, N/A: MASK4 "force from current" divided by drive current."""
METRES_PER_INCH = 0.0254
SAMPLE_RATE = 200.0  # Hz, of the MASK4 slow scope; the scripts count samples at this rate

RIG_BUS = "rigSignals"
"""Additional bus of exported files: row, phase, attempt and incomplete mark of each sample, and the
start of the run."""

STARTED = "startedUtc_s"
"""Field of that bus: UTC of run time zero, s since 1970. The scripts read no field of that bus; one
that they know, `setpointSignals.systemTime_ns`, would have another clock (TAI)."""

LEFT_OUT = "leftOut"
"""Field of that bus in exports for the scripts: samples left out so far, which are no lost ones."""

ROW_BUS = "rigRows"
"""Additional bus of exported files: a line for each complete row, with its set point, its mean
powers (W, negative is absorbed) and their uncertainties, by the names of the row table."""


class FieldMapping(NamedTuple):
    """One field: MASK4 value = factor * logged value + offset."""

    bus: str
    name: str
    log_field: str
    factor: float = 1.0
    offset: float = 0.0
    drive: str = ""  # the field exists only with this drive: `cots` or `custom`

    @property
    def path(self) -> str:
        """Bus and name as in MATLAB: `bus.name`."""
        return f"{self.bus}.{self.name}"


FIELDS = (
    FieldMapping("heaveSignals", "heaveEncPos_m", "heave.estimate.position"),
    FieldMapping("heaveSignals", "heaveEncVel_m_s", "heave.estimate.velocity"),
    FieldMapping("heaveSignals", "heaveForceI_N", "heave.sense.current", NEWTONS_PER_AMPERE),
    FieldMapping("heaveSignals", "heaveForceTRS_N", "load.trs"),
    FieldMapping("heaveSignals", "heaveForceLCB_N", "load.lcb"),
    FieldMapping("expParamSignals", "heaveKpUsed", "heave.demand.kp"),
    FieldMapping("expParamSignals", "heaveKiUsed", "heave.demand.ki"),
    FieldMapping("refSignals", "heaveRefRaw_N", "heave.demand.force"),
    FieldMapping("refSignals", "dcBusVoltage_V", "drive_command.settings.bus_voltage"),
    FieldMapping("magSpringSignals", "forceStatorA_N", "load.stator_a"),
    FieldMapping("magSpringSignals", "forceStatorB_N", "load.stator_b"),
    FieldMapping("magSpringSignals", "forceSlew_N", "load.slew", -1.0),
    FieldMapping("magSpringSignals", "nanoRatePos_percent", "spring_sense.position"),
    FieldMapping("magSpringSignals", "rotorAngleEQN437_rad", "load.rotor_angle", 1.0, ROTOR_ZERO),
    FieldMapping("magSpringSetpointSignals", "targetSpring_N_m", "spring_command.rate"),
    FieldMapping("hbmSignals", "heaveDriveOutSumP", "power.ac", -1.0),
    FieldMapping("hbmSignals", "heaveDriveInP", "power.dc", drive="cots"),
    FieldMapping("hbmSignals", "expDriveInP", "power.dc", drive="custom"),
    FieldMapping(
        "toDriveSGSignals", "switchingPeriod_s", "drive_command.settings.switching_period",
        drive="custom",
    ),
    FieldMapping(
        "toDriveSGSignals", "velThreshold_m_s", "drive_command.settings.velocity_threshold",
        drive="custom",
    ),
    FieldMapping("fromDriveSGSignals", "voltageDC_V", "power_sense.bus_voltage", drive="custom"),
    FieldMapping(
        "fromDriveSGSignals", "heaveEncVel_m_s", "heave.estimate.velocity", drive="custom",
    ),
    FieldMapping("fromDriveSGSignals", "currentQ_A", "heave.sense.current", drive="custom"),
)  # fmt: skip


class ScriptUnits(NamedTuple):
    """Factors of a rig for fields that only the scripts and the report have."""

    gear_ratio: float = 12.4666  # rad of the shaft per m of heave
    turns_per_percent: float = 7.5  # turns of the stator's motor per % of its travel
    metres_per_percent: float = 0.0015  # of the stator per % of its travel


def script_fields(units: ScriptUnits) -> tuple[FieldMapping, ...]:
    """Return the fields that an export for the scripts has besides `FIELDS`.

    The slew angle is what the scripts subtract from the rotor's. It is 0: the logged rotor angle is
    relative to the stator, which the slew load cell holds at rest.
    """
    turns, inches = units.turns_per_percent, units.metres_per_percent / METRES_PER_INCH
    position, rate = "spring_sense.position", 1.0 / units.gear_ratio
    return (
        FieldMapping("heaveSignals", "heaveKpUsed", "heave.demand.kp"),
        FieldMapping("heaveSignals", "heaveKiUsed", "heave.demand.ki"),
        FieldMapping(
            "heaveSignals", "heaveEncVel_rad_s", "heave.estimate.velocity", units.gear_ratio
        ),
        FieldMapping("heaveSignals", "heaveForceTRS_N_m", "load.trs", rate),
        FieldMapping("magSpringSignals", "nanoRatePos_rev", position, turns),
        FieldMapping("magSpringSignals", "nanoRatePos_inch", position, inches),
        FieldMapping("magSpringSignals", "slewSpAngle_deg", "load.rotor_angle", 0.0),
    )


TIMED_BUSES = (
    "heaveSignals",
    "magSpringSignals",
    "hbmSignals",
    "toDriveSGSignals",
    "fromDriveSGSignals",
)
"""Buses with their own time; the others share the time of `heaveSignals`."""

PLAN_FIELDS = ("plan.row", "plan.phase", "plan.attempt")

REQUIRED = (
    *("heaveSignals.time", "heaveSignals.heaveEncPos_m", "heaveSignals.heaveEncVel_m_s"),
    *("expParamSignals.heaveKpUsed", "expParamSignals.heaveKiUsed"),
)
"""Fields without which a file holds no run."""

ALTERNATIVE_PATHS = {
    "expParamSignals.heaveKpUsed": "heaveSignals.heaveKpUsed",
    "expParamSignals.heaveKiUsed": "heaveSignals.heaveKiUsed",
}
"""Fields of the scripts, and where the report has them."""
