"""The constants a session works with: measured ones before the rig's nominal ones."""

from collections.abc import Iterable
from typing import NamedTuple

from rig.config.bench_rig_file import BenchRigFile
from rig.config.constants_file import BrakeMap, ConstantsFile
from rig.config.session_file import SessionFile

NOMINAL = "the rig file, nominal"


class Constants(NamedTuple):
    """Scales of commands, all at the gearbox output, and which run each is from."""

    torque_positive: float  # N*m/A
    torque_negative: float  # N*m/A
    velocity: float  # rad/s/V
    lag: float  # s, of the motor behind the commanded velocity; 0 where nobody measured it
    brake_currents: tuple[float, ...]  # A
    brake_torques: tuple[float, ...]  # N*m, mean of both branches
    origin: dict[str, str]  # of each of them: the run, or the rig file


def gathered(
    rig: BenchRigFile, session: SessionFile, measured: Iterable[ConstantsFile]
) -> Constants:
    """The constants of a session: the first file that has one decides.

    A session that measures a constant commands by the nominal one: its rows are given in terms of
    that.
    """
    files = () if session.session.endswith("_constant") else tuple(measured)
    servo = rig.servo
    nominal_torque = servo.torque_constant_n_m_per_a
    origin: dict[str, str] = {}

    def first(names: tuple[str, ...], otherwise: float) -> float:
        for name in names:
            for one in files:
                if name in one.constants:
                    origin[names[0]] = f"{one.run}, {name}"
                    return one.constants[name].value
        origin[names[0]] = NOMINAL
        return otherwise

    positive = first(("torque_constant_positive", "torque_constant"), nominal_torque)
    negative = first(("torque_constant_negative", "torque_constant"), nominal_torque)
    loaded = ("velocity_constant_loaded",) if session.session == "driveline" else ()
    velocity = first((*loaded, "velocity_constant"), servo.velocity_constant_rad_per_s_per_v)
    lag = first(("velocity_loop_lag",), 0.0) if loaded else 0.0
    mapped = next((one for one in files if one.brake_map is not None), None)
    if mapped is None or mapped.brake_map is None:
        origin["brake_map"] = NOMINAL
        currents = tuple(point.current_a for point in rig.brake.map)
        torques = tuple(point.torque_n_m for point in rig.brake.map)
    else:
        origin["brake_map"] = mapped.run
        currents, torques = _mean(mapped.brake_map)
    return Constants(positive, negative, velocity, lag, currents, torques, origin)


def _mean(brake: BrakeMap) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Currents of both branches and the mean of their torques there, strictly rising."""
    import numpy as np  # noqa: PLC0415  (only where a measured map is used)

    rising, falling = brake.rising, brake.falling
    low = max(rising.current_a[0], falling.current_a[0])
    high = min(rising.current_a[-1], falling.current_a[-1])
    currents = [c for c in sorted({*rising.current_a, *falling.current_a}) if low <= c <= high]
    up = np.interp(currents, rising.current_a, rising.torque_n_m)
    down = np.interp(currents, falling.current_a, falling.torque_n_m)
    kept_currents, kept_torques = [currents[0]], [float(0.5 * (up[0] + down[0]))]
    for current, torque in zip(currents[1:], 0.5 * (up + down)[1:], strict=True):
        if torque > kept_torques[-1]:
            kept_currents.append(current)
            kept_torques.append(float(torque))
    return tuple(kept_currents), tuple(kept_torques)
