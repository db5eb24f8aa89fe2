"""Powers at the stations of the WaveBot, each against its neighbour, averaged over some seconds.

    motor current -> shaft torque sensor -> column load cell        (and: motor -> AC terminals)
      Kt N i v             TRS v                  LCB v                            AC

Absorbed is negative at every station. What may stand between two neighbours is known:

- motor current and torque sensor: nothing, but for errors of both scales;
- torque sensor and column load cell: friction, which takes power on its way out of the body, and
  the magnetic spring, which stores it (`rig.realtime.average` has how much that can be);
- torque sensor and AC: the copper's loss.

So an inverted or dead load cell, a motor that gives another force than its current says, an
analyser whose values stand still, do not go together, whatever the sea and the gains are. A motor
whose force is not known gives no controlled stop: the first pair has a reason of its own.

Power sign: under a law with Kp < 0, no Km, no Z_c and no reference, (TRS - Ki x) v is Kp v^2 and
never positive. Where it is on the average, the motor pushes the body on, and so would the damping
of a controlled stop. The stored energy of Ki is taken off exactly and that of the magnetic spring
is not in the torque sensor: neither a change of gains nor a move of the stator can look like it.
Ticks in which limits, the drive's bus voltage or a fade cut the force count as 0.
"""

from typing import NamedTuple

from rig.realtime import average, axis
from rig.realtime.safety import NO_REASON, RUN, STOP_1, Reason

_FORCE = Reason.FORCE_DISAGREES.value
_SIGN = Reason.POWER_SIGN.value
_BALANCE = Reason.POWER_BALANCE.value


class Params(NamedTuple):
    """Scales and limits of the stations."""

    absorbs: int  # 1: nothing but Kp, Ki and Km is in the law of heave
    newest: float  # share of a tick in the averages of the motor's own
    fed_stop: float  # W, into the body under a law that absorbs
    motor_stop: float  # W, between motor current and torque sensor
    motor_ratio: float  # 1, the same as a share of the torque sensor's power
    newest_slow: float  # share of a tick in the averages that stores of energy are in
    balance_stop: float  # W, between neighbours with a store or a loss between them
    friction: float  # N*s/m, most of it between torque sensor and column load cell
    loss: float  # W/A^2, most of it between torque sensor and AC
    newtons_per_ampere: float  # Kt N


class State(NamedTuple):
    """Averages of powers; W where nothing else is said."""

    fed: float  # into the body, beyond what Ki stores
    motor: float  # Kt N i v less TRS v
    size: float  # |TRS v|
    cells: float  # LCB v less TRS v
    speed: float  # v^2, m^2/s^2
    electric: float  # AC less TRS v
    heat: float  # i^2, A^2
    reason: int  # to stop, or NONE


_NOTHING = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, NO_REASON)


def start() -> State:
    """State at switch-on: no power anywhere."""
    return _NOTHING


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
    """Averages with this tick in them, and the reason to stop that they give.

    ``heave`` is the tick's record and ``fade`` the share of an earlier force in its demand, ``lcb``
    and ``trs`` the tared forces on the body (N), ``ac`` the power at the analyser (W). Without
    power on the drive nothing is averaged.
    """
    if not RUN <= mode <= STOP_1:
        return _NOTHING
    absorbs, newest, fed_stop, motor_stop, ratio, slow, most, friction, loss, scale = params
    fed, motor, size, cells, speed, electric, heat, _ = state
    sense, (position, velocity, _), (kp, ki, km, _), command, _ = heave
    current = sense.current
    shaft = trs * velocity
    given = 0.0
    whole = command.limited == 0 and saturated == 0 and fade == 0.0
    if whole and kp < 0.0 and km == 0.0 and (absorbs == 1 or mode != RUN):
        given = shaft - ki * position * velocity
    fed = average.step(fed, given, newest)
    motor = average.step(motor, scale * current * velocity - shaft, newest)
    size = average.step(size, abs(shaft), newest)
    cells = average.step(cells, lcb * velocity - shaft, slow)
    speed = average.step(speed, velocity * velocity, slow)
    electric = average.step(electric, ac - shaft, slow)
    heat = average.step(heat, current * current, slow)
    reason = NO_REASON
    apart = motor_stop + ratio * size
    if not -apart <= motor <= apart:
        reason = _FORCE
    elif fed > fed_stop:
        reason = _SIGN
    elif not (
        -most - friction * speed <= cells <= most and -most <= electric <= most + loss * heat
    ):
        reason = _BALANCE
    return State(fed, motor, size, cells, speed, electric, heat, reason)
