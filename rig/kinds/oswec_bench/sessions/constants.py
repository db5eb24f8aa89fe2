"""The constants that a session uses: measured ones where there are any, else the rig's nominal
ones.
"""

from collections.abc import Iterable
from typing import NamedTuple

from rig.kinds.oswec_bench.config.constants_file import BrakeMap, ConstantsFile
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.session_file import SessionFile

NOMINAL = "the rig file, nominal"


class Constants(NamedTuple):
    """Scales of commands, all at the gearbox output, and the run that measured each."""

    torque_positive: float  # N*m/A
    torque_negative: float  # N*m/A
    velocity: float  # rad/s/V
    lag: float  # s, lag of the motor behind the commanded velocity; 0 if it was not measured
    brake_currents: tuple[float, ...]  # A
    brake_torques: tuple[float, ...]  # N*m, mean of both branches
    origin: dict[str, str]  # source of each constant: the run, or the rig file


def select_constants(
    rig: BenchRigFile, session: SessionFile, measured: Iterable[ConstantsFile]
) -> Constants:
    """Return the constants of a session; the first file that has a constant decides.

    A session that measures a constant commands by the nominal one, since its rows are given in
    terms of that.
    """
    files = () if session.session.endswith("_constant") else tuple(measured)
    servo = rig.servo
    nominal_torque = servo.torque_constant_n_m_per_a
    origin: dict[str, str] = {}

    def first_measured(names: tuple[str, ...], nominal: float) -> float:
        for name in names:
            for file in files:
                if name in file.constants:
                    origin[names[0]] = f"{file.run}, {name}"
                    return file.constants[name].value
        origin[names[0]] = NOMINAL
        return nominal

    positive = first_measured(("torque_constant_positive", "torque_constant"), nominal_torque)
    negative = first_measured(("torque_constant_negative", "torque_constant"), nominal_torque)
    loaded_names = ("velocity_constant_loaded",) if session.session == "driveline" else ()
    velocity = first_measured(
        (*loaded_names, "velocity_constant"), servo.velocity_constant_rad_per_s_per_v
    )
    lag = first_measured(("velocity_loop_lag",), 0.0) if loaded_names else 0.0
    map_file = next((file for file in files if file.brake_map is not None), None)
    if map_file is None or map_file.brake_map is None:
        origin["brake_map"] = NOMINAL
        currents = tuple(point.current_a for point in rig.brake.map)
        torques = tuple(point.torque_n_m for point in rig.brake.map)
    else:
        origin["brake_map"] = map_file.run
        currents, torques = _mean_brake_map(map_file.brake_map)
    return Constants(positive, negative, velocity, lag, currents, torques, origin)


def _mean_brake_map(brake: BrakeMap) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the currents of both branches and the mean of their torques there, strictly rising."""
    import numpy as np  # noqa: PLC0415  (needed for a measured map only)

    rising, falling = brake.rising, brake.falling
    low = max(rising.current_a[0], falling.current_a[0])
    high = min(rising.current_a[-1], falling.current_a[-1])
    currents = [c for c in sorted({*rising.current_a, *falling.current_a}) if low <= c <= high]
    rising_torque = np.interp(currents, rising.current_a, rising.torque_n_m)
    falling_torque = np.interp(currents, falling.current_a, falling.torque_n_m)
    kept_currents, kept_torques = (
        [currents[0]],
        [float(0.5 * (rising_torque[0] + falling_torque[0]))],
    )
    for current, torque in zip(
        currents[1:], 0.5 * (rising_torque + falling_torque)[1:], strict=True
    ):
        if torque > kept_torques[-1]:
            kept_currents.append(current)
            kept_torques.append(float(torque))
    return tuple(kept_currents), tuple(kept_torques)
