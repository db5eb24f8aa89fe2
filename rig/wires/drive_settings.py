"""The settings of a rig's drives that do not depend on their bus, derived from the wiring."""

from collections.abc import Mapping
from typing import Any

from drivers.cia402 import homing, profile_position, scaling, state_machine
from drivers.cia402.arming import SetupError
from drivers.cia402.drive_objects import BY_NAME
from drivers.cia402.homing_run import PERIOD_S, HomingSettings
from drivers.cia402.positioning_drive import PositioningSettings
from drivers.cia402.torque_drive import TorqueDriveSettings
from rig.config.wiring import Actuator, Drive, TorqueDrive

SETUP_TIMEOUT_S = 30.0  # s, without homing
_NO_SCALE = scaling.CurrentScale(0.0, 0.0, 0)  # until the scale has been read from the drive
_RESET_TICKS = 20
_SCALE_OBJECTS = {
    "amc": "amc_peak_current",
    "rated_torque": "rated_torque",
    "rated_current": "rated_current",
}


def scale_objects(drive: Drive) -> list[list[Any]]:
    """Return name, index, sub and type of the objects that give a drive's current scale."""
    if not isinstance(drive, TorqueDrive):
        return []
    entry = BY_NAME[_SCALE_OBJECTS[drive.scaling]]
    return [[entry.name, entry.object, entry.sub, entry.type]]


def ready_timeout(drives: Mapping[str, Drive]) -> float:
    """Return the time (s) in which drives must be set up and homed."""
    actuators = [drive for drive in drives.values() if isinstance(drive, Actuator)]
    return SETUP_TIMEOUT_S + sum(each.homing_s for each in actuators if each.homing)


def power_machine(drive: Drive, tick: float) -> state_machine.Params:
    """Return the CiA 402 power machine of a drive for a period ``tick`` (s)."""
    times = drive.deadlines
    step = max(2, round(times.transition_s / tick))
    ramp, boot = max(2, round(times.ramp_s / tick)), max(2, round(times.boot_s / tick))
    reset = max(1, round(_RESET_TICKS * 1e-3 / tick))
    limits = state_machine.Deadlines(
        nothing=0, boot=boot, shutdown=step, switch_on=step, enable=step, mode=step, follow=step,
        disable_voltage=step, quick_stop=step, ramp_end=ramp, fault_reaction=ramp,
        fault_reset=max(step, 4 * reset),
    )  # fmt: skip
    params = state_machine.Params(
        times.stale_s, int(drive.mode_first), int(drive.follows), 0, reset, limits
    )
    problems = state_machine.find_problems(params)
    if problems:
        raise SetupError("; ".join(problems))
    return params


def homing_settings(drive: Drive) -> HomingSettings | None:
    """Return power machine and deadlines of a drive's homing; None: it has none."""
    if not isinstance(drive, Actuator):
        return None
    ticks = round(drive.homing_s / PERIOD_S)
    transition = round(drive.deadlines.transition_s / PERIOD_S) + 1
    return HomingSettings(power_machine(drive, PERIOD_S), homing.Params(transition, ticks))


def current_scales(
    drives: Mapping[str, Drive], torque_constants: Mapping[str, float]
) -> dict[str, Any]:
    """Return what `rig.wires.drive_axes.current_scale` needs of each torque drive.

    ``torque_constants``: N m/A of the motors by drive, for those scaled by the rated torque.
    """
    return {
        name: {
            "kind": drive.scaling,
            "kt": torque_constants.get(name, 0.0),
            "limit": drive.current_limit_a,
        }
        for name, drive in drives.items()
        if isinstance(drive, TorqueDrive)
    }


def torque_settings(drive: TorqueDrive, dt: float, slow_divider: int) -> TorqueDriveSettings:
    """Return the loop's settings of a torque drive; its current scale is read from it later.

    ``slow_divider``: ticks of ``dt`` (s) between two mode displays.
    """
    per_count = tuple(scale * drive.analog_v_per_count for scale in drive.analog_per_v)
    max_age = drive.deadlines.stale_s + 2.0 * slow_divider * dt
    return TorqueDriveSettings(power_machine(drive, dt), _NO_SCALE, max_age, per_count)


def positioning_settings(actuator: Actuator, slow: float) -> PositioningSettings:
    """Return the loop's settings of an actuator; ``slow``: s between two commands to it."""
    low, high = sorted(
        round(percent * actuator.counts_per_percent) + actuator.zero_counts
        for percent in (actuator.low_percent, actuator.high_percent)
    )
    return PositioningSettings(
        power_machine(actuator, slow),
        profile_position.Params(
            actuator.window_counts,
            max(1, round(actuator.stand_s / slow)),
            1,
            max(2, round(actuator.deadlines.transition_s / slow)),
            round(actuator.move_s / slow),
        ),
        scaling.position_scale(actuator.counts_per_percent, actuator.zero_counts, low, high),
        actuator.velocity,
    )
