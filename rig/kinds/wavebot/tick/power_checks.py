"""Checks of the power at the WaveBot's stations against the neighbouring station.

The powers are averaged over some seconds.

    motor current -> shaft torque sensor -> column load cell        (and: motor -> AC terminals)
      Kt N i v             TRS v                  LCB v                            AC

Absorbed power is negative at every station. The possible differences of two neighbours are known:

- motor current and torque sensor: none, except errors of both scales (`motor_power`);
- torque sensor and column load cell: friction, which takes power on its way out of the body, and
  the magnetic spring, which stores energy (`rig.realtime.average` states how much);
- torque sensor and AC: the copper loss.

An inverted or dead load cell or an analyser whose values are frozen is therefore detected in any
sea and with any gains, as is a motor whose force does not agree with its current: the first pair
has a reason of its own.

Power sign: under a law with Kp < 0, no Km, no Z_c and no reference, (TRS - Ki x) v is Kp v^2 and
never positive. The stored energy of Ki is subtracted exactly and that of the
magnetic spring is not in the torque sensor, so that neither a change of gains nor a move of the
stator has the same effect. Ticks in which limits, the drive's bus voltage or a fade reduce the
force count as 0.
"""

from typing import NamedTuple

from rig.realtime import average, axis, motor_power
from rig.realtime.reasons import NO_REASON, Reason
from rig.realtime.safety import RUN, STOP_1

_BALANCE = Reason.POWER_BALANCE.value


class Params(NamedTuple):
    """Scales and limits of the checks."""

    absorbs: int  # 1: the law of heave has only Kp, Ki and Km
    motor: motor_power.Params  # motor current and torque sensor
    slow_weight: float  # share of a tick in the averages that contain stored energy
    balance_stop: float  # W, between neighbours with a store or a loss between them
    friction: float  # N*s/m, upper limit between torque sensor and column load cell
    loss: float  # W/A^2, upper limit between torque sensor and AC
    newtons_per_ampere: float  # Kt N


class State(NamedTuple):
    """Averages of powers; in W where no other unit is given."""

    motor: motor_power.State  # Kt N i v and TRS v; fed into the body: beyond what Ki stores
    load_cells: float  # LCB v less TRS v
    speed_squared: float  # v^2, m^2/s^2
    electric: float  # AC less TRS v
    current_squared: float  # i^2, A^2
    reason: int  # to stop, or NONE


_ZERO_STATE = State(motor_power.start(), 0.0, 0.0, 0.0, 0.0, NO_REASON)


def start() -> State:
    """Return the state at switch-on: no power at any station."""
    return _ZERO_STATE


def step(
    params: Params,
    state: State,
    heave: axis.Record,
    fade: float,
    saturated: int,
    lcb: float,
    trs: float,
    ac: float,
    mode: int,
) -> State:
    """Update the averages with this tick; return them and the reason to stop that they give.

    ``heave`` is the tick's record and ``fade`` the share of an earlier force in its demand, ``lcb``
    and ``trs`` are the tared forces on the body (N), ``ac`` is the power at the analyser (W).
    Without power on the drive the averages are reset.
    """
    if not RUN <= mode <= STOP_1:
        return _ZERO_STATE
    absorbs, motor_params, slow_weight, balance_stop, friction, loss, scale = params
    motor, load_cells, speed_squared, electric, current_squared, _ = state
    sense, (position, velocity, _), (kp, ki, km, _), command, _ = heave
    current = sense.current
    shaft = trs * velocity
    tick_fed = 0.0
    unlimited = command.limited == 0 and saturated == 0 and fade == 0.0
    if unlimited and kp < 0.0 and km == 0.0 and (absorbs == 1 or mode != RUN):
        tick_fed = shaft - ki * position * velocity
    motor = motor_power.step(motor_params, motor, tick_fed, scale * current * velocity, shaft, mode)
    load_cells = average.step(load_cells, lcb * velocity - shaft, slow_weight)
    speed_squared = average.step(speed_squared, velocity * velocity, slow_weight)
    electric = average.step(electric, ac - shaft, slow_weight)
    current_squared = average.step(current_squared, current * current, slow_weight)
    reason = motor.reason
    if reason == NO_REASON and not (
        -balance_stop - friction * speed_squared <= load_cells <= balance_stop
        and -balance_stop <= electric <= balance_stop + loss * current_squared
    ):
        reason = _BALANCE
    return State(motor, load_cells, speed_squared, electric, current_squared, reason)
